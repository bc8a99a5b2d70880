"""The rows of a ULog by topic: pyulog tells what they hold, all of a topic are read at once."""

from contextlib import redirect_stdout
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.errors import ReadError
from attest.readers.ulog_format import TYPES
from attest.readers.ulog_frames import Ints, Sound
from attest.readers.ulog_topics import Stream


def definitions(path: Path, sound: Sound) -> Any:
    """Let pyulog read what a log says about itself.

    Raises
    ------
    ReadError
        It cannot.
    """
    from pyulog import ULog
    from pyulog.exceptions import ULogException

    try:
        with redirect_stdout(StringIO()):  # where the library warns, and data is to go
            return ULog(BytesIO(sound.definitions))
    except (ULogException, ValueError, TypeError, LookupError) as error:
        raise ReadError(f"{path}: not a readable ULog: {error}. Record the log again.") from error


def streams(data: bytes, sound: Sound, library: Any) -> dict[str, list[Stream]]:
    """Return the instances of each topic, in order."""
    parts: dict[str, dict[int, list[NDArray[np.void]]]] = {}
    for dataset in library.data_list:
        fields = [(field.field_name, TYPES[field.type_str]) for field in dataset.field_data]
        found = _rows(data, sound.at[dataset.msg_id], np.dtype(fields))
        parts.setdefault(dataset.name, {}).setdefault(dataset.multi_id, []).append(found)
    return {
        name: [
            _stream(name, i, np.concatenate(found), len(instances) > 1 or i > 0)
            for i, found in sorted(instances.items())
        ]
        for name, instances in parts.items()
    }


def _rows(data: bytes, at: Ints, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    shape = (max(0, len(data) - dtype.itemsize + 1),)
    every: NDArray[np.void] = np.ndarray(shape, f"V{dtype.itemsize}", data, strides=(1,))
    return every[at].view(dtype)


def _stream(name: str, instance: int, rows: NDArray[np.void], numbered: bool) -> Stream:
    label = f"{name}[{instance}]" if numbered else name
    columns = {column: np.ascontiguousarray(rows[column]) for column in rows.dtype.names or ()}
    return Stream(label, name, instance, columns)
