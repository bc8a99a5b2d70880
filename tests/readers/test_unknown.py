"""What is said of files that no reader knows."""

import bz2
import gzip
import io
import lzma
import zipfile

import pytest

from attest import readers
from attest.config import Csv
from attest.errors import ReadError
from attest.readers.options import ReadOptions

MAP = "by input.csv in a YAML (README.md, Configuration), and name it by --observer"
FORMATS = "ros, ulog, dataflash, tlog, sensor_logger, csv"


def refusal(path, data, options=None):
    path.write_bytes(data)
    assert not readers.is_log(path)
    with pytest.raises(ReadError) as caught:
        readers.read(path, options)
    return str(caught.value).removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("t,gx,gy,gz\n0,1,2,3\n", "t, gx, gy, gz"),
        ("t;gx;gy;gz\n0,5;1,5;2,5;3,5\n", "t, gx, gy, gz"),
        ("t gx gy gz\n0 1 2 3\n", "t, gx, gy, gz"),
        ("# t,gx,gy,gz\n0,1,2,3\n", "t, gx, gy, gz"),
        ("t,gx,gy,gz\ns,dps,dps,dps\n0,1,2,3\n", "t, gx, gy, gz"),
        ("time,gyro_x,gyro_y,gyro_z\n0,1,2,3\n", "time, gyro_x, gyro_y, gyro_z"),
        (
            ",".join(f"c{i}" for i in range(12)) + "\n" + ",".join(["1"] * 12),
            "c0, c1, c2, c3, c4, c5, c6, c7, … (12 in all)",
        ),
    ],
)
def test_a_csv_of_other_names_is_told_with_them_and_the_cure(tmp_path, text, names):
    assert refusal(tmp_path / "a.csv", text.encode()) == (
        f"a CSV whose columns attest does not know: {names}. Tell them {MAP}."
    )


def test_lines_before_the_columns_are_counted_for_the_mapping(tmp_path):
    text = "Logger v3\nSerial,12\n\nt,gx,gy,gz\ns,dps,dps,dps\n0,1,2,3\n"
    assert refusal(tmp_path / "a.csv", text.encode()) == (
        f"a CSV whose columns attest does not know: t, gx, gy, gz. Tell them {MAP}, with skip: 3."
    )
    text = "Logger v3\r\nSerial 12\r\n\r\n0\t1\t2\t3\r\n1\t1\t2\t3\r\n"
    assert refusal(tmp_path / "a.csv", text.encode()) == (
        f"a CSV without names of its columns. Tell their numbers {MAP}, "
        "with header: false and skip: 3."
    )
    assert refusal(tmp_path / "a.csv", b"sep=;\nt;gx;gy;gz\n0;1;2;3\n") == (
        f"a CSV whose columns attest does not know: t, gx, gy, gz. Tell them {MAP}."
    )


def test_a_csv_without_names_is_told_so(tmp_path):
    assert refusal(tmp_path / "a.csv", b"0,1,2,3\n1,1,2,3\n") == (
        f"a CSV without names of its columns. Tell their numbers {MAP}, with header: false."
    )


@pytest.mark.parametrize(
    "data",
    [
        b"Dear sir,\nhow are you,\nI am well\n",
        b"\x89PNG\r\n\0,1,2\n3,4\n",
        b"\xff\xfe\0\1",
        b"1\n2\n",
    ],
)
def test_what_is_no_csv_is_not_called_one(tmp_path, data):
    assert refusal(tmp_path / "a.csv", data) == (
        f"not a log that attest knows ({FORMATS}). Check that it is the file you meant."
    )


def test_two_bytes_for_each_character_are_told(tmp_path):
    data = "time_s,gyro_x,gyro_y,gyro_z\r\n0,1,2,3\r\n".encode("utf-16")
    assert refusal(tmp_path / "a.csv", data) == "a CSV in UTF-16. Save it as UTF-8."


def zipped(data):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("log.tlog", data)
    return file.getvalue()


@pytest.mark.parametrize(
    ("pack", "name"),
    [
        (gzip.compress, "gzip"),
        (bz2.compress, "bzip2"),
        (lzma.compress, "xz"),
        (zipped, "zip"),
        (lambda data: b"7z\xbc\xaf\x27\x1c\0\4" + data, "7z"),
        (lambda data: b"\x28\xb5\x2f\xfd" + data, "zstd"),
    ],
)
def test_what_is_compressed_is_to_be_unpacked(tmp_path, sample_logs, pack, name):
    data = pack((sample_logs / "quadcopter.tlog").read_bytes())
    told = f"is compressed ({name}). Unpack it first."
    assert refusal(tmp_path / "log.tlog", data) == told
    keys = {"time": {"column": 1}, "gyro": {"columns": [2, 3, 4]}}
    mapped = ReadOptions(csv=Csv.model_validate(keys))
    assert refusal(tmp_path / "log.tlog", data, mapped) == told
