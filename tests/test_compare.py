import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from results import result
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from attest import comparison, pipeline, report
from attest.cli.labels import labelled as labels
from attest.errors import ConfigError, ReadError
from attest.result import ranked
from attest.writers.mcap import write_mcap
from attest.writers.topics import streams

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
        comparison.compare(tmp_path / "gone.tlog", cgo)
    with pytest.raises(ConfigError, match="ftz"):
        pipeline.configure("ftz")


def test_without_a_reference_the_order_is_that_of_consistency(sample_logs):
    configurations = {
        name: pipeline.configure(name, ["evaluation.reference=none"]) for name in NAMES
    }
    results, _ = comparison.compare(sample_logs / "quadcopter.tlog", configurations)
    costs = [float(np.mean(result.estimates.cost)) for result in results]
    assert costs == sorted(costs)
    assert ranked(results) == results
    text = report.text_of_ranking(report.rank(results, {}), [])
    assert "none: ranked by Wahba's mean cost, consistency only" in text


def named(label, made=None, **changes):
    made = made or result(60)
    estimates = replace(made.estimates, observer=label, **changes)
    return replace(made, estimates=estimates)


def parents(results):
    """Parents of each frame."""
    found = {}
    for stream in streams(results):
        if stream.topic in {"/tf", "/tf_static"}:
            ends = [f.value for f in stream.fields if f.name in {"frame_id", "child_frame_id"}]
            parent, child = (end.rstrip(b"\0").decode() for end in ends)
            found.setdefault(child, set()).add(parent)
    return found


def test_labels_stay_apart_as_topics():
    names = ["fts", "a/my fts.yaml", "my-fts.yaml", "fts", "fts-2.yaml", "paper/fts"]
    assert list(labels(names)) == ["fts", "my fts", "my-fts-2", "fts-2", "fts-2-2", "fts-3"]
    assert list(labels(["b\udcff.yaml"])) == ["b?"]


def test_every_frame_has_one_parent_whatever_the_names_are():
    relative = {"frames": ("object", "observer")}
    results = [named("fts"), named("world"), named("a", **relative), named("b", **relative)]
    assert parents(results) == {
        "world": {"map"},
        "object": {"map"},
        "fts": {"world"},
        "world/world": {"world"},
        "observer": {"object"},
        "b/observer": {"object"},
        "reference/SIMSTATE": {"world"},
    }
    assert parents([named("a", **relative)])["reference/SIMSTATE"] == {"object"}


def test_frames_are_those_of_the_headers(tmp_path):
    path = tmp_path / "compare.mcap"
    write_mcap(path, [named("a", frames=("object", "observer")), named("fts")])
    with AnyReader([path]) as reader:
        heads = {
            connection.topic: reader.deserialize(data, connection.msgtype).header.frame_id
            for connection, _, data in reader.messages()
            if not connection.topic.startswith("/tf")
        }
    assert (heads["/attest/a/pose"], heads["/attest/a/imu"]) == ("object", "observer")
    assert (heads["/attest/fts/pose"], heads["/attest/fts/imu"]) == ("world", "fts")


def test_what_is_not_scored_comes_last():
    unscored = replace(named("b"), metrics=None)
    worse = named("c")
    worse = replace(
        worse, metrics=replace(worse.metrics, total=replace(worse.metrics.total, rmse=99))
    )
    order = ranked([unscored, worse, named("a")])
    assert [each.estimates.observer for each in order] == ["a", "c", "b"]


@pytest.mark.parametrize("key", ["evaluation.reference=ATTITUDE", "input.start_s=10"])
def test_what_would_not_compare_is_refused(sample_logs, key):
    unlike = {"fts": pipeline.configure("fts"), "mine": pipeline.configure("fts", [key])}
    with pytest.raises(ConfigError, match=f"'{key.split('=')[0]}' is None of fts"):
        comparison.compare(sample_logs / "quadcopter.tlog", unlike)


def test_unknown_reference_is_wrong_usage(sample_logs):
    log = sample_logs / "quadcopter.tlog"
    done = attest("compare", log, "--reference", "FOO")
    message = (
        f"attest: {log}: no reference 'FOO', and no such file. The log has: SIMSTATE, ATTITUDE.\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (2, "", message)


def test_log_is_read_once_and_conditioned_once_for_all_that_agree(sample_logs, monkeypatch):
    calls = []
    for module, name in ((pipeline.readers, "read"), (pipeline.conditioning, "condition")):
        real = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *given, real=real, name=name: calls.append(name) or real(*given)
        )
    other = pipeline.configure("cgo", ["conditioning.max_step_s=0.02"])
    given = {name: pipeline.configure(name) for name in ("cgo", "mekf", "wahba")} | {"slow": other}
    comparison.compare(sample_logs / "quadcopter.tlog", given)
    assert calls == ["read", "condition", "condition"]


def test_notes_of_all_are_told_once_and_those_of_one_under_its_name(compared):
    table, folder = compared
    assert table.count("gap in the gyroscope bridged") == 1
    document = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    own = {"text": "mine alone", "count": 2}
    document["runs"]["cgo"]["warnings"].append(own)
    text = report.text_of_ranking(document, [])
    assert "! cgo: mine alone (×2)" in text


def test_table_counts_what_was_promised_and_held(compared):
    table, folder = compared
    document = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    order = [row["observer"] for row in document["ranking"]]
    claims = {name: document["runs"][name]["attestation"] for name in order}
    unknown = {name: sum(claim["holds"] is None for claim in claims[name]) for name in order}
    said = {
        name: f"{name}: {len(claims[name]) - unknown[name]} of {len(claims[name])} held"
        + (f", {unknown[name]} open" if unknown[name] else "")
        for name in order
    }
    first, *others = said.values()
    lines = [f"  promised    {first}", *(f"{'':14s}{each}" for each in others)]
    assert "\n".join(["", "", *lines, "", ""]) in table


def test_table_says_what_did_not_hold_and_is_silent_where_nothing_is_promised(compared):
    _, folder = compared
    document = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    for run in document["runs"].values():
        run["attestation"] = []
    assert "promised" not in report.text_of_ranking(document, [])
    held = (True, False, True, None)
    document["runs"]["cgo"]["attestation"] = [{"holds": holds} for holds in held]
    text = report.text_of_ranking(document, [])
    assert "\n\n  promised    cgo: 2 of 4 held, 1 did NOT, 1 open\n\n" in text


def test_table_says_what_the_figures_are_worth(compared):
    table, folder = compared
    assert "[°/s]" in table
    assert "[ns]" in table
    document = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    document["reference"] = {"name": "ATTITUDE", "kind": "autopilot", "independent": False}
    document["ranking"][0]["settling_time_s"] = None
    text = report.text_of_ranking(document, [])
    assert "not independent, not truth" in text
    assert "never" in text


def test_costs_of_different_weights_are_said_not_to_compare(sample_logs):
    none = "evaluation.reference=none"
    given = {
        "cgo": pipeline.configure("cgo", [none]),
        "other": pipeline.configure("cgo", [none, "weights.k=[3.0, 2.0, 1.0]"]),
    }
    results, _ = comparison.compare(sample_logs / "quadcopter.tlog", given)
    assert "their costs do not compare" in report.text_of_ranking(report.rank(results, {}), [])


def test_name_that_is_not_utf_8_is_written(sample_logs, tmp_path):
    mine = os.fsdecode(os.fsencode(tmp_path) + b"/b\xff.yaml")
    Path(mine).write_text("observer: cgo\n")
    done = attest(
        "compare", sample_logs / "quadcopter.tlog", "-o", "cgo", "-o", mine, "--output", tmp_path
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "b?" in done.stdout


def test_equal_comparisons_give_equal_bytes_but_for_time(compared, sample_logs, tmp_path):
    _, folder = compared
    options = [option for name in NAMES for option in ("-o", name)]
    log = sample_logs / "quadcopter.tlog"
    attest("compare", log, *options, "--output", tmp_path, "--quiet")
    again = tmp_path / "quadcopter"
    assert (again / "compare.mcap").read_bytes() == (folder / "compare.mcap").read_bytes()
    documents = [json.loads((f / "compare.json").read_text()) for f in (folder, again)]
    for document in documents:
        for row in document["ranking"]:
            del row["time_per_step_ns"]
        for run in document["runs"].values():
            del run["timing"]
    assert documents[0] == documents[1]


def test_quiet_tells_of_failures_only(sample_logs, tmp_path):
    points = tmp_path / "points.yaml"
    points.write_text(
        "observer: relative_fts\npoints: {p1: [0, 0, 0], p2: [1, 0, 0], p3: [0, 1, 0]}\n"
    )
    log = sample_logs / "quadcopter.tlog"
    done = attest("compare", log, "-o", "cgo", "-o", points, "--output", tmp_path / "out", "-q")
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.startswith(f"attest: points: {log}: no 'p1' signal.")
    assert done.stderr.count("\n") == 1
