from dataclasses import replace

import numpy as np
import pytest
from flights import gyro, recording, resting, stamps
from numpy.testing import assert_allclose

from attest.conditioning import magnetic
from attest.recording import Signal

YEAR = 365.2425 * 86400e9


def log_at(year, latitude, longitude, altitude, world="ned"):
    """Return a log of a place, whose clock starts at a decimal year."""
    t = stamps(10.0, 1.0)
    place = Signal(t[:1], np.array([[latitude, longitude, altitude]], float), "GPS")
    signals = {"gyro": gyro(resting, t), "position": place}
    utc = None if year is None else round((year - 1970.0) * YEAR) - int(t[0])
    return recording(signals, utc=utc, world=world)


# NOAA, WMM2020 test values; CIRES, example of WMM2025: X, Y, Z in nT, north-east-down
PUBLISHED = [
    (2020.0, 80, 0, 0, (6570.4, -146.3, 54606.0)),
    (2020.0, 0, 120, 0, (39624.3, 109.9, -10932.5)),
    (2020.0, -80, 240, 100, (5744.9, 14799.5, -49969.4)),
    (2022.5, 80, 0, 0, (6529.9, 1.1, 54713.4)),
    (2022.5, -80, 240, 0, (6016.5, 15776.7, -52251.6)),
    (2025.0, 23.35, 40, 21, (33796.6, 2169.5, 23807.4)),
]


@pytest.mark.parametrize(("year", "latitude", "longitude", "km", "nt"), PUBLISHED)
def test_field_is_the_published_one(year, latitude, longitude, km, nt):
    # a longitude is at most 180 in a log; the day may differ by rounding of the decimal year
    longitude -= 360 if longitude > 180 else 0
    found, _ = magnetic.field(log_at(year + 1e-9, latitude, longitude, km * 1e3))
    assert_allclose(found * 1e9, nt, atol=0.2)


def test_field_points_north_and_down_in_europe_and_up_in_australia():
    europe, _ = magnetic.field(log_at(2024.5, 48.0, 11.0, 500.0))
    australia, _ = magnetic.field(log_at(2024.5, -33.0, 151.0, 0.0))
    assert europe[0] > 15e-6
    assert europe[2] > 40e-6
    assert australia[0] > 15e-6
    assert australia[2] < -40e-6


def test_east_north_up_is_the_same_field_in_other_axes():
    ned, notes = magnetic.field(log_at(2024.5, 48.0, 11.0, 500.0))
    enu, same = magnetic.field(log_at(2024.5, 48.0, 11.0, 500.0, world="enu"))
    assert_allclose(enu, [ned[1], ned[0], -ned[2]])
    assert notes == same


def test_declination_and_dip_are_told_with_place_and_year():
    found, (note,) = magnetic.field(log_at(2024.5, 48.0, 11.0, 500.0))
    declination = np.rad2deg(np.arctan2(found[1], found[0]))
    dip = np.rad2deg(np.arctan2(found[2], np.hypot(found[0], found[1])))
    assert f"at 48.00, 11.00 in 2024.5, declination {declination:+.1f}°" in note.text
    assert f"dip {dip:+.1f}°" in note.text
    assert not note.doubt


def test_a_log_without_a_date_is_told_that_its_model_is_a_guess():
    found, notes = magnetic.field(log_at(None, 48.0, 11.0, 500.0))
    assert_allclose(found, magnetic.field(log_at(2025.0 + 1e-9, 48.0, 11.0, 500.0))[0], rtol=1e-6)
    assert [note.doubt for note in notes] == [False, True]
    assert "no date" in notes[1].text


@pytest.mark.parametrize(("year", "used"), [(1970.5, 2010.0), (2099.0, 2030.0)])
def test_a_date_outside_the_models_is_told_and_taken_at_their_end(year, used):
    found, notes = magnetic.field(log_at(year, 48.0, 11.0, 500.0))
    assert np.isfinite(found).all()
    assert f"in {used:.1f}" in notes[0].text
    assert notes[1].doubt
    assert "outside the magnetic models" in notes[1].text


def test_without_a_place_there_is_no_field():
    t = stamps(10.0, 1.0)
    assert magnetic.field(recording({"gyro": gyro(resting, t)})) is None
    assert magnetic.field(log_at(2024.5, 91.0, 0.0, 0.0)) is None
    assert magnetic.field(log_at(2024.5, 0.0, 181.0, 0.0)) is None


@pytest.mark.parametrize("altitude", [1e300, 1e9, -1e9, -6.4e6])
def test_an_altitude_beyond_the_model_is_no_place(altitude):
    assert magnetic.field(log_at(2024.5, 47.0, 8.0, altitude)) is None


def test_a_flight_across_the_date_line_is_there_and_not_in_greenwich():
    there, _ = magnetic.field(log_at(2024.5, 10.0, 180.0, 0.0))
    log = log_at(2024.5, 10.0, 180.0, 0.0)
    t = np.arange(4)
    places = [[10.0, lon, 0.0] for lon in (179.99, -179.99, 179.98, -179.98)]
    signals = {**log.signals, "position": Signal(t, np.array(places))}
    across, _ = magnetic.field(replace(log, signals=signals))
    assert_allclose(across, there, rtol=1e-3)


@pytest.mark.parametrize("altitude", [-1e3, 0.0, 1e5])
@pytest.mark.parametrize("latitude", [-90.0, 0.0, 90.0])
def test_no_place_on_earth_breaks_the_model(latitude, altitude):
    found, _ = magnetic.field(log_at(2024.5, latitude, 180.0, altitude))
    assert np.isfinite(found).all()


@pytest.mark.parametrize("world", ["ned", "enu"])
@pytest.mark.parametrize("dip", [-1.2, 0.0, 0.9])
def test_north_has_the_dip_that_it_was_given(world, dip):
    unit = magnetic.north(dip, world)
    assert_allclose(np.linalg.norm(unit), 1.0)
    assert magnetic.dip_of(unit, world) == pytest.approx(dip)
    assert unit[0 if world == "ned" else 1] > 0.0
    assert unit[1 if world == "ned" else 0] == 0.0


@pytest.mark.parametrize("world", ["ned", "enu"])
def test_another_dip_keeps_the_heading(world):
    field = magnetic.north(1.0, world) + np.array([0.1, 0.2, 0.0])
    turned = magnetic.with_dip(field, -0.4, world)
    assert magnetic.dip_of(turned, world) == pytest.approx(-0.4)
    assert np.linalg.norm(turned) == pytest.approx(1.0)
    assert np.arctan2(turned[1], turned[0]) == pytest.approx(np.arctan2(field[1], field[0]))


def test_dip_of_a_log_is_the_median_angle_below_the_horizon():
    up = np.broadcast_to([0.0, 0.0, -1.0], (5, 3))
    dips = np.array([0.5, 0.9, 1.0, 1.1, -1.5])
    mag = np.stack([np.cos(dips), 0 * dips, np.sin(dips)], axis=1)
    valid = np.ones(len(up), bool)
    assert magnetic.dip_of_log(up, mag, valid) == pytest.approx(0.9)
    assert magnetic.dip_of_log(up, mag, ~valid) is None
