"""SQLite storage of ROS 2: a table of topics and a table of messages, each a row."""

import sqlite3
from collections.abc import Iterator, Sequence, Sized
from contextlib import closing
from itertools import islice
from operator import methodcaller
from pathlib import Path
from typing import Any

from attest.readers.ros_topics import ZSTD, Crate, Encoding, Topic
from attest.readers.ros_types import ros2_name

MAGIC = b"SQLite format 3\0"
_Columns = tuple[Sequence[Any], Sequence[Any], Sequence[Any]]
"""Topics, stamps and messages of some rows."""

_PLAIN = "SELECT count(*) FROM sqlite_master WHERE name = ? AND type = 'table'"
_VIRTUAL = "SELECT count(*) FROM sqlite_master WHERE name = ? AND rootpage = 0"
_HEAD, _SMALLEST_PAGE = 100, 512
_ROWS, _LONG, _BYTES = 128, 64 << 10, 8 << 20
"""Fetched at once: rows whose messages are no longer than so many bytes; more bytes else."""
_TYPED = (
    "CASE typeof(timestamp) WHEN 'integer' THEN timestamp END, "
    f"CASE typeof(data) WHEN 'blob' THEN iif(length(data) > {_LONG}, rowid, data) END"
)
_ONE = "SELECT CASE typeof(data) WHEN 'blob' THEN data END FROM messages WHERE rowid = ?"
"""Other types are none: a text takes more room as text than it has in the file."""
_STEPS = 100_000
"""Between looks at how long a query works; SQLite's own steps."""
_BROKEN = (sqlite3.Error, MemoryError)
"""What SQLite raises: it is out of memory where a broken row says that it is too long."""
_is_packed = methodcaller("startswith", ZSTD)
_FORMS = {"ros2msg": "msg", "ros2idl": "idl"}


def read(path: Path, crate: Crate) -> None:
    """Take the messages of a database into the crate."""
    size = path.stat().st_size
    wal = path.with_name(path.name + "-wal")
    if wal.is_file() and wal.stat().st_size:
        crate.damage[f"{wal.name} beside the log not read: the log was not closed"] = 1
    try:
        with closing(_opened(path, size)) as connection:
            _guard(connection, size)
            _read(connection, crate)
    except (*_BROKEN, ValueError, OverflowError) as error:
        reason = str(error)[:60] or "a row that does not fit into it"
        text = f"database broken ({reason}), read as far as it goes"
        crate.damage[text] += 1


def _opened(path: Path, size: int) -> sqlite3.Connection:
    """Open a database; SQLite does not, where the file is shorter than its head says."""
    with path.open("rb") as file:
        head = file.read(_HEAD)
    page = int.from_bytes(head[16:18], "big")
    page = 1 << 16 if page == 1 else page
    if page < _SMALLEST_PAGE or int.from_bytes(head[28:32], "big") * page <= size:
        # immutable: nothing is locked, and no file is made beside a log
        return sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1&mode=ro", uri=True)
    data = bytearray(path.read_bytes()[: size // page * page])
    data[18:20] = b"\1\1"  # no journal
    data[28:32] = (size // page).to_bytes(4, "big")
    connection = sqlite3.connect(":memory:")
    connection.deserialize(bytes(data))
    return connection


def _guard(connection: sqlite3.Connection, size: int) -> None:
    """Let no query take memory or time out of proportion to the file."""
    connection.text_factory = lambda text: text.decode("utf-8", "replace")
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(max(size, 1 << 20), (1 << 31) - 1))
    connection.execute("PRAGMA trusted_schema=OFF")
    left = 1000 + size // 100

    def too_long() -> bool:
        nonlocal left
        left -= 1
        return left < 0

    connection.set_progress_handler(too_long, _STEPS)


def _read(connection: sqlite3.Connection, crate: Crate) -> None:
    if not (_is_plain(connection, "messages") and _is_plain(connection, "topics")):
        crate.damage["database without the tables of a ROS 2 log"] += 1
        return
    texts = _definitions(connection)
    topics: dict[Any, Topic] = {}
    rows = connection.execute("SELECT id, name, type, serialization_format FROM topics")
    for number, name, type_, encoding in rows.fetchall():
        form: Encoding = "cdr" if encoding == "cdr" else "other"
        definition = texts.get(str(type_), ("", ""))
        topics[number] = crate.topic(str(name), ros2_name(str(type_)), form, definition)
    wanted = {number: topic for number, topic in topics.items() if topic.wanted}
    _count(connection, {n: topic for n, topic in topics.items() if n not in wanted})
    _messages(connection, wanted, crate)


def _is_plain(connection: sqlite3.Connection, table: str) -> bool:
    """Whether a table is there, and is no view, has no computed column and no code behind it.

    Those run what the file says, for as long as it likes.
    """
    if connection.execute(_PLAIN, (table,)).fetchone() != (1,):
        return False
    columns = connection.execute(f"PRAGMA table_xinfo({table})").fetchall()
    shadowed = connection.execute(_VIRTUAL, (table,)).fetchone() != (0,)
    return bool(columns) and not any(hidden for *_, hidden in columns) and not shadowed


def _definitions(connection: sqlite3.Connection) -> dict[str, tuple[str, str]]:
    """Return the definitions that the log carries, none before ROS 2 Iron."""
    if not _is_plain(connection, "message_definitions"):
        return {}
    query = "SELECT topic_type, encoded_message_definition, encoding FROM message_definitions"
    try:
        rows = connection.execute(query).fetchall()
    except sqlite3.OperationalError:
        return {}
    return {
        str(type_): (str(text), _FORMS[form])
        for type_, text, form in rows
        if text and form in _FORMS
    }


def _count(connection: sqlite3.Connection, topics: dict[Any, Topic]) -> None:
    """Count the messages of topics that nobody wants."""
    if topics:
        query = f"SELECT topic_id, count(*) FROM messages WHERE {_among(topics)} GROUP BY topic_id"  # noqa: S608
        for number, count in connection.execute(query, list(topics)):
            topics[number].seen += count


def _among(topics: Sized) -> str:
    return f"topic_id IN ({','.join('?' * len(topics))})"


def _messages(connection: sqlite3.Connection, topics: dict[Any, Topic], crate: Crate) -> None:
    """Read the messages of all wanted topics in one pass."""
    for columns in _batches(connection, list(topics)):
        if not crate.has_room():
            return
        numbers, stamps, data = _sound(columns, crate)
        crate.effort -= sum(map(len, data))  # more than the file's bytes where pages are shared
        _take(numbers, stamps, data, topics, crate)


def _batches(connection: sqlite3.Connection, topics: list[Any]) -> Iterator[_Columns]:
    """Yield some rows at a time; those before the first broken one too."""
    query = f"SELECT topic_id, {_TYPED} FROM messages WHERE {_among(topics)}"  # noqa: S608
    cursor = connection.execute(query, topics)
    broken: Exception | None = None
    while broken is None:
        rows: list[Any] = []
        try:
            _fetch(cursor, rows)
        except _BROKEN as error:
            broken = error
        if not rows:
            break
        columns = _turned(rows)
        some_long = int in {*map(type, columns[2])}
        yield from _with_long(connection, rows) if some_long else [columns]
    if broken is not None:
        raise broken


def _fetch(cursor: Iterator[Any], rows: list[Any]) -> None:
    """Add some rows; those before an error stay."""
    rows.extend(islice(cursor, _ROWS))


def _turned(rows: list[Any]) -> _Columns:
    numbers, stamps, data = zip(*rows, strict=True)
    return numbers, stamps, data


def _with_long(connection: sqlite3.Connection, rows: list[Any]) -> Iterator[_Columns]:
    """Fetch the messages that are longer too, one by one, for together they have no bound."""
    held: list[Any] = []
    size = 0
    for number, stamp, data in rows:
        try:
            (found,) = (
                connection.execute(_ONE, (data,)).fetchone() if isinstance(data, int) else (data,)
            )
        except _BROKEN:
            if held:
                yield _turned(held)
            raise
        held.append((number, stamp, found))
        size += len(found or b"")
        if size > _BYTES:
            yield _turned(held)
            held, size = [], 0
    if held:
        yield _turned(held)


def _take(
    numbers: Sequence[Any],
    stamps: Sequence[int],
    data: Sequence[bytes],
    topics: dict[Any, Topic],
    crate: Crate,
) -> None:
    """Hand some rows to their topics."""
    if data and _is_packed(data[0]):  # a log packs all of its messages or none
        data = [_plain(message, crate) for message in data]
    for number in set(numbers):
        if len(set(numbers)) == 1:
            own = stamps, data
        else:
            mine = [i for i, other in enumerate(numbers) if other == number]
            own = [stamps[i] for i in mine], [data[i] for i in mine]
        topics[number].seen += len(own[0])
        topics[number].extend(*own)


def _sound(columns: _Columns, crate: Crate) -> _Columns:
    """Leave out the rows that are not as they should be."""
    if {*map(type, columns[1])} == {int} and {*map(type, columns[2])} == {bytes}:
        return columns
    rows = [*zip(*columns, strict=True)]
    sound = [row for row in rows if isinstance(row[1], int) and isinstance(row[2], bytes)]
    crate.damage["message without a stamp or data, left out"] += len(rows) - len(sound)
    return _turned(sound) if sound else ([], [], [])


def _plain(data: bytes, crate: Crate) -> bytes:
    """Unpack a message that was compressed on its own; nothing where it does not unpack."""
    if not _is_packed(data):
        return data
    return crate.unpack(data, "zstd", crate.largest_chunk) or b""
