"""DataFlash messages as pymavlink reads them, recorded, simulated and made up."""

from collections import defaultdict
from contextlib import closing

import numpy as np
import pytest
from dataflash_logs import Log, flight
from numpy.testing import assert_allclose, assert_array_equal
from pymavlink import DFReader

from attest import readers, simulation
from attest.errors import ConfigError
from attest.readers import dataflash_scan, dataflash_text
from attest.simulation import dataflash

TIMES = np.arange(100.0, 110.0, 0.04)


def expected(path, kind):
    """What pymavlink reads: by message, the columns and all values."""
    found = defaultdict(list)
    with closing(kind(str(path))) as log:
        while (message := log.recv_msg()) is not None:
            found[message.get_type()].append(message)
    return found


def assert_equal(tables, messages, names):
    assert names
    for name in names:
        table, theirs = tables[name], messages[name]
        assert len(table) == len(theirs), name
        for column, values in table.columns.items():
            if values.ndim > 1:
                continue
            told = [getattr(message, column) for message in theirs]
            if values.dtype.kind == "S":
                assert [value.decode("latin-1") for value in values] == told, (name, column)
            else:
                assert_array_equal(values.astype(float), np.array(told, float), f"{name}.{column}")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    path = tmp_path_factory.mktemp("dataflash") / "quadcopter.BIN"
    path.write_bytes(dataflash.encode(simulation.simulate("quadcopter")))
    return path


def test_every_message_is_as_pymavlink_reads_it(simulated):
    messages = expected(simulated, DFReader.DFReader_binary)
    scan = dataflash_scan.scan(simulated, set(messages))
    assert scan.counts == {name: len(found) for name, found in messages.items()}
    assert_equal(scan.tables, messages, set(messages))


@pytest.mark.shared
@pytest.mark.parametrize("name", ["bluerov2.BIN", "plane_truncated.BIN"])
def test_recorded_logs_are_as_pymavlink_reads_them(shared, name):
    path = shared / "dataflash" / name
    messages = expected(path, DFReader.DFReader_binary)
    messages.pop("FMT")  # of which pymavlink gives some again
    messages.pop("MODE")  # which it names
    scan = dataflash_scan.scan(path, set(messages))
    assert {key: scan.counts[key] for key in messages} == {k: len(v) for k, v in messages.items()}
    assert_equal(scan.tables, messages, set(messages))


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "rates", "references"),
    [
        (
            "bluerov2",
            {"gyro": (594, 25.0), "accel": (594, 25.0), "mag": (237, 10.0),
             "velocity": (237, 10.0)},
            ["XKQ[0]", "ATT", "AHR2", "XKF1[0]"],
        ),
        (
            "plane_truncated",
            {"gyro": (45, 49.9), "accel": (45, 49.9), "mag": (8, 10.0), "velocity": (24, 24.9),
             "position": (23, 24.8)},
            ["NKQ1", "NKQ2", "ATT", "AHR2", "NKF1"],
        ),
    ],
)  # fmt: skip
def test_recorded_logs(shared, name, rates, references):
    recording = readers.read(shared / "dataflash" / f"{name}.BIN")
    rhythm = {key: (len(s.t), pytest.approx(1e9 / np.median(np.diff(s.t)), rel=0.01))
              for key, s in recording.signals.items()}  # fmt: skip
    assert rates == rhythm
    assert [*recording.references] == references
    assert {r.kind for r in recording.references.values()} == {"autopilot"}
    down = np.mean(recording.signals["accel"].y[:, 2])
    assert -10.5 < down < -9.0


@pytest.mark.parametrize("chars", ["bBghHiIf", "dcCeELqQ"])
def test_every_character_of_a_format_is_as_pymavlink_reads_it(tmp_path, chars):
    rng, log, path = np.random.default_rng(1), Log(), tmp_path / "all.BIN"
    columns = ",".join(["TimeUS", *(f"F{char}" for char in chars), "n", "N", "Z"])
    log.define("ALL", "Q" + chars + "nNZ", columns)
    limits = {"b": 2**7, "B": 2**8, "h": 2**15, "H": 2**16, "i": 2**31, "I": 2**32, "q": 2**62,
              "Q": 2**62, "c": 300, "C": 600, "e": 2e7, "E": 4e7, "L": 200}  # fmt: skip
    for i in range(200):
        values = [rng.normal() if c in "gfd" else int(rng.integers(0, limits[c])) for c in chars]
        log.add("ALL", 10_000 * i, *values, "abcd", "a name", "a text")
    path.write_bytes(log.data)
    messages = expected(path, DFReader.DFReader_binary)
    assert_equal(dataflash_scan.scan(path, {"ALL"}).tables, messages, {"ALL"})


def test_text_is_as_pymavlink_reads_it(tmp_path):
    path = tmp_path / "flight.log"
    path.write_bytes(flight(TIMES, XKQ=(0, 1.0, 0.0, 0.0, 0.0)).add("MSG", 1, "a b").text())
    messages = expected(path, DFReader.DFReader_text)
    names = {"IMU", "MAG", "ATT", "XKQ"}
    assert_equal(dataflash_text.scan(path, names).tables, messages, names)


@pytest.mark.shared
@pytest.mark.parametrize("name", ["bluerov2", "plane_truncated"])
def test_recorded_logs_as_text_are_as_pymavlink_reads_them(shared, tmp_path, name):
    path = tmp_path / "flight.log"
    with closing(DFReader.DFReader_binary(str(shared / "dataflash" / f"{name}.BIN"))) as log:
        lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
        while (message := log.recv_msg()) is not None:
            values = [str(getattr(message, field)) for field in message.get_fieldnames()]
            lines.append(", ".join([message.get_type(), *values]))
    path.write_text("\n".join(lines) + "\n")
    messages = expected(path, DFReader.DFReader_text)
    names = {"IMU", "IMU2", "MAG", "ATT", "AHR2", "XKF1", "NKF1", "GPS", "POS"} & messages.keys()
    assert_equal(dataflash_text.scan(path, names).tables, messages, names)


def test_simulated_log_has_what_the_flight_had(simulated):
    flown, recording = simulation.simulate("quadcopter"), readers.read(simulated)
    heard = flown.received(flown.t)
    assert_array_equal(recording.references["SIM"].t, flown.t[heard])
    off = np.abs(np.einsum("ij,ij->i", recording.references["SIM"].q, flown.q[heard]))
    assert_allclose(off, 1.0, atol=1e-6)
    gyro = flown.signals["gyro"]
    assert_allclose(recording.signals["gyro"].y, gyro.y[flown.received(gyro.t)], atol=1e-6)
    assert recording.clock.utc_offset == pytest.approx(flown.utc_offset, abs=2e6)
    assert recording.vehicle == "ArduCopter V4.6.0 (simulated)"


def test_a_flight_without_sensors_has_no_log():
    with pytest.raises(ConfigError) as error:
        dataflash.encode(simulation.simulate("fts-7.1"))
    assert str(error.value).endswith("for a .BIN. Write a .csv instead.")
