import errno
import io
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rerun.chunk import RrdReader
from results import SECOND, UTC, result

from attest.geometry import quaternion
from attest.writers.mcap import write_mcap
from attest.writers.rerun import recording_id, write_rerun
from attest.writers.rerun_recording import record

BODY = "/world/estimate/fts"
REFERENCE = "/world/reference/SIMSTATE"


def written(folder, made):
    path = folder / "fts.rrd"
    write_rerun(path, [made])
    return path


def column(path, entity, name):
    """Values of a component at their times, its chunks joined; static ones at no time."""
    times, values = [], []
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and name in batch.schema.names:
            values += batch.column(name).to_pylist()
            times += [] if chunk.is_static else batch.column("time").cast("int64").to_pylist()
    return np.array(times, np.int64), values


def entities(path):
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def rotations(path, entity):
    t, values = column(path, entity, "Transform3D:quaternion")
    return t, np.array(values)[:, 0]


@pytest.fixture(scope="module")
def made():
    return result(300)


@pytest.fixture(scope="module")
def path(made, tmp_path_factory):
    return written(tmp_path_factory.mktemp("rrd"), made)


def rerun_command(*arguments):
    command = shutil.which("rerun", path=str(Path(sys.executable).parent)) or "rerun"
    words = [command, *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, check=False)


def test_rerun_verifies_the_recording(path):
    done = rerun_command("rrd", "verify", path)
    assert done.returncode == 0, done.stderr


def test_rerun_converts_the_mcap(made, tmp_path):
    write_mcap(tmp_path / "fts.mcap", [made])
    done = rerun_command("mcap", "convert", tmp_path / "fts.mcap", "-o", tmp_path / "fts.rrd")
    assert done.returncode == 0, done.stderr
    assert "/attest/fts/pose" in entities(tmp_path / "fts.rrd")


def test_rotations_are_the_estimates_in_single_precision(made, path):
    t, q_xyzw = rotations(path, BODY)
    assert_array_equal(t, made.estimates.t + UTC)
    assert_array_equal(q_xyzw, quaternion.to_xyzw(made.estimates.q).astype(np.float32))


def test_reference_is_shown_only_while_there_is_one(made, path):
    held = np.isfinite(made.metrics.q_ref[:, 0])
    t, q_xyzw = rotations(path, REFERENCE)
    assert_array_equal(t, made.estimates.t[held] + UTC)
    assert_array_equal(q_xyzw, quaternion.to_xyzw(made.metrics.q_ref[held]).astype(np.float32))
    t, arrows = column(path, f"{REFERENCE}/axes", "Arrows3D:vectors")
    assert [len(a) for a in arrows] == [3, 0]
    assert_array_equal(t, made.estimates.t[[0, np.flatnonzero(~held)[0]]] + UTC)
    _, boxes = column(path, f"{REFERENCE}/airframe", "Boxes3D:half_sizes")
    assert [len(b) for b in boxes] == [5, 0]


def test_vectors_are_shown_while_they_are_measured(path):
    _, accel = column(path, f"{BODY}/measured/accel", "Arrows3D:vectors")
    assert {len(a) for a in accel} == {1}
    _, predicted = column(path, "/world/predicted/accel", "Arrows3D:vectors")
    assert_allclose(predicted[-1], [[0, 0, -1.1]], rtol=1e-6)


def test_curves_break_at_the_gap(made, path):
    t, error = column(path, "/error", "Scalars:scalars")
    at = np.flatnonzero(np.diff(made.estimates.t) > SECOND)[0] + 1
    assert np.isnan(error[at]).all()
    assert t[at] == made.estimates.t[at] + UTC - 1
    assert_array_equal(np.delete(error, at, axis=0), made.metrics.error_deg)


def test_states_tell_convergence_gap_and_end_of_reference(path):
    _, states = column(path, "/state/run", "StateChange:state")
    assert [s[0] for s in states] == ["error", "converged", "gap", "converged", "no reference"]
    _, used = column(path, "/state/vectors/mag", "StateChange:state")
    assert used[0] == ["used"]


def test_blueprint_is_inside(path):
    assert len(RrdReader(path).blueprints()) == 1
    [recording] = RrdReader(path).recordings()
    assert recording.application_id == "attest"


def test_recording_is_named_by_log_observer_and_configuration(made, path):
    assert RrdReader(path).recordings()[0].recording_id == recording_id([made])
    other = replace(made, configuration={"gains": {"k_p": 3.0}})
    assert recording_id([other]) != recording_id([made]) == recording_id([result(20)])


def test_content_of_equal_runs_is_equal(made, path, tmp_path):
    again = written(tmp_path, made)
    assert entities(again) == entities(path)
    for entity, name in ((BODY, "Transform3D:quaternion"), ("/residual", "Scalars:scalars")):
        (t, values), (t_again, values_again) = (column(p, entity, name) for p in (path, again))
        assert_array_equal(t, t_again)
        assert_array_equal(values, values_again)


def test_without_utc_the_time_is_the_logs_clock(tmp_path):
    made = result(20, utc=None, start=-SECOND)
    t, _ = rotations(written(tmp_path, made), BODY)
    assert_array_equal(t, made.estimates.t)


def test_without_reference_mag_and_accel_their_views_are_not_there(tmp_path):
    made = result(20, reference=False, mag=False, accel=False)
    found = entities(written(tmp_path, made))
    assert not found & {"/error", "/euler/against", "/field", REFERENCE}
    assert {"/euler/estimate", "/bias", "/rate", "/residual", "/summary"} <= found


def test_enu_world_and_hostile_names(tmp_path):
    made = result(20)
    hostile = "a b/../ü\n|`/1st //"
    made = replace(
        made,
        recording=replace(made.recording, world="enu", body="flu"),
        samples=replace(made.samples, names=(hostile, "mag")),
        metrics=replace(made.metrics, reference=hostile),
    )
    path = written(tmp_path, made)
    assert "/world/reference/a_b/_/_/_1st_" in entities(path)
    _, axes = column(path, "/world", "ViewCoordinates:xyz")
    assert axes == [[[3, 5, 1]]]  # right, forward, up


def test_moving_reference_vector_is_logged_over_time(tmp_path):
    made = result(20)
    moving = np.repeat(made.samples.inertial, 20, axis=0)
    made = replace(made, samples=replace(made.samples, inertial=moving))
    t, _ = column(written(tmp_path, made), "/world/predicted/mag", "Arrows3D:vectors")
    assert_array_equal(t, made.samples.t + UTC)


def test_long_run_is_sent_in_chunks_that_join(tmp_path):
    made = result(70_000, rate=1000.0, reference=False, mag=False)
    t, q_xyzw = rotations(written(tmp_path, made), BODY)
    assert_array_equal(t, made.estimates.t + UTC)
    assert_array_equal(q_xyzw, quaternion.to_xyzw(made.estimates.q).astype(np.float32))


class FullDisk(io.BytesIO):
    """A file that holds some bytes and no more."""

    def write(self, data):
        if self.tell() + len(data) > 1000:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def test_full_disk_is_told_at_once(made, capfd):
    with pytest.raises(OSError, match="No space left on device"):
        record(FullDisk(), [made], "full")
    assert capfd.readouterr() == ("", "")


def test_error_while_logging_ends_the_recording(made, tmp_path, monkeypatch):
    monkeypatch.setattr("attest.writers.rerun_recording.log_states", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_rerun(tmp_path / "fts.rrd", [made])
    assert not list(tmp_path.iterdir())
