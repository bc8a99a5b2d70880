import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from attest import config, pipeline, readers
from attest.config import Csv
from attest.errors import ConfigError, ReadError
from attest.observers import fts
from attest.readers.options import ReadOptions

GYRO = {"columns": ["gx", "gy", "gz"]}
TIME = {"column": "t"}
BY_NUMBER = {"header": False, "time": {"column": 1}, "gyro": {"columns": [2, 3, 4]}}


@pytest.fixture
def load(tmp_path):
    def load_text(text, **keys):
        path = tmp_path / "log.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        csv = Csv.model_validate({"time": TIME, "gyro": GYRO} | keys)
        return readers.read(path, ReadOptions(world="ned", csv=csv))

    return load_text


def notes(recording):
    return {note.text: note.count for note in recording.notes}


@pytest.mark.parametrize(
    ("unit", "cell", "t"),
    [
        ("s", "1.5", 1_500_000_000),
        ("ms", "1500.000001", 1_500_000_001),
        ("us", "1500000", 1_500_000_000),
        ("ns", "1500000000", 1_500_000_000),
        ("s", "1777627812.387000001", 1_777_627_812_387_000_001),
        ("ms", "1777627812387.000001", 1_777_627_812_387_000_001),
        ("us", "1777627812387000.001", 1_777_627_812_387_000_001),
        ("ns", "1777627812387000001", 1_777_627_812_387_000_001),
        ("ns", "1.777627812387000001e18", 1_777_627_812_387_000_001),
    ],
)
def test_time_of_any_unit_is_exact(load, unit, cell, t):
    recording = load(f"t,gx,gy,gz\n{cell},1,2,3\n", time={"column": "t", "unit": unit})
    assert recording.signals["gyro"].t.tolist() == [t]
    assert recording.clock.utc_offset == (0 if t > 10**18 else None)
    assert recording.clock.name == "CSV t"


@pytest.mark.parametrize(
    ("key", "unit", "factor"),
    [
        ("gyro", "deg/s", np.pi / 180),
        ("accel", "g", 9.80665),
        ("accel", "mg", 9.80665e-3),
        ("accel", "m/s^2", 1.0),
        ("mag", "T", 1.0),
        ("mag", "mT", 1e-3),
        ("mag", "uT", 1e-6),
        ("mag", "nT", 1e-9),
        ("mag", "gauss", 1e-4),
        ("mag", "mgauss", 1e-7),
    ],
)
def test_units_become_si(load, key, unit, factor):
    section = {"columns": ["x", "y", "z"], "unit": unit}
    recording = load("t,gx,gy,gz,x,y,z\n0,1,2,3,4,5,6\n", **{key: section})
    assert_allclose(recording.signals[key].y, [[4 * factor, 5 * factor, 6 * factor]], rtol=1e-15)


def test_every_signal_can_be_mapped(load):
    three = {"columns": ["gx", "gy", "gz"]}
    recording = load(
        "t,gx,gy,gz,w\n0,1,2,3,4\n",
        accel=three, mag=three, velocity=three, position=three, torque=three,
        vectors={"sun": three, "point1": three},
        reference={"columns": ["w", "gx", "gy", "gz"], "kind": "autopilot"},
    )  # fmt: skip
    names = ["gyro", "accel", "mag", "velocity", "position", "torque", "sun", "point1"]
    assert [*recording.signals] == names
    reference = recording.references["ref"]
    assert_allclose(reference.q, np.array([[4, 1, 2, 3]]) / np.sqrt(30))
    assert reference.kind == "autopilot"
    assert "reference taken as autopilot, as input.csv says" in notes(recording)


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("\ufefft,gx,gy,gz\r\n0,1,2,3\r\n1,4,5,6\r\n", {}),
        ("t\tgx\tgy\tgz\n0\t1\t2\t3\n1\t4\t5\t6\n", {}),
        ("t;gx;gy;gz;\n0,0;1,0;2,0;3,0;\n1,0;4,0;5,0;6,0;\n", {}),
        ("t;gx;gy;gz\n0;1;2;3\n1,0;4;5;6\n", {"decimal": ","}),
        ("  t  gx gy   gz\n 0 1  2 3\n1  4 5 6 \n", {}),
        ("0 1 2 3\n1\t4  5 6\n", {"header": False, "separator": " "}),
        ("0,1,2,3\n1,4,5,6", {"header": False}),
        ("by A\n0,1,2,3\n1,4,5,6\n", {"header": False, "skip": 1}),
        ("made by\n\nt,gx\nt,gx,gy,gz\n0,1,2,3\n1,4,5,6\n", {"skip": 3}),
        ("# t,gx,gy,gz\n0,1,2,3\n1,4,5,6\n", {}),
        ("% by hand\nt,gx,gy,gz\n% one\n0,1,2,3\n1,4,5,6\n", {"comment": "%"}),
        ("t,gx,gy,gz,gz2,gz2\n0,1,2,3,7,7\n1,4,5,6,8,8\n", {}),
    ],
)
def test_reads_the_dialects(load, text, keys):
    by_number = {"time": {"column": 1}, "gyro": {"columns": [2, 3, 4]}}
    recording = load(text, **(by_number if keys.get("header") is False else {}), **keys)
    assert recording.signals["gyro"].t.tolist() == [0, 10**9]
    assert recording.signals["gyro"].y.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert all(text.startswith("columns not used") for text in notes(recording))


def test_junk_is_counted_and_cells_may_be_empty(load):
    recording = load(
        b"t,gx,gy,gz,ax,ay,az,\xb5\n0,1,2,3,,,,\n1,1,x\xff,3,4,5,6,\n2,1\n3,,,,4,5,6,\n,1,2,3,,,,\n",
        accel={"columns": ["ax", "ay", "az"]},
    )
    assert recording.signals["gyro"].t.tolist() == [0]
    assert recording.signals["accel"].t.tolist() == [10**9, 3 * 10**9]
    assert notes(recording) == {
        "rows with another number of cells than the header, skipped": 1,
        "rows without a time that can be used, skipped": 1,
        "cells that are no number, taken as empty": 1,
        "columns not used: �": 1,
        "gyro rows with a cell missing, dropped": 1,
    }


@pytest.mark.parametrize(
    ("text", "keys", "kind", "message"),
    [
        ("t,gX,gy,gz\n0,1,2,3\n", {}, ConfigError,
         "no column 'gx' for input.csv.gyro. Did you mean 'gX'? The file has: t, gX, gy, gz."),
        ("t,gx,gy,gz\n0,1,2,3\n", {"time": {"column": "Zeit"}}, ConfigError,
         "no column 'Zeit' for input.csv.time. Did you mean 't'? The file has: t, gx, gy, gz."),
        ("t,gx,gy,gz\n0,1,2,3\n", {"accel": {"columns": [5, 6, 7]}}, ConfigError,
         "no column 5 for input.csv.accel. The file has 4."),
        ("t,gx,gx,gy,gz\n0,1,2,3,4\n", {}, ConfigError,
         "two columns are named 'gx'. Give input.csv.gyro its number."),
        ("by A\n\nt,gx,gy,gz\n0,1,2,3\n", {}, ConfigError,
         "no column 't' for input.csv.time. The file has: by, A. "
         "The columns begin behind other lines: --set input.csv.skip=2"),
        ("by A\n0,1,2,3\n1,1,2,3\n", BY_NUMBER, ConfigError,
         "no column 3 for input.csv.gyro. The file has 2. "
         "The columns begin behind other lines: --set input.csv.skip=1"),
        ("t,gx,gy,gz\n", {}, ReadError, "no rows. Check the file, and input.csv.skip."),
        ("t,gx,gy,gz\n0,1,2,3\n", {"skip": 9}, ReadError,
         "no rows. Check the file, and input.csv.skip."),
        ("t,gx,gy,gz\n0,a,b,c\n", {}, ReadError,
         "no row has a time and gx, gy, gz. Fill the cells."),
        ("t,gx,gy,gz\n0,1,2,3\n", {"gyro": None}, ReadError,
         "no gyroscope, which an observer needs. Name it in input.csv.gyro."),
        ("t,gx\n".encode("utf-16"), {}, ReadError, "a CSV in UTF-16. Save it as UTF-8."),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_line(load, tmp_path, text, keys, kind, message):
    with pytest.raises(kind) as caught:
        load(text, **keys)
    assert str(caught.value) == f"{tmp_path / 'log.csv'}: {message}"


@pytest.mark.parametrize(
    ("csv", "message"),
    [
        ({"time": TIME, "gyro": GYRO | {"unit": "dps"}},
         "a.yaml: 'input.csv.gyro.unit' is \"dps\". It must be: 'rad/s' or 'deg/s'."),
        ({"time": {"column": "t", "unit": "min"}},
         "a.yaml: 'input.csv.time.unit' is \"min\". It must be: 's', 'ms', 'us' or 'ns'."),
        ({"time": TIME, "gyr": GYRO}, "a.yaml: unknown key 'input.csv.gyr'. Did you mean 'gyro'? "),
        ({"gyro": GYRO},
         """a.yaml: 'input.csv' is {"gyro": {"columns": ["gx", "gy", "gz"]}}: """
         "gyro is told, so time.column is needed too."),
        ({"skip": 2},
         """a.yaml: 'input.csv' is {"skip": 2}: skip is told, so time.column is needed too."""),
        ({"time": TIME, "gyro": {"unit": "deg/s"}},
         """a.yaml: 'input.csv' is {"time": {"column": "t"}, "gyro": {"unit": "deg/s"}}: """
         "time.column is named, so gyro.columns are needed too."),
        ({"gyro": {}},
         "a.yaml: 'input.csv.gyro' is {}: columns are needed, or the unit of those that the "
         "header names."),
    ],
)  # fmt: skip
def test_a_wrong_mapping_is_one_line(csv, message):
    with pytest.raises(ConfigError) as caught:
        config.validate(fts.Config, {"observer": "fts", "input": {"csv": csv}}, "a.yaml")
    assert str(caught.value).startswith(message)


def test_a_mapping_in_yaml_reaches_the_reader(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("a b c d\n0 1 2 3\n1 4 5 6\n")
    yaml = tmp_path / "mine.yaml"
    yaml.write_text("observer: fts\ninput: {world: enu, csv: {time: {column: a, unit: ms}, "
                    "gyro: {columns: [b, c, 4], unit: deg/s}}}\n")  # fmt: skip
    recording = pipeline.read(log, pipeline.configure(str(yaml)))
    assert recording.signals["gyro"].t.tolist() == [0, 10**6]
    assert_allclose(np.rad2deg(recording.signals["gyro"].y), [[1, 2, 3], [4, 5, 6]])


CANONICAL = "time_s,gyro_x,gyro_y,gyro_z,mag_x,mag_y,mag_z\n0,1,2,3,4,5,6\n10,1,2,3,4,5,6\n"


def test_units_alone_are_for_the_columns_that_the_header_names(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text(CANONICAL)
    sets = ["input.csv.gyro.unit=deg/s", "input.csv.time.unit=ms", "input.csv.mag.unit=gauss"]
    told = pipeline.configure("fts", sets)
    recording = pipeline.read(log, told)
    assert recording.signals["gyro"].t.tolist() == [0, 10**7]
    assert_allclose(np.rad2deg(recording.signals["gyro"].y[0]), [1, 2, 3])
    assert_allclose(recording.signals["mag"].y[0], [4e-4, 5e-4, 6e-4])
    assert recording.details["units"] == {"time": "ms", "gyro": "deg/s", "mag": "gauss"}
    assert "units as input.csv says: time ms, gyro deg/s, mag gauss" in notes(recording)
    # and so does the configuration that is saved with a result
    again = config.validate(fts.Config, config.effective(told), "again")
    assert again == told


def test_a_unit_of_no_column_is_one_line(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("time_s,gyro_x,gyro_y,gyro_z\n0,1,2,3\n")
    with pytest.raises(ConfigError) as caught:
        pipeline.read(log, pipeline.configure("fts", ["input.csv.accel.unit=g"]))
    assert str(caught.value) == (
        f"{log}: no columns of accel for input.csv.accel.unit. "
        "The file has: time_s, gyro_x, gyro_y, gyro_z."
    )


def told(**keys):
    return Csv.model_validate({"time": TIME, "gyro": GYRO} | keys)


@pytest.mark.parametrize(
    ("text", "keys", "fits"),
    [
        ("t,gx,gy,gz\n0,1,2,3\n", {}, True),
        ("t,gx,gy,gz\ns,dps,dps,dps\n0,1,2,3\n", {}, True),
        ("t,gx,gy\n0,1,2\n", {}, False),
        ("t,gx,gy,gz\n", {}, False),
        ("notes of the day\nnothing\n", {}, False),
        ("", {}, False),
        ("\x89PNG\x00\x00", {}, False),
        ("0 1 2 3\n", BY_NUMBER, True),
        ("0;1;2;3\n", BY_NUMBER, True),
        ("a b c d\n", BY_NUMBER, False),
        ("0 1 2\n", BY_NUMBER, False),
    ],
)  # fmt: skip
def test_a_file_with_the_columns_that_are_told_is_a_log(tmp_path, text, keys, fits):
    path = tmp_path / "log.txt"
    path.write_text(text)
    assert readers.is_log(path, told(**keys)) is fits
    assert not readers.is_log(path)


def test_a_folder_of_mapped_files_holds_logs(tmp_path, sample_logs):
    for name in ("a.csv", "sub/b.txt", ".c.csv"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("t,gx,gy,gz\n0,1,2,3\n")
    (tmp_path / "mine.yaml").write_text("observer: fts\n")
    (tmp_path / "other.csv").write_text("t,hx,hy,hz\n0,1,2,3\n")
    (tmp_path / "d.tlog").write_bytes((sample_logs / "quadcopter.tlog").read_bytes())
    logs = [tmp_path / name for name in ("a.csv", "d.tlog", "sub/b.txt")]
    assert readers.logs_in(tmp_path, told()) == logs
    assert readers.logs_in(tmp_path) == [tmp_path / "d.tlog"]


def test_other_formats_are_told_by_content_with_a_mapping(sample_logs):
    csv = Csv.model_validate({"time": TIME, "gyro": GYRO})
    assert readers.read(sample_logs / "quadcopter.tlog", ReadOptions(csv=csv)).format == "tlog"


def test_values_equal_those_of_loadtxt(load, tmp_path):
    rng = np.random.default_rng(1)
    y = rng.standard_normal((500, 3)) * 10.0 ** rng.integers(-12, 12, (500, 3))
    np.savetxt(tmp_path / "theirs.csv", np.column_stack([np.arange(500), y]), delimiter=",")
    keys = {"header": False, "time": {"column": 1}, "gyro": {"columns": [2, 3, 4]}}
    gyro = load((tmp_path / "theirs.csv").read_text(), **keys).signals["gyro"]
    theirs = np.loadtxt(tmp_path / "theirs.csv", delimiter=",")
    assert_array_equal(gyro.t, theirs[:, 0] * 1e9)
    assert_array_equal(gyro.y, theirs[:, 1:])


@given(junk=st.binary(max_size=200), separator=st.sampled_from([None, ",", ";", "\t", " "]))
def test_any_bytes_give_a_recording_or_one_line(tmp_path_factory, junk, separator):
    path = tmp_path_factory.mktemp("fuzz") / "a.csv"
    for data in (junk, b"t,gx,gy,gz\n0,1,2,3\n" + junk, b"t gx gy gz\n0 1 2 3\n" + junk):
        path.write_bytes(data)
        csv = Csv.model_validate({"time": TIME, "gyro": GYRO, "separator": separator})
        try:
            recording = readers.read(path, ReadOptions(csv=csv))
        except (ReadError, ConfigError) as error:
            assert str(error).startswith(f"{path}: ")  # noqa: PT017
            assert "\n" not in str(error)  # noqa: PT017
        else:
            assert np.isfinite(recording.signals["gyro"].y).all()


def test_columns_of_the_reference_may_be_told_alone(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("time_s,gyro_x,gyro_y,gyro_z,ref_qw,ref_qx,ref_qy,ref_qz\n0,1,2,3,0,0,0.6,0.8\n")
    assert pipeline.read(log, pipeline.configure("fts")).references["ref"].q.tolist() == [
        [0, 0, 0.6, 0.8]
    ]
    told = pipeline.configure("fts", ["input.csv.reference.columns=[ref_qz,ref_qw,ref_qx,ref_qy]"])
    recording = pipeline.read(log, told)
    assert recording.references["ref"].q.tolist() == [[0.8, 0, 0, 0.6]]
    assert "reference taken as truth, as input.csv says" in notes(recording)
    assert config.validate(fts.Config, config.effective(told), "again") == told
