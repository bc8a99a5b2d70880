"""Summaries that somebody else wrote, or nobody."""

import math
import os
import sys
from contextlib import suppress

import pyarrow
import pyarrow.parquet
import pytest
import summaries
from hypothesis import given
from hypothesis import strategies as st

from attest import fleet
from attest.errors import ReadError
from attest.fleet import Choice, reading


@pytest.fixture
def refused(tmp_path):
    """Return the message about a summary of these bytes."""

    def refused(data, name="summary.csv"):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ReadError) as caught:
            fleet.fleet([tmp_path / name], Choice())
        message = str(caught.value)
        assert "\n" not in message
        return message.removeprefix(f"{tmp_path / name}: ")

    return refused


def test_csv_and_parquet_tell_the_same(tmp_path):
    folder = summaries.write(tmp_path, summaries.steady(30, "=1+1"))
    documents = [fleet.fleet([folder / name], Choice()) for name in reading.NAMES]
    for document in documents:
        del document["summaries"]
    assert documents[0] == documents[1]
    assert documents[0]["vehicles"][0]["vehicle"] == "=1+1"


def test_columns_that_an_older_version_lacks_are_told(tmp_path):
    columns = {key: [row[key] for row in summaries.steady(3)] for key in summaries.steady(1)[0]}
    del columns["hard_iron_x_ut"]
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "old.parquet")
    document = fleet.fleet([tmp_path / "old.parquet"], Choice())
    assert "hard_iron_x_ut" in document["summaries"][0]["lacks"]
    assert "gyro_bias_x" not in document["summaries"][0]["lacks"]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "no column path, observer, status. Name a summary of `attest batch`."),
        (b"path,observer\na,fts\n", "no column status. Name a summary of `attest batch`."),
        (b"path,observer,status,path\n", "the column path is there twice. Name a summary"),
        (
            b"path,observer,status,total_rmse_deg\na,fts,ok,high\n",
            "cannot be read: In CSV column #3: CSV conversion error to double",
        ),
        (b"path,observer,status\na,fts\n", "cannot be read: CSV parse error: "),
        (b"\xff\xfe\x00", "cannot be read: 'utf-8' codec can't decode"),
        (b"path,observer,status\n\xff,fts,ok\n", "cannot be read: 'utf-8' codec can't decode"),
        (b"PAR1 and no more", "cannot be read: "),
        (b"path,observer,status\n", "no row with a figure that can be used (0 read). Name other"),
        (b"path,observer,status\na,fts,ok\n", "no row with a figure that can be used (1 read)"),
    ],
)
def test_what_is_no_summary_is_refused_in_a_line(refused, data, words):
    assert refused(data).startswith(words)


def test_wrong_types_are_refused(tmp_path):
    columns = {key: [row[key] for row in summaries.steady(3)] for key in summaries.steady(1)[0]}
    for name, values, words in (
        ("total_rmse_deg", [[1.0]] * 3, "the column total_rmse_deg is list<.*>, not a number"),
        ("path", [{"a": 1}] * 3, "the column path is struct<.*>, not text"),
    ):
        table = pyarrow.table(columns | {name: values})
        pyarrow.parquet.write_table(table, tmp_path / "wrong.parquet")
        with pytest.raises(ReadError, match=words):
            fleet.fleet([tmp_path / "wrong.parquet"], Choice())


def test_numbers_that_are_none_are_left_out(tmp_path):
    rows = summaries.steady(4)
    for row, value in zip(rows, (math.nan, math.inf, None), strict=False):
        row["total_rmse_deg"] = value
    document = fleet.fleet([summaries.write(tmp_path, rows)], Choice())
    (one,) = [one for one in document["series"] if one["figure"] == "total RMSE"]
    assert one["flights"] == 1


@pytest.mark.parametrize(
    "when", ["9999-12-31T23:59:59-23:59", "9999-12-31T23:59:59", "2200-01-01", "0001-01-01"]
)
def test_time_that_no_clock_has_is_unknown(tmp_path, when):
    rows = summaries.steady(12)
    rows[3] |= {"began_utc": when, "ran_utc": when}
    document = fleet.fleet([summaries.write(tmp_path, rows)], Choice())
    assert document["rows"]["undated"] == 1
    assert document["last_utc"] == "2026-01-12T12:00:00+00:00"


def test_version_of_many_digits_is_older_than_one(tmp_path):
    rows = [row | {"version": "9" * 5000, "total_rmse_deg": 9.0} for row in summaries.steady(4)]
    rows += [row | {"total_rmse_deg": 1.0} for row in summaries.steady(4)]
    document = fleet.fleet([summaries.write(tmp_path, rows[::-1])], Choice())
    (one,) = [one for one in document["series"] if one["figure"] == "total RMSE"]
    assert (one["flights"], one["median"]) == (4, 1.0)


@pytest.mark.filterwarnings("error")
def test_numbers_that_sums_cannot_hold_are_left_out(tmp_path):
    rows = summaries.steady(30)
    for i, row in enumerate(rows):
        row["hard_iron_x_ut"] = (-1.0) ** i * 1e308 if i > 14 else 1e-308
    document = fleet.fleet([summaries.write(tmp_path, rows)], Choice())
    assert {one["flights"] for one in document["series"] if one["figure"] == "hard iron x"} == {15}
    assert fleet.text_of_fleet(document, fleet.write_results(document, tmp_path / "out"))


def test_too_many_rows_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "MOST_BYTES", 1000)
    with pytest.raises(ReadError, match=r"too many rows for memory\. Name fewer summaries\."):
        fleet.fleet([summaries.write(tmp_path, summaries.steady(20))], Choice())


def test_folder_without_a_summary_and_what_is_no_file_are_refused(tmp_path):
    with pytest.raises(ReadError, match=r"no summary.parquet or summary.csv in this folder\."):
        fleet.fleet([tmp_path], Choice())
    with pytest.raises(ReadError, match="no such file"):
        fleet.fleet([tmp_path / "gone"], Choice())
    if sys.platform != "win32":
        os.mkfifo(tmp_path / "pipe")
        with pytest.raises(ReadError, match="not a regular file"):
            fleet.fleet([tmp_path / "pipe"], Choice())


@given(st.data())
def test_broken_summary_is_read_or_refused(tmp_path_factory, data):
    folder = tmp_path_factory.getbasetemp() / "broken"
    name = data.draw(st.sampled_from(reading.NAMES))
    content = bytearray((summaries.write(folder, summaries.steady(12)) / name).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = folder / f"cut {name}"
    path.write_bytes(content[: data.draw(st.integers(1, len(content)))])
    with suppress(ReadError):
        assert fleet.text_of_fleet(fleet.fleet([path], Choice()), [])
