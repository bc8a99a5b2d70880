"""Topics turned into what they give, block by block, so that a long log needs little memory."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from attest.readers import ros_decode, ros_points
from attest.readers.ros_decode import Table
from attest.readers.ros_offers import OFFERS, Offer
from attest.readers.ros_topics import Topic
from attest.recording import Note

_ODD = (KeyError, ValueError, IndexError, TypeError)
"""What comes of a message whose definition is not that of its name."""


class Decoded:
    """What the blocks so far have given, and what there is to say of them."""

    def __init__(self) -> None:
        self.parts: dict[tuple[str, ...], list[Offer]] = {}
        self.counts: Counter[tuple[str, bool]] = Counter()
        """Of what was dropped: text, and whether it is a doubt."""
        self.facts: dict[str, Note] = {}
        """What is so of a whole topic, told once."""

    def settle(self, topics: Iterable[Topic]) -> int:
        """Decode what topics hold, drop its bytes, and return how many stay as numbers."""
        size = 0
        for topic in topics:
            if topic.wanted and topic.record:
                for offer in self._offers(topic):
                    key = (offer.role, offer.topic, offer.type, offer.name, offer.child)
                    self.parts.setdefault(key, []).append(offer)
                    size += offer.y.nbytes + offer.stamp.nbytes + offer.record.nbytes
            topic.clear()
        return size

    def offers(self) -> Iterator[Offer]:
        """Yield what each topic gives, its blocks joined."""
        for parts in self.parts.values():
            if len(parts) == 1:
                yield parts[0]
                continue
            yield replace(
                parts[0],
                record=np.concatenate([part.record for part in parts]),
                stamp=np.concatenate([part.stamp for part in parts]),
                y=np.concatenate([part.y for part in parts]),
                empty=sum(part.empty for part in parts),
            )

    def told(self) -> list[Note]:
        """Return what there is to say."""
        counted = [Note(text, count, doubt) for (text, doubt), count in self.counts.items()]
        return [*counted, *self.facts.values()]

    def _offers(self, topic: Topic) -> list[Offer]:
        table = ros_decode.decode(topic)
        if table is None:
            self._fact(f"{topic.name} skipped: no definition of {topic.type} that can be read")
            return []
        if table.broken:
            text = f"{topic.name} message that is not as defined, dropped"
            self.counts[text, table.broken > 0.05 * len(table.record)] += table.broken
        if table.assumed:
            self._fact(f"{topic.type} taken as ROS and PX4 define it: the log does not")
        try:
            return self._offered(table) if len(table) else []
        except _ODD:
            text = f"{topic.name} is not as {topic.type} should be: not used"
            self._fact(text, doubt=True)
            return []

    def _offered(self, table: Table) -> list[Offer]:
        if table.type in OFFERS:
            return list(OFFERS[table.type](table))
        notes: list[Note] = []
        found, hidden = ros_points.points(table, notes)
        self.facts |= {note.text: note for note in notes}
        if hidden:
            self.counts[f"{table.topic} point hidden, without a sample", False] += hidden
        return found

    def _fact(self, text: str, *, doubt: bool = False) -> None:
        self.facts[text] = Note(text, doubt=doubt)


def skipped(topics: Iterable[Topic]) -> Iterator[Note]:
    """Yield what was not even tried to decode."""
    for topic in topics:
        if topic.encoding == "other" and topic.seen:
            yield Note(f"{topic.name} in an encoding that attest cannot decode: skipped")
        if topic.too_large:
            text = f"{topic.name} cloud too large for feature points: skipped"
            yield Note(text, topic.too_large)
