import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from attest.errors import ReadError
from attest.readers import csv, csv_signals
from attest.readers.options import ReadOptions

GYRO = "time_s,gyro_x,gyro_y,gyro_z"
NOT_DECLARED = "world axes not declared: north-east-down and body forward-right-down taken"
AS_TRUTH = "reference taken as truth, as the file declares it by ref_q columns"


@pytest.fixture
def load(tmp_path):
    def load_text(text, **options):
        path = tmp_path / "log.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return csv.read(path, ReadOptions(**{"world": "ned"} | options))

    return load_text


def notes(recording):
    return {note.text: note.count for note in recording.notes}


def test_reads_every_canonical_column(load):
    columns = {
        "time_s": 1.5, "gyro_x": 1, "gyro_y": 2, "gyro_z": 3, "accel_x": 4, "accel_y": 5,
        "accel_z": -9, "mag_x": 20, "mag_y": 1, "mag_z": 43, "ref_qw": 0, "ref_qx": 1, "ref_qy": 0,
        "ref_qz": 0, "lat_deg": 47, "lon_deg": 8, "alt_m": 500, "vel_x": 7, "vel_y": 8, "vel_z": 9,
        "torque_x": 0.1, "torque_y": 0.2, "torque_z": 0.3, "point1_x": 1, "point1_y": 2,
        "point1_z": 3, "sun_x": 1, "sun_y": 0, "sun_z": 0,
    }  # fmt: skip
    recording = load(",".join(columns) + "\n" + ",".join(map(str, columns.values())) + "\n")
    assert {name: signal.y[0].tolist() for name, signal in recording.signals.items()} == {
        "gyro": [1, 2, 3],
        "accel": [4, 5, -9],
        "mag": pytest.approx([20e-6, 1e-6, 43e-6]),
        "position": [47, 8, 500],
        "velocity": [7, 8, 9],
        "torque": [0.1, 0.2, 0.3],
        "point1": [1, 2, 3],
        "sun": [1, 0, 0],
    }
    reference = recording.references["ref"]
    assert (reference.kind, reference.q.tolist()) == ("truth", [[0, 1, 0, 0]])
    assert recording.signals["gyro"].t.tolist() == [1_500_000_000]
    assert notes(recording) == {AS_TRUTH: 1}
    assert recording.format == "csv"


def test_each_signal_keeps_its_own_clock(load):
    recording = load(f"{GYRO},mag_x,mag_y,mag_z\n0,1,2,3,,,\n.01,1,2,3,4,5,6\n0.02,,,,7,8,9\n")
    assert recording.signals["gyro"].t.tolist() == [0, 10_000_000]
    assert recording.signals["mag"].t.tolist() == [10_000_000, 20_000_000]
    assert notes(recording) == {}


@pytest.mark.parametrize(
    ("stamp", "t"),
    [
        ("0", 0),
        ("-1.5", -1_500_000_000),
        ("1e-3", 1_000_000),
        ("0.010000000000000002", 10_000_000),
        ("0.0000000004", 0),
        ("1777627812.387000001", 1_777_627_812_387_000_001),
        ("1777627812.3870000014", 1_777_627_812_387_000_001),
        ("1.777627812387000001e9", 1_777_627_812_387_000_001),
        ("1.777627812387000001000e+09", 1_777_627_812_387_000_001),
    ],
)
def test_time_is_exact_to_the_nanosecond(load, stamp, t):
    recording = load(f"{GYRO}\n{stamp},1,2,3\n")
    assert recording.signals["gyro"].t.tolist() == [t]


@given(
    start=st.sampled_from([0, 1_777_627_812]),
    steps=st.lists(st.integers(1, 10**10), min_size=1, max_size=20),
    seed=st.integers(0, 2**32 - 1),
)
def test_round_trip_is_exact(tmp_path_factory, start, steps, seed):
    t = start * 10**9 + np.cumsum(steps)
    y = np.random.default_rng(seed).standard_normal((len(t), 3)) * 10.0 ** (seed % 30 - 15)
    rows = [
        f"{a // 10**9}.{a % 10**9:09d},{','.join(map(repr, b))}"
        for a, b in zip(t.tolist(), y.tolist(), strict=True)
    ]
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    path.write_text("\n".join([GYRO, *rows]))
    recording = csv.read(path, ReadOptions(world="ned"))
    assert_array_equal(recording.signals["gyro"].t, t)
    assert_array_equal(recording.signals["gyro"].y, y)
    assert recording.clock.utc_offset == (0 if start else None)
    assert recording.notes == ()


@pytest.mark.parametrize(
    "text",
    [
        "\ufefftime_s,gyro_x,gyro_y,gyro_z\n0,1,2,3\n1,4,5,6\n",
        "time_s, gyro_x, gyro_y, gyro_z\r\n0, 1, 2, 3\r\n1, 4, 5, 6\r\n",
        "# made by hand\n\n# with love\ntime_s,gyro_x,gyro_y,gyro_z\n0,1,2,3\n# half\n1,4,5,6\n",
        "time_s;gyro_x;gyro_y;gyro_z\n0,0;1,0;2,0;3,0\n1,0;4,0;5,0;6,0\n",
        "time_s;gyro_x;gyro_y;gyro_z\n0.0;1;2;3\n1.0;4;5;6\n",
        "time_s\tgyro_x\tgyro_y\tgyro_z\n0\t1\t2\t3\n1\t4\t5\t6\n",
        '"time_s","gyro_x","gyro_y","gyro_z"\n"0","1","2","3"\n1,4,5,6\n',
        "gyro_z,time_s,gyro_y,gyro_x\n3,0,2,1\n6,1,5,4",
    ],
)
def test_reads_the_usual_dialects(load, text):
    recording = load(text)
    assert recording.signals["gyro"].t.tolist() == [0, 10**9]
    assert recording.signals["gyro"].y.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert recording.notes == ()


def test_junk_rows_are_dropped_and_counted(load):
    recording = load(
        f"{GYRO}\n0,1,2,3\n1,1,2\n2,1,2,3,4\n3,x,2,3\n4,1,,3\n5,nan,2,3\n6,1,inf,3\n,1,2,3\n"
        "7,1,2,3\n8,1,2,3\n8,1,2,3\n6.5,1,2,3\nNaN,1,2,3\n9,1,2,3\n"
    )
    assert recording.signals["gyro"].t.tolist() == [0, 7 * 10**9, 8 * 10**9, 9 * 10**9]
    assert notes(recording) == {
        "rows with another number of cells than the header, skipped": 2,
        "cells that are no number, taken as empty": 4,
        "rows without a time that can be used, skipped": 2,
        "gyro rows with a cell missing, dropped": 4,
        "gyro rows whose time does not advance, dropped": 2,
    }


def test_values_that_are_not_finite_are_dropped_and_counted(load):
    recording = load(f"{GYRO}\n0,1,2,3\n1,nan,2,3\n2,1,-inf,3\n3,1,1e999,3\n4,1,2,3\n")
    assert recording.signals["gyro"].t.tolist() == [0, 4 * 10**9]
    assert notes(recording) == {"gyro rows with a value that is not finite, dropped": 3}


def test_values_too_large_to_be_squared_are_dropped_and_counted(load):
    recording = load(f"{GYRO}\n0,1,2,3\n1,1e308,2,3\n2,1,2,-2e100\n3,1,2,1e100\n4,1,2,3\n")
    assert recording.signals["gyro"].t.tolist() == [0, 3 * 10**9, 4 * 10**9]
    assert notes(recording) == {"gyro rows beyond 1e+100, dropped": 2}


def test_one_wild_stamp_costs_itself_alone(load):
    rows = "".join(f"{4e9 if i == 500 else i},1,2,3\n" for i in range(1000))
    recording = load(f"{GYRO}\n{rows}")
    assert len(recording.signals["gyro"].t) == 999
    assert notes(recording) == {"gyro rows whose time does not advance, dropped": 1}


@given(st.lists(st.integers(0, 12), max_size=12))
def test_kept_stamps_are_the_most_that_advance(stamps):
    t = np.array(stamps, np.int64)
    good = csv_signals._advancing(t)
    longest = [1] * len(stamps)
    for i in range(len(stamps)):
        longest[i] += max((longest[j] for j in range(i) if stamps[j] < stamps[i]), default=0)
    assert np.all(np.diff(t[good]) > 0)
    assert good.sum() == max(longest, default=0)


def test_reference_is_normalised_and_its_sign_continuous(load):
    recording = load(
        f"{GYRO},ref_qw,ref_qx,ref_qy,ref_qz\n0,0,0,0,2,0,0,0\n1,0,0,0,-1,0.01,0,0\n"
        "2,0,0,0,0,0,0,0\n3,0,0,0,nan,1,0,0\n4,0,0,0,1e200,0,0,0\n"
    )
    q = recording.references["ref"].q
    assert_allclose(q, [[1, 0, 0, 0], [0.99995, -0.0099995, 0, 0]], atol=1e-7)
    assert notes(recording) == {
        "ref_q rows with a value that is not finite, dropped": 1,
        "ref_q rows of no usable length, dropped": 2,
        "ref_q rows not of unit length, normalised": 1,
        AS_TRUTH: 1,
    }


def test_positions_off_the_globe_are_dropped(load):
    recording = load(f"{GYRO},lat_deg,lon_deg,alt_m\n0,0,0,0,47,8,500\n1,0,0,0,470,8,500\n")
    assert len(recording.signals["position"].t) == 1
    assert notes(recording) == {"position rows off the globe, dropped": 1}


def test_world_is_as_declared_or_noted(load):
    text = f"{GYRO},accel_x,accel_y,accel_z\n0,0,0,0,0,0,9.8\n"
    enu = load(text, world="enu")
    assert (enu.world, enu.body, enu.notes) == ("enu", "flu", ())
    assumed = load(text, world=None)
    assert (assumed.world, assumed.body) == ("ned", "frd")
    assert notes(assumed) == {NOT_DECLARED: 1}
    assert [note.doubt for note in assumed.notes] == [False]


def test_columns_of_no_signal_are_named(load):
    recording = load(f"{GYRO},accel_x,position_x,position_y,position_z,,temp\n0,1,2,3,4,5,6,7,,8\n")
    assert [*recording.signals] == ["gyro"]
    unused = "columns not used: accel_x, position_x, position_y, position_z, temp"
    assert notes(recording) == {unused: 5}


def test_an_empty_signal_is_noted(load):
    recording = load(f"{GYRO},mag_x,mag_y,mag_z\n0,1,2,3,,,\n")
    assert [*recording.signals] == ["gyro"]
    assert notes(recording) == {"signal without a usable row: mag": 1}


def test_rows_that_run_backwards_are_turned_round(load):
    recording = load(
        f"{GYRO},mag_x,mag_y,mag_z\n9,7,8,9,,,\n1.5,4,5,6,1,2,3\n,0,0,0,,,\n0,1,2,3,,,\n"
    )
    assert recording.signals["gyro"].t.tolist() == [0, 15 * 10**8, 9 * 10**9]
    assert recording.signals["gyro"].y.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert recording.signals["mag"].t.tolist() == [15 * 10**8]
    told = notes(recording)
    assert told.pop("time runs backwards: rows taken from the last to the first") == 1
    assert told == {"rows without a time that can be used, skipped": 1}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no header line. Start the file with time_s, gyro_x, …."),
        ("\n# only\n", "no header line. Start the file with time_s, gyro_x, …."),
        ("t,gyro_x\n0,1\n", "no time_s column. Name the column of seconds time_s."),
        (GYRO, "a header and no rows. Check how the file was made."),
        (f"{GYRO}\n\n\n", "a header and no rows. Check how the file was made."),
        (
            "time_s,accel_x\n0,1\n",
            "no gyro_x, gyro_y, gyro_z, which an observer needs, in rad/s. The file has: time_s, "
            "accel_x. Rename them, or tell them by input.csv in a YAML (README.md, Configuration), "
            "and name it by --observer.",
        ),
        (f"{GYRO},gyro_x\n0,1,2,3,4\n", "two columns are named gyro_x. Rename one."),
        (
            f"{GYRO}\n0,1,2\n",
            "no row has a time and gyro_x, gyro_y, gyro_z. Fill the cells.",
        ),
        (
            f"{GYRO}\n0,b,c,d\n",
            "no row has a time and gyro_x, gyro_y, gyro_z. Fill the cells.",
        ),
        (f"{GYRO}\n,1,2,3\n", "no row has a time and gyro_x, gyro_y, gyro_z. Fill the cells."),
        (
            f"{GYRO}\n2026-01-01 12:00,1,2,3\n",
            "time_s, such as 2026-01-01 12:00, is no number. Give seconds, or input.csv.time.",
        ),
        (
            f"{GYRO}\nnan,1,2,3\n",
            "time_s, such as nan, is no number. Give seconds, or input.csv.time.",
        ),
        (
            f"{GYRO}\n1777627812387,1,2,3\n",
            "time_s, such as 1777627812387, looks like milliseconds since 1970. "
            "Read it so: --set input.csv.time.unit=ms",
        ),
        (
            f"{GYRO}\n1777627812387000,1,2,3\n",
            "time_s, such as 1777627812387000, looks like microseconds since 1970. "
            "Read it so: --set input.csv.time.unit=us",
        ),
        (
            f"{GYRO}\n1777627812387000001,1,2,3\n",
            "time_s, such as 1777627812387000001, looks like nanoseconds since 1970. "
            "Read it so: --set input.csv.time.unit=ns",
        ),
        (
            f"{GYRO}\n1e300,1,2,3\n",
            "time_s, such as 1e300, is too large for a time. Give its unit by input.csv.time.",
        ),
    ],
)
def test_what_cannot_be_used_is_one_line(load, tmp_path, text, message):
    with pytest.raises(ReadError) as caught:
        load(text)
    assert str(caught.value) == f"{tmp_path / 'log.csv'}: {message}"


def test_a_missing_file_is_one_line(tmp_path):
    with pytest.raises(ReadError, match=r"No such file or directory\. Check the file\.$"):
        csv.read(tmp_path / "none.csv", ReadOptions())


@pytest.mark.parametrize(
    ("head", "known"),
    [
        (b"time_s,gyro_x\n", True),
        (b"\xef\xbb\xbf# note\r\n\r\n time_s ; gyro_x\r\n", True),
        (b'"time_s"\t"gyro_x"', True),
        (b"timestamp,time_s2\n", False),
        (b"Dear sir, time_s is a column\n", False),
        (b"", False),
        (b"\xff\xd8\xff\xe0\x00\x10JFIF", False),
        (b"# time_s,gyro_x\n1,2\n", False),
    ],
)
def test_recognises_by_content(head, known):
    assert csv.recognises(head, Path("any.name")) is known


CELLS = st.one_of(
    st.floats().map(repr),
    st.sampled_from(["", "nan", "-", "1e400", "1e-999", '"', "#", "0x1p3", "٣", "1_0", " 7 "]),
    st.decimals(allow_nan=True).map(str),
    st.integers(-(10**40), 10**40).map(str),
)


@settings(max_examples=300)
@given(rows=st.lists(st.lists(CELLS, min_size=3, max_size=5), max_size=8))
def test_any_cells_give_a_recording_or_one_line(tmp_path_factory, rows):
    body = "\n".join(",".join(row) for row in rows)
    _reads_or_refuses(tmp_path_factory, f"{GYRO}\n{body}".encode())


@settings(max_examples=300)
@given(
    head=st.sampled_from([b"", b"time_s", GYRO.encode(), f'"{GYRO}"'.encode(), b"time_s;gyro_x\n"]),
    junk=st.binary(max_size=200),
)
def test_any_bytes_give_a_recording_or_one_line(tmp_path_factory, head, junk):
    _reads_or_refuses(tmp_path_factory, head + junk)
    _reads_or_refuses(tmp_path_factory, GYRO.encode() + b"\n0,1,2,3\n" + junk)


def _reads_or_refuses(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("fuzz") / "a.csv"
    path.write_bytes(data)
    csv.recognises(data[:64], path)
    message = f"{path}: "
    try:
        recording = csv.read(path, ReadOptions())
    except ReadError as error:
        message = str(error)
    else:
        assert np.all(np.isfinite(recording.signals["gyro"].y))
    assert message.startswith(f"{path}: ")
    assert "\n" not in message


def test_a_row_longer_than_a_block_is_one_line(load):
    with pytest.raises(ReadError) as caught:
        load(f"{GYRO}\n0,1,2,3\n" + "1" * 5_000_000)
    assert str(caught.value).endswith(
        "log.csv: line 3 is longer than 1 MB, as no row is. Check how the file was made."
    )


@pytest.mark.parametrize(
    ("preamble", "count"),
    [
        ("sep=;\n", 1),
        ('\ufeff"SEP=;"\r\n', 1),
        ("Logger v3\nSerial,12\n\n", 2),
        ("sep=;\nLogger v3; time_s\n# a comment\n", 2),
        ("time_s is in seconds, gyro_x in rad/s\n", 1),
    ],
)
def test_lines_before_the_header_are_counted(load, preamble, count):
    header = "time_s;gyro_x;gyro_y;gyro_z"
    recording = load(f"{preamble}{header}\n0,5;1;2;3\n1,5;1;2;4\n")
    assert recording.signals["gyro"].t.tolist() == [500_000_000, 1_500_000_000]
    assert recording.signals["gyro"].y.tolist() == [[1, 2, 3], [1, 2, 4]]
    assert notes(recording)["lines before the header, skipped"] == count


@pytest.mark.parametrize(
    "text",
    [
        "one\ntwo, time_s\n0,1\n",
        "one\ntime_s,gyro_x,gyro_y,gyro_z\nand so on\n",
        "one\n" * 101 + "time_s,gyro_x,gyro_y,gyro_z\n0,1,2,3\n",
    ],
)
def test_a_line_of_text_is_no_header(tmp_path, text):
    assert not csv.recognises(text.encode(), tmp_path / "a.txt")


def test_time_far_out_is_no_overflow(load):
    recording = load(f"{GYRO}\n-4e9,1,2,3\n4e9,1,2,3\n5e9,1,2,3\n1e30,1,2,3\n-1e300,1,2,3\n")
    assert recording.signals["gyro"].t.tolist() == [-4 * 10**18, 4 * 10**18]
    assert notes(recording) == {"rows without a time that can be used, skipped": 3}


def test_pyarrow_is_imported_when_used():
    source = Path(csv.__file__).read_text()
    assert "\nimport pyarrow" not in source
    assert "\nfrom pyarrow" not in source
    assert "attest.readers.csv" in sys.modules


@pytest.mark.slow
def test_time_and_memory_follow_the_size(load):
    wide = [f"{name}_{axis}" for name in ("gyro", *map(str, range(20_000))) for axis in "xyz"]
    recording = load(",".join(["time_s", *wide]) + "\n" + ",".join(["0"] * (1 + len(wide))))
    assert len(recording.signals) == 20_001
    assert len(load(f"{GYRO}\n" + "1,2\n" * 200_000 + "0,1,2,3").signals["gyro"].t) == 1


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_may_begin_after_rows_of_whole_numbers(load, separator):
    rows = [GYRO.replace(",", " "), "0 0 0 0", "1 0 0 0", "1,5 0,25 -3 ,5", "2,5 1 1 1"]
    gyro = load("\n".join(rows).replace(" ", separator)).signals["gyro"]
    assert gyro.y[2].tolist() == [0.25, -3.0, 0.5]
    assert np.diff(gyro.t).tolist() == [1_000_000_000, 500_000_000, 1_000_000_000]
