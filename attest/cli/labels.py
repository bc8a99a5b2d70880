"""Names for several observers of one command."""

from collections.abc import Sequence
from pathlib import Path


def labelled(names: Sequence[str]) -> dict[str, str]:
    """Name each configuration: by its name, or its file's stem; of twins the second is NAME-2.

    Names that would be one topic are twins too.
    """
    from attest.writers.json import clean
    from attest.writers.topics import topic_name

    labels: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        stem = clean(Path(name).stem or name)
        label, count = stem, 1
        while topic_name(label) in taken:
            count += 1
            label = f"{stem}-{count}"
        taken.add(topic_name(label))
        labels[label] = name
    return labels
