import numpy as np
import pytest
from numpy.testing import assert_allclose

from attest import readers
from attest.config import Csv
from attest.errors import ConfigError, ReadError
from attest.geometry import quaternion
from attest.readers import csv_layouts
from attest.readers.options import ReadOptions

EUROC = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
    "1403636579758555392,-0.1,0.15,0.03,8.2,-0.1,-3.2\n"
    "1403636579763555584,-0.1,0.14,0.03,8.3,-0.2,-3.2\n"
)
EUROC_TRUTH = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
    "q_RS_z [], v_RS_R_x [m s^-1]\n1403636579758555392,4.6,-1.7,0.6,0.6,0.8,0,0,0.1\n"
)
REPOIMU = (
    "Time (s);Vicon Orientation;;;;IMU Acceleration;;;IMU Gyroscope;;;IMU Magnetometer;;;\n"
    ";W;X;Y;Z;X;Y;Z;X;Y;Z;X;Y;Z;\n0.01;0;0;0;0;0.1;0.2;9.8;1;2;3;0.1;0.4;-0.9;\n"
    "0.02;1;0;0;0;0.1;0.2;9.8;1;2;3;0.1;0.4;-0.9;\n"
)
HEAD = "time,seconds_elapsed,z,y,x\n"
NS = 1_718_030_736_872_695_300


XIO = "Time (s),{}\n0,1,2,3,4,5,6,7,8,9\n".format(
    ",".join(
        f"{name} {axis} ({unit})"
        for name, unit in (("Gyroscope", "deg/s"), ("Accelerometer", "g"), ("Magnetometer", "uT"))
        for axis in "XYZ"
    )
)


def in_units(**units):
    """Return the option of units alone, by key."""
    return ReadOptions(csv=Csv.model_validate({key: {"unit": u} for key, u in units.items()}))


def notes(recording):
    return [note.text for note in recording.notes]


@pytest.fixture
def euroc(tmp_path):
    for folder, text in (("imu0", EUROC), ("state_groundtruth_estimate0", EUROC_TRUTH)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "data.csv").write_text(text)
    return tmp_path


def test_euroc_with_the_truth_beside_it(euroc):
    assert readers.logs_in(euroc) == [euroc / "imu0" / "data.csv"]
    recording = readers.read(euroc / "imu0" / "data.csv")
    assert recording.signals["gyro"].t.tolist() == [1403636579758555392, 1403636579763555584]
    assert recording.signals["accel"].y.tolist() == [[8.2, -0.1, -3.2], [8.3, -0.2, -3.2]]
    truth = recording.references["ground_truth"]
    assert (truth.kind, truth.t.tolist()) == ("truth", [1403636579758555392])
    assert_allclose(truth.q, [[0.6, 0.8, 0, 0]])
    assert (recording.world, recording.body, recording.clock.utc_offset) == ("enu", "flu", 0)
    assert recording.clock.name == "CSV timestamp [ns]"
    assert recording.details["layout"] == "EuRoC"
    assert "ground truth of state_groundtruth_estimate0/data.csv beside the log" in notes(recording)


def test_euroc_without_truth(euroc):
    (euroc / "state_groundtruth_estimate0" / "data.csv").unlink()
    assert readers.read(euroc / "imu0" / "data.csv").references == {}


def test_repoimu(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(REPOIMU)
    recording = readers.read(path)
    signals = {name: signal.y[1].tolist() for name, signal in recording.signals.items()}
    assert signals == {
        "gyro": [1, 2, 3],
        "accel": [0.1, 0.2, 9.8],
        "mag": pytest.approx([1e-5, 4e-5, -9e-5]),
    }
    vicon = recording.references["vicon"]
    assert (vicon.kind, vicon.t.tolist(), vicon.q.tolist()) == (
        "truth", [20_000_000], [[1, 0, 0, 0]]
    )  # fmt: skip
    assert "vicon_q rows of no usable length, dropped" in notes(recording)


@pytest.mark.shared
def test_xio(shared):
    path = shared / "csv" / "xio_fusion.csv"
    recording = readers.read(path)
    theirs = np.loadtxt(path, delimiter=",", skiprows=1)
    assert_allclose(recording.signals["gyro"].y, np.deg2rad(theirs[:, 1:4]), rtol=1e-14)
    assert_allclose(recording.signals["accel"].y, theirs[:, 4:7] * 9.80665, rtol=1e-14)
    assert_allclose(recording.signals["mag"].y, theirs[:, 7:10] * 1e-6, rtol=1e-14)
    assert_allclose(recording.signals["mag"].t, theirs[:, 0] * 1e9, atol=1)
    assert recording.world == "enu"
    assert not any(note.doubt for note in recording.notes)


@pytest.mark.parametrize(
    ("text", "units", "gyro", "mag"),
    [
        (XIO, {"gyro": "rad/s"}, [1, 2, 3], [7e-6, 8e-6, 9e-6]),
        (XIO, {"mag": "gauss"}, np.deg2rad([1, 2, 3]), [7e-4, 8e-4, 9e-4]),
        (REPOIMU, {"gyro": "deg/s"}, np.deg2rad([1, 2, 3]), [1e-5, 4e-5, -9e-5]),
        (REPOIMU, {"mag": "mgauss"}, [1, 2, 3], [1e-8, 4e-8, -9e-8]),
        (EUROC, {"gyro": "deg/s"}, np.deg2rad([-0.1, 0.15, 0.03]), None),
    ],
)
def test_units_alone_are_laid_over_a_layout(tmp_path, text, units, gyro, mag):
    path = tmp_path / "a.csv"
    path.write_text(text)
    recording = readers.read(path, in_units(**units))
    assert_allclose(recording.signals["gyro"].y[0], gyro)
    assert mag is None or np.allclose(recording.signals["mag"].y[0], mag)
    assert recording.world == "enu"
    told = ", ".join(f"{key} {unit}" for key, unit in units.items())
    assert f"units as input.csv says: {told}" in notes(recording)


@pytest.mark.parametrize("text", [EUROC_TRUTH, "0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n"])
def test_a_trajectory_is_no_log(tmp_path, text):
    path = tmp_path / "a.txt"
    path.write_text(text)
    assert csv_layouts.of_trajectory(path) is not None
    with pytest.raises(ReadError, match=r"a trajectory and no log\. Name it by --reference"):
        readers.read(path)


def phone(folder, **more):
    files = {
        "Gyroscope": f"{HEAD}{NS},0.07,3,2,1\n{NS + 10**7},0.08,3,2,1\n",
        "Accelerometer": f"{HEAD}{NS},0.07,.3,.2,.1\n",
        "Gravity": f"{HEAD}{NS - 10**7},0.06,9,0,0\n{NS + 10**7},0.08,11,0,0\n",
        "Magnetometer": f"{HEAD}{NS},0.07,-40,20,1\n",
        "Orientation": "time,seconds_elapsed,qz,qy,qx,qw,roll,pitch,yaw\n"
        f"{NS},0.07,0,0,0.6,0.8,0,0,0\n",
        "Location": f"time,seconds_elapsed,altitude,longitude,latitude\n{NS},0.07,500,8,47\n",
    } | more  # fmt: skip
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    return folder


def test_sensor_logger_is_one_log(tmp_path):
    folder = phone(tmp_path)
    assert readers.logs_in(folder) == [folder]
    recording = readers.read(folder)
    signals = {name: signal.y[0].tolist() for name, signal in recording.signals.items()}
    assert signals == {
        "gyro": [1, 2, 3],
        "accel": pytest.approx([0.1, 0.2, 10.3]),
        "mag": pytest.approx([1e-6, 20e-6, -40e-6]),
        "position": [47, 8, 500],
    }
    own = recording.references["orientation"]
    assert (own.kind, own.q.tolist()) == ("autopilot", [[0.8, 0.6, 0, 0]])
    assert recording.signals["gyro"].t.tolist() == [NS, NS + 10**7]
    assert (recording.format, recording.clock.utc_offset) == ("sensor_logger", 0)


def test_sensor_logger_takes_the_total_acceleration(tmp_path):
    recording = readers.read(phone(tmp_path, TotalAcceleration=f"{HEAD}{NS},0.07,9.8,0,0\n"))
    assert recording.signals["accel"].y.tolist() == [[0, 0, 9.8]]
    assert recording.signals["accel"].source == "TotalAcceleration.csv"


@pytest.mark.parametrize(("standard", "sign"), [("false", -1), ("true", 1)])
def test_sensor_logger_of_an_iphone(tmp_path, standard, sign):
    told = f"version,platform,standardisation\n3,ios,{standard}\n"
    recording = readers.read(phone(tmp_path, Metadata=told))
    assert_allclose(recording.signals["accel"].y, [[sign * 0.1, sign * 0.2, sign * 10.3]])
    north = quaternion.rotate(recording.references["orientation"].q, np.array([[1.0, 0, 0]]))
    assert_allclose(north, [[0, 1, 0]] if sign < 0 else [[1, 0, 0]], atol=1e-12)


def test_a_broken_file_of_the_folder_is_left_out(tmp_path):
    recording = readers.read(phone(tmp_path, Magnetometer="junk", Gravity="\0\0"))
    assert [*recording.signals] == ["gyro", "position"]
    doubts = [note.text for note in recording.notes if note.doubt]
    assert doubts[0].startswith("Gravity.csv left out: ")
    assert any("without gravity" in text for text in doubts)


def test_no_gyroscope_row_is_one_line(tmp_path):
    with pytest.raises(ReadError, match=r"Gyroscope\.csv: no row that can be used"):
        readers.read(phone(tmp_path, Gyroscope=f"{HEAD}x,x,x,x,x\n"))


def test_one_file_of_a_phone_names_its_folder(tmp_path):
    folder = phone(tmp_path)
    with pytest.raises(ReadError) as caught:
        readers.read(folder / "Gyroscope.csv")
    assert str(caught.value) == (
        f"{folder / 'Gyroscope.csv'}: one file of a recording of Sensor Logger, whose folder is "
        f"one log. Name the folder: {folder}"
    )
    assert "gyro" in readers.read(folder).signals


def test_units_alone_are_laid_over_those_of_a_phone(tmp_path):
    recording = readers.read(phone(tmp_path), in_units(gyro="deg/s", mag="gauss"))
    assert_allclose(recording.signals["gyro"].y[0], np.deg2rad([1, 2, 3]))
    assert_allclose(recording.signals["mag"].y[0], [1e-4, 20e-4, -40e-4])
    assert "units as input.csv says: gyro deg/s, mag gauss" in notes(recording)
    units = {"time": "ns", "gyro": "deg/s", "accel": "m/s2", "mag": "gauss"}
    assert recording.details["units"] == units
    (tmp_path / "Magnetometer.csv").unlink()
    with pytest.raises(ConfigError) as caught:
        readers.read(tmp_path, in_units(mag="gauss"))
    assert str(caught.value) == f"{tmp_path}: no mag for input.csv.mag.unit. Leave it out."
