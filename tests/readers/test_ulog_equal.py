"""ULog topics as pyulog reads them, recorded and simulated."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pyulog import ULog

from attest import readers, simulation
from attest.errors import ConfigError
from attest.readers import ulog_frames, ulog_tables, ulog_topics
from attest.simulation import ulog


def streams(path):
    data = path.read_bytes()
    sound = ulog_frames.sound(data, ulog_topics.WANTED)
    return sound, ulog_tables.streams(data, sound, ulog_tables.definitions(path, sound))


def assert_equal(found, whole):
    """Compare what is read with what pyulog reads."""
    ours = {(s.topic, s.instance): s.data for group in found.values() for s in group}
    theirs = {(d.name, d.multi_id): d.data for d in whole.data_list}
    assert ours.keys() == {key for key in theirs if key[0] in ulog_topics.WANTED}
    for key, mine in ours.items():
        assert mine.keys() == theirs[key].keys()
        for column, values in mine.items():
            assert values.dtype == theirs[key][column].dtype, (key, column)
            assert values.tobytes() == theirs[key][column].tobytes(), (key, column)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    path = tmp_path_factory.mktemp("ulog") / "quadcopter.ulg"
    path.write_bytes(ulog.encode(simulation.simulate("quadcopter")))
    return path


def test_every_topic_is_as_pyulog_reads_it(simulated):
    sound, found = streams(simulated)
    whole = ULog(str(simulated))
    assert not whole.file_corruption
    assert_equal(found, whole)
    assert sound.counts == {d.name: len(d.data["timestamp"]) for d in whole.data_list}


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "rates", "reference"),
    [
        (
            "auav_x21",
            {"gyro": (17070, 250.0), "accel": (17070, 250.0), "mag": (6759, 96.525)},
            ("vehicle_attitude", "autopilot", 6461),
        ),
        (
            "cubeorange_rest",
            {"gyro": (1298, 204.583), "accel": (1298, 204.583), "mag": (319, 49.995),
             "velocity": (32, 5.0), "position": (32, 5.0)},
            ("vehicle_attitude", "autopilot", 1298),
        ),
        (
            "sitl_groundtruth",
            {"gyro": (2028, 250.0), "accel": (2028, 250.0), "mag": (159, 14.706),
             "velocity": (30, 19.231), "position": (30, 19.231)},
            ("vehicle_attitude_groundtruth", "truth", 1078),
        ),
    ],
)  # fmt: skip
def test_recorded_logs(shared, name, rates, reference):
    path = shared / "ulog" / f"{name}.ulg"
    sound, found = streams(path)
    whole = ULog(str(path))
    assert sound.damage == ulog_frames.Damage()
    assert [*sound.dropouts] == [dropout.duration for dropout in whole.dropouts]
    assert_equal(found, whole)
    recording = readers.read(path)
    rhythm = {key: (len(s.t), pytest.approx(1e9 / np.median(np.diff(s.t)), rel=0.01))
             for key, s in recording.signals.items()}  # fmt: skip
    assert rates == rhythm
    first = next(iter(recording.references.values()))
    assert (first.name, first.kind, len(first.t)) == reference
    span = recording.signals["gyro"].t
    for other in (*recording.signals.values(), *recording.references.values()):
        assert span[0] - 1e9 < other.t[0]
        assert other.t[-1] < span[-1] + 1e9


def test_simulated_log_has_what_the_flight_had(simulated):
    flown, recording = simulation.simulate("quadcopter"), readers.read(simulated)
    heard = flown.received(flown.t)
    truth = recording.references["vehicle_attitude_groundtruth"]
    assert_array_equal(truth.t, flown.t[heard])
    assert_allclose(np.abs(np.einsum("ij,ij->i", truth.q, flown.q[heard])), 1.0, atol=1e-6)
    gyro = flown.signals["gyro"]
    assert_allclose(recording.signals["gyro"].y, gyro.y[flown.received(gyro.t)], atol=1e-6)
    assert recording.clock.utc_offset == flown.utc_offset
    assert any(note.text == "dropouts of the logger, 1500 ms" for note in recording.notes)


def test_a_flight_without_sensors_has_no_log():
    with pytest.raises(ConfigError) as error:
        ulog.encode(simulation.simulate("fts-7.1"))
    assert str(error.value).endswith("for a .ulg. Write a .csv instead.")
