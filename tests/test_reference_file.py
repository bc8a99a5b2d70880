import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ros_logs import KINDS, Log
from ros_logs import START as ROS_START

from attest import comparison, pipeline
from attest.errors import ConfigError, ReadError
from attest.geometry import quaternion

GYRO = "time_s,gyro_x,gyro_y,gyro_z"
START = 1_777_627_812
TURN = np.array([0.1, 0.2, 0.3])


def log(folder, start=0.0, name="log.csv", reference=False):
    """A steady turn, its truth told if asked."""
    path = folder / name
    more = ",ref_qw,ref_qx,ref_qy,ref_qz" if reference else ""
    rows = [f"{start + i / 100:.9f},{','.join(map(str, TURN))}" for i in range(200)]
    if reference:
        rows = [f"{row},{','.join(map(repr, q))}" for row, q in zip(rows, truth(), strict=True)]
    path.write_text("\n".join([GYRO + more, *rows]))
    return path


def truth(world="ned"):
    q = quaternion.exp(np.arange(200)[:, np.newaxis] / 100 * TURN)
    if world == "enu":
        s = np.sqrt(0.5)
        q = quaternion.multiply(quaternion.multiply(np.array([0, s, s, 0]), q), [0, 1.0, 0, 0])
    return quaternion.continuous(q).tolist()


def tum(folder, start=0.0, world="enu"):
    path = folder / "truth.txt"
    rows = [
        f"{start + i / 100:.9f} 0 0 0 {x!r} {y!r} {z!r} {w!r}"
        for i, (w, x, y, z) in enumerate(truth(world))
    ]
    path.write_text("\n".join(["# timestamp tx ty tz qx qy qz qw", *rows]))
    return path


def read(path, reference, *sets):
    wanted = [f"evaluation.reference={reference}", *sets]
    return pipeline.read(path, pipeline.configure("integration", wanted))


def texts(recording):
    return [note.text for note in recording.notes]


def test_a_trajectory_is_named_by_its_file_and_is_truth(tmp_path):
    path = tum(tmp_path)
    recording = read(log(tmp_path), path, "input.world=ned")
    assert [*recording.references] == [str(path)]
    ours = recording.references[str(path)]
    assert (ours.name, ours.kind) == ("truth.txt", "truth")
    assert_array_equal(ours.t, np.arange(200) * 10**7)


@pytest.mark.parametrize(("world", "asked"), [("ned", "ned"), ("enu", "enu")])
def test_a_trajectory_has_the_axes_that_are_declared(tmp_path, world, asked):
    path = tum(tmp_path, world=world)
    recording = read(log(tmp_path), path, f"input.world={asked}")
    q = recording.references[str(path)].q
    assert_allclose(np.abs(np.sum(q * truth(world), axis=1)), 1.0)


def test_undeclared_axes_are_those_of_each_format(tmp_path):
    path = tum(tmp_path)
    recording = read(log(tmp_path), path)
    q = recording.references[str(path)].q
    assert recording.world == "ned"
    assert_allclose(np.abs(np.sum(q * truth(), axis=1)), 1.0)
    assert any("turned from z up" in text for text in texts(recording))


def test_clocks_with_utc_are_aligned_and_others_said_to_be_taken_as_they_stand(tmp_path):
    path = tum(tmp_path, start=START)
    recording = read(log(tmp_path, start=START), path)
    assert "truth.txt: aligned to the log by UTC" in texts(recording)
    assert recording.references[str(path)].t[0] == START * 10**9
    one = read(log(tmp_path), path)
    text = "truth.txt: its time taken as it stands for the log's, as only one file tells UTC"
    assert text in texts(one)
    neither = read(log(tmp_path), tum(tmp_path))
    text = "truth.txt: its time taken as it stands for the log's, as neither file tells UTC"
    assert text in texts(neither)


def test_a_boot_clock_is_brought_to_utc(sample_logs):
    path = sample_logs / "quadcopter_truth.csv"
    recording = read(sample_logs / "quadcopter.tlog", path)
    theirs, own = recording.references[str(path)], recording.references["SIMSTATE"]
    both = quaternion.slerp(theirs.t, theirs.q, own.t, 10**9)
    inside = np.isfinite(both).all(axis=1)
    off = quaternion.multiply(quaternion.conjugate(both[inside]), own.q[inside])
    assert inside.mean() > 0.9
    assert np.median(np.abs(quaternion.log(off))) < 0.02
    assert next(iter(recording.references)) == str(path)


def test_any_log_with_a_reference_will_do(sample_logs, tmp_path):
    path = sample_logs / "quadcopter.tlog"
    recording = read(log(tmp_path, reference=True), path)
    assert [*recording.references] == [str(path), "ref"]
    assert recording.references[str(path)].kind == "truth"


@pytest.mark.parametrize("kind", KINDS)
def test_a_ros_log_of_poses_alone_will_do(tmp_path, kind):
    """As motion capture records it, of a body without sensors."""
    poses = Log(kind)
    for i in range(20):
        pose = {"orientation": {"w": np.cos(0.1 * i), "x": np.sin(0.1 * i)}}
        poses.add("/vicon/body/pose", "geometry_msgs/msg/PoseStamped", i * 10**8, pose=pose)
    path = poses.write(tmp_path)
    ours = log(tmp_path, start=float(ROS_START // 10**9))
    reference = read(ours, path).references[str(path)]
    assert (reference.kind, len(reference.t)) == ("truth", 20)
    with pytest.raises(ReadError, match="The log holds: geometry_msgs"):
        pipeline.read(path, pipeline.configure("fts"))


@pytest.mark.parametrize("turn", [{}, {"w": float("nan")}])
def test_a_ros_log_without_a_usable_pose_is_refused_in_a_line(tmp_path, turn):
    pose = {"orientation": turn}
    poses = Log().add("/pose", "geometry_msgs/msg/PoseStamped", 0, pose=pose)
    path = poses.write(tmp_path)
    with pytest.raises(ReadError, match=f"^{re.escape(str(path))}: no "):
        read(log(tmp_path), path)


def test_a_csv_of_references_alone_will_do(tmp_path):
    path = tmp_path / "ref.csv"
    path.write_text("time_s,ref_qw,ref_qx,ref_qy,ref_qz\n0,1,0,0,0\n1,1,0,0,0\n")
    assert read(log(tmp_path), path).references[str(path)].q.tolist() == [[1, 0, 0, 0]] * 2


def test_a_name_of_the_log_wins_over_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ref").write_text("junk")
    recording = read(log(tmp_path, reference=True), "ref")
    assert [*recording.references] == ["ref"]


HEADER = "time_s,ref_qw,ref_qx,ref_qy,ref_qz\n"
NONE = "no reference attitude in this file. Name another, or none."
UNKNOWN = (
    "not a log that attest knows (ros, ulog, dataflash, tlog, sensor_logger, csv). "
    "Check that it is the file you meant."
)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (f"{GYRO}\n0,1,2,3\n1,1,2,3\n", NONE),
        ("time_s,ref_qw\n0,1\n", NONE),
        (f"{HEADER}0,,,,\n", NONE),
        (HEADER, "a header and no rows. Check how the file was made."),
        ("", "the file is empty. Record or copy the log again."),
        ("the flight went well\n", UNKNOWN),
        ("# timestamp tx ty tz qx qy qz qw\n", UNKNOWN),
        ("\x89PNG\x00\x01\x02", UNKNOWN),
    ],
)
def test_a_file_without_reference_is_one_line(tmp_path, content, message):
    path = tmp_path / "reference.csv"
    path.write_text(content)
    with pytest.raises(ReadError) as caught:
        read(log(tmp_path), path)
    assert str(caught.value) == f"{path}: {message}"


def test_a_folder_is_no_reference(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    tum(folder)
    with pytest.raises(ReadError) as caught:
        read(log(tmp_path), folder)
    assert str(caught.value) == f"{folder}: a folder, and no log. Name the reference's file in it."


def test_a_reference_that_cannot_be_read_is_one_line(tmp_path, monkeypatch):
    path, whole, opened = tum(tmp_path), log(tmp_path), Path.open

    def refuse(self, *arguments, **options):
        if self == path:
            raise PermissionError(13, "Permission denied", str(path))
        return opened(self, *arguments, **options)

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(ReadError) as caught:
        read(whole, path)
    assert str(caught.value) == (
        f"{path}: cannot be read: Permission denied. Check the file and its permissions."
    )


@pytest.mark.parametrize("reference", [True, False])
@pytest.mark.parametrize("name", ["nope.csv", "/nowhere/nope.csv", "SIM", "n" * 5000])
def test_no_such_file_names_the_references(tmp_path, name, reference):
    path = log(tmp_path, reference=reference)
    with pytest.raises(ConfigError) as caught:
        read(path, name)
    held = "ref" if reference else "none"
    message = f"{path}: no reference {name!r}, and no such file. The log has: {held}."
    assert str(caught.value) == message


def test_run_and_compare_score_against_a_file(tmp_path):
    path, wanted = log(tmp_path, reference=True), ["input.world=ned"]
    file = f"evaluation.reference={tum(tmp_path, world='ned')}"
    by_file = pipeline.configure("integration", [*wanted, file])
    result = pipeline.run(path, by_file)
    assert result.summary["reference"]["name"] == "truth.txt"
    assert result.metrics.total.max < 1e-3
    both = {"gyro": by_file, "triad": pipeline.configure("triad", [*wanted, file])}
    results, failed = comparison.compare(path, both)
    assert not failed
    assert {r.reference.name for r in results} == {"truth.txt"}
