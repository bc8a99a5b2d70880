import json
import subprocess
import sys

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore

from attest import pipeline, report
from attest.errors import ConfigError, ReadError
from attest.result import ranked

ATTEST = [sys.executable, "-m", "attest"]
NAMES = ("fts", "cgo", "wahba")


def attest(*arguments):
    command = [*ATTEST, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def compared(sample_logs, tmp_path_factory):
    output = tmp_path_factory.mktemp("compared")
    options = [option for name in NAMES for option in ("-o", name)]
    log = sample_logs / "quadcopter.tlog"
    done = attest("compare", log, *options, "--output", output)
    assert done.returncode == 0, done.stderr
    return done.stdout, output / "quadcopter"


def test_one_file_of_each_kind_is_left(compared):
    _, folder = compared
    assert sorted(path.name for path in folder.iterdir()) == [
        "compare.json",
        "compare.mcap",
        "compare.rrd",
    ]


def test_the_table_ranks_by_error_and_says_against_what(compared):
    table, folder = compared
    document = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    assert "reference   SIMSTATE (truth)" in table
    rows = document["ranking"]
    assert [row["rank"] for row in rows] == [1, 2, 3]
    errors = [row["total_rmse_deg"] for row in rows]
    assert errors == sorted(errors)
    shown = [line.split()[1] for line in table.splitlines() if line[2:3].isdigit()]
    assert shown == [row["observer"] for row in rows]
    assert document["failed"] == {}


def test_each_run_is_that_of_run(compared, sample_logs):
    _, folder = compared
    document = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    alone = pipeline.run(sample_logs / "quadcopter.tlog", pipeline.configure("cgo"))
    assert document["runs"]["cgo"]["metrics"]["total"]["rmse"] == alone.metrics.total.rmse
    assert set(document["runs"]) == set(NAMES)


def test_the_mcap_has_each_observers_topics_and_the_reference_once(compared):
    _, folder = compared
    with (folder / "compare.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        channels = reader.get_summary().channels.values()
        topics = [channel.topic for channel in channels]
        metadata = {record.name for record in reader.iter_metadata()}
        attached = {record.name for record in reader.iter_attachments()}
    assert len(topics) == len(set(topics))
    for name in NAMES:
        assert {f"/attest/{name}/{kind}" for kind in ("pose", "imu", "error", "state")} <= set(
            topics
        )
        assert f"attest/summary/{name}" in metadata
    assert ("/attest/cgo/bias" in topics, "/attest/wahba/bias" in topics) == (True, False)
    assert topics.count("/attest/reference/SIMSTATE/pose") == 1
    assert attached == {f"{name}.yaml" for name in NAMES}
    store, frames = get_typestore(Stores.ROS2_JAZZY), set()
    with (folder / "compare.mcap").open("rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=["/tf"]):
            (one,) = store.deserialize_cdr(message.data, "tf2_msgs/msg/TFMessage").transforms
            frames.add((one.header.frame_id, one.child_frame_id))
    assert frames == {("world", name) for name in (*NAMES, "reference/SIMSTATE")}


def test_the_recording_verifies_and_has_each_observer(compared):
    _, folder = compared
    rerun = [sys.executable, "-m", "rerun", "rrd"]
    path = str(folder / "compare.rrd")
    assert (
        subprocess.run([*rerun, "verify", path], capture_output=True, check=False).returncode == 0
    )
    printed = subprocess.run([*rerun, "print", path], capture_output=True, text=True, check=True)
    for name in NAMES:
        for entity in (f"/world/estimate/{name}", f"/error/total/{name}", f"/euler/yaw/{name}"):
            assert entity in printed.stdout + printed.stderr


def test_what_cannot_run_does_not_sink_the_others(sample_logs, tmp_path):
    log = sample_logs / "quadcopter.tlog"
    points = tmp_path / "points.yaml"
    points.write_text(
        "observer: relative_fts\npoints: {p1: [0, 0, 0], p2: [1, 0, 0], p3: [0, 1, 0]}\n"
    )
    done = attest("compare", log, "-o", "cgo", "-o", points, "--output", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert f"-   points: {log}: no 'p1' signal. The log holds: accel, gyro, mag," in done.stdout
    done = attest("compare", log, "-o", points, "-o", points, "--output", tmp_path / "out")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"attest: {log}: no observer could run. {log}: no 'p1' signal.")


def test_two_configurations_of_one_observer_have_names_of_their_own(sample_logs, tmp_path):
    log = sample_logs / "quadcopter.tlog"
    done = attest("compare", log, "-o", "cgo", "-o", "cgo", "--json", "--output", tmp_path)
    document = json.loads(done.stdout)
    assert set(document["runs"]) == {"cgo", "cgo-2"}
    first, second = document["ranking"]
    assert first["total_rmse_deg"] == second["total_rmse_deg"]


def test_one_observer_is_no_comparison(sample_logs):
    done = attest("compare", sample_logs / "quadcopter.tlog", "-o", "cgo")
    assert done.returncode == 2
    assert done.stderr == (
        "attest: one observer: nothing to compare with. Name two with -o, or use run.\n"
    )


def test_a_missing_log_and_an_unknown_observer_are_one_line(tmp_path):
    cgo = {"cgo": pipeline.configure("cgo")}
    with pytest.raises(ReadError, match="no such file"):
        pipeline.compare(tmp_path / "gone.tlog", cgo)
    with pytest.raises(ConfigError, match="ftz"):
        pipeline.configure("ftz")


def test_without_a_reference_the_order_is_that_of_consistency(sample_logs):
    configurations = {
        name: pipeline.configure(name, ["evaluation.reference=none"]) for name in NAMES
    }
    results, _ = pipeline.compare(sample_logs / "quadcopter.tlog", configurations)
    costs = [float(np.mean(result.estimates.cost)) for result in results]
    assert costs == sorted(costs)
    assert ranked(results) == results
    text = report.text_of_ranking(report.rank(results, {}), [])
    assert "none: ranked by Wahba's mean cost, consistency only" in text
