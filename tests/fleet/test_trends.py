"""Whole fleets: what is flagged in steady ones, and in others."""

import numpy as np
import pytest
import summaries

from attest import fleet
from attest.errors import ConfigError, ReadError
from attest.fleet import Choice
from attest.fleet.trend import FEWEST


@pytest.fixture
def told(tmp_path):
    """Return the document of rows, and the flagged series by figure."""

    def told(rows, choice=None):
        document = fleet.fleet([summaries.write(tmp_path, rows)], choice or Choice())
        return document, {one["figure"]: one for one in document["series"] if one["changes"]}

    return told


def changed(rows, first, **by):
    """Add to figures of the rows from one on."""
    return [
        row | {key: row[key] + value for key, value in by.items()} if i >= first else row
        for i, row in enumerate(rows)
    ]


def test_hundred_steady_vehicles_have_hardly_a_flag(told):
    rows = [row for v in range(100) for row in summaries.steady(25, f"v{v:02d}")]
    document, _ = told(rows)
    assert document["judged"]["series"] == 800
    assert document["judged"]["changed"] == 0
    assert document["judged"]["perhaps_changed"] <= 3
    assert document["judged"]["perhaps_by_chance_at_most"] == pytest.approx(0.8)
    assert document["judged"]["odd_flights"] <= 1


def test_steps_are_found_among_hundred_vehicles(told):
    rows = [row for v in range(99) for row in summaries.steady(12, f"v{v:02d}")]
    rows += changed(summaries.steady(40), 20, hard_iron_x_ut=4.0, heading_offset_deg=6.0)
    document, flagged = told(rows)
    assert document["series"][0]["vehicle"] == document["vehicles"][0]["vehicle"] == "one"
    (step,) = flagged["hard iron x"]["changes"]
    assert (step["kind"], step["sure"]) == ("step", True)
    assert step["by_utc"][:10] == "2026-01-21"
    assert step["log"] == "/flights/one/0020.BIN"
    assert (step["before"], step["after"]) == pytest.approx((3.0, 7.0), abs=0.7)
    assert flagged["heading offset"]["changes"][0]["after"] == pytest.approx(6.0, abs=1.0)


def test_two_steps_are_two_changes(told):
    rows = changed(summaries.steady(60), 20, field_ut_median=8.0)
    rows = changed(rows, 40, field_ut_median=-8.0)
    _, flagged = told(rows)
    steps = flagged["field/model"]["changes"]
    assert [step["by_utc"][:10] for step in steps] == ["2026-01-21", "2026-02-10"]


def test_drift_is_told_with_its_ends_and_its_slope(told):
    rows = summaries.steady(60)
    rows = [row | {"gyro_bias_y": row["gyro_bias_y"] + 2e-4 * i} for i, row in enumerate(rows)]
    _, flagged = told(rows)
    one = flagged["gyro bias y"]
    (drift,) = one["changes"]
    assert drift["kind"] == "drift"
    assert one["slope_per_month"] == pytest.approx(np.rad2deg(2e-4 * 30.4375), rel=0.1)
    assert drift["after"] - drift["before"] == pytest.approx(np.rad2deg(2e-4 * 59), rel=0.1)


def test_odd_flight_is_told_and_is_no_change(told):
    rows = summaries.steady(30)
    rows[17] |= {"total_rmse_deg": 60.0, "field_ut_median": 80.0}
    document, flagged = told(rows)
    assert not flagged
    odd = {one["figure"]: one["odd"] for one in document["series"] if one["odd"]}
    assert set(odd) == {"total RMSE", "field/model"}
    assert odd["total RMSE"][0]["log"] == "/flights/one/0017.BIN"
    assert document["vehicles"] == [{"vehicle": "one", "flights": 30, "changes": 0, "odd": 1}]


def test_few_flights_are_listed_and_not_judged(told):
    rows = changed(summaries.steady(FEWEST - 1), 4, hard_iron_x_ut=50.0)
    document, flagged = told(rows)
    assert not flagged
    assert document["judged"]["series"] == 0
    assert {one["chance"] for one in document["series"]} == {None}


def test_log_and_observer_count_once_and_the_newest_version_wins(tmp_path):
    old = [row | {"total_rmse_deg": 9.0, "version": "1.9.0"} for row in summaries.steady(4)]
    new = [row | {"total_rmse_deg": 1.0, "version": "1.10.0"} for row in summaries.steady(4)]
    folders = [summaries.write(tmp_path / name, rows) for name, rows in (("b", new), ("a", old))]
    document = fleet.fleet(folders, Choice())
    assert (document["rows"]["used"], document["rows"]["twice"]) == (4, 4)
    (rmse,) = [one for one in document["series"] if one["figure"] == "total RMSE"]
    assert (rmse["flights"], rmse["median"]) == (4, 1.0)


def test_what_ran_last_wins_whatever_its_path_and_version(tmp_path):
    early, late = "2026-02-01T10:00:00.000+00:00", "2026-02-01T10:00:00.500+00:00"
    old = [
        row | {"ran_utc": early, "total_rmse_deg": 9.0, "path": f"/z{row['path']}"}
        for row in summaries.steady(4, version="1.10.0")
    ]
    new = [
        row | {"ran_utc": late, "total_rmse_deg": 1.0} for row in summaries.steady(4, version="1.9")
    ]
    unknown = [row | {"total_rmse_deg": 5.0} for row in summaries.steady(4, version="2.0")]
    document = fleet.fleet([summaries.write(tmp_path, new + old + unknown)], Choice())
    (rmse,) = [one for one in document["series"] if one["figure"] == "total RMSE"]
    assert (rmse["flights"], rmse["median"]) == (4, 1.0)


def test_errors_by_different_configurations_do_not_compare(told):
    rows = changed(summaries.steady(30), 15, hard_iron_x_ut=9.0, total_rmse_deg=9.0)
    rows = [row | {"digest": f"{'ab'[i >= 15]}{'0' * 63}"} for i, row in enumerate(rows)]
    document, flagged = told(rows)
    assert set(flagged) == {"hard iron x"}
    assert flagged["hard iron x"]["changes"][0]["configuration_changed"]
    assert document["configurations"] == {"fts": 2}
    found = {one["configuration"]: one["flights"] for one in document["series"]}
    assert found == {None: 30, "a0000000": 15, "b0000000": 15}
    text = fleet.text_of_fleet(document, [])
    assert "fts in 2 ways: errors are followed in each by itself" in text
    assert "as the configuration changed" in text


def test_change_of_the_vehicle_is_none_of_the_configuration(told):
    rows = changed(summaries.steady(30), 15, hard_iron_x_ut=9.0)
    rows = [row | {"digest": "ab"[i >= 20]} for i, row in enumerate(rows)]
    _, flagged = told(rows)
    assert not flagged["hard iron x"]["changes"][0]["configuration_changed"]


def test_what_observers_tell_alike_is_one_series(told):
    rows = summaries.steady(4)
    other = [row | {"observer": "mekf", "total_rmse_deg": 7.0} for row in rows]
    document, _ = told(rows + other)
    observers = {}
    for one in document["series"]:
        observers.setdefault(one["figure"], []).append(one["observers"])
    assert observers["hard iron x"] == [["fts", "mekf"]]
    assert observers["total RMSE"] == [["fts"], ["mekf"]]
    assert document["vehicles"][0]["flights"] == 4


def test_errors_against_different_references_do_not_compare(told):
    rows = summaries.steady(8)
    rows = [row | {"reference": "SIM" if i < 5 else "ATT"} for i, row in enumerate(rows)]
    document, _ = told(rows)
    found = {
        one["reference"]: one["flights"]
        for one in document["series"]
        if one["figure"] == "total RMSE"
    }
    assert found == {"SIM": 5, "ATT": 3}


def test_undated_flights_are_in_the_medians_only(told):
    rows = summaries.steady(14)
    for when, row in zip([None, "", "never", "1970-01-01T00:00:00+00:00"], rows, strict=False):
        row["began_utc"] = when
    document, _ = told(rows)
    assert document["rows"]["undated"] == 4
    one = document["series"][0]
    assert (one["flights"], one["undated"]) == (14, 4)
    assert one["first_utc"] == "2026-01-05T12:00:00+00:00"


def test_vehicle_that_is_not_named_is_the_folder(told):
    rows = [row | {"vehicle": None} for row in summaries.steady(3)]
    document, _ = told(rows)
    assert document["rows"]["without vehicle"] == 3
    assert document["vehicles"][0]["vehicle"] == "folder /flights/one"


def test_vehicles_of_one_firmware_are_apart_by_their_ids_and_one_of_two_firmwares_is_one(told):
    rows = summaries.steady(24)
    for i, row in enumerate(rows):
        number, version = 1 + (i >= 12), "V4.6" if i % 12 < 6 else "V4.7"
        row |= {"vehicle": f"ArduCopter {version}.0 (ab)", "vehicle_id": f"serial {number}"}
    document, flagged = told(changed(rows, 12, hard_iron_x_ut=20.0))
    assert not flagged
    assert document["rows"]["without own id"] == 0
    assert {one["vehicle"]: one["flights"] for one in document["vehicles"]} == {
        "ArduCopter V4.7.0 (ab), serial 1": 12,
        "ArduCopter V4.7.0 (ab), serial 2": 12,
    }


def test_system_id_tells_vehicles_of_one_kind_apart_and_may_be_shared(told):
    names = ("ArduCopter V4.6.0", "ArduCopter V4.7.0", "ArduPlane V4.6.0")
    rows = [
        row | {"vehicle": name, "vehicle_id": "system 1"}
        for name, row in zip(names, summaries.steady(3), strict=True)
    ]
    document, _ = told(rows)
    assert document["rows"]["without own id"] == 3
    assert {one["vehicle"]: one["flights"] for one in document["vehicles"]} == {
        "ArduCopter V4.7.0, system 1": 2,
        "ArduPlane V4.6.0, system 1": 1,
    }


def test_by_folder_logs_of_one_name_are_apart(told):
    rows = summaries.steady(3) + [row | {"vehicle": "one"} for row in summaries.steady(2, "two")]
    document, _ = told(rows, Choice(by="folder"))
    names = {one["vehicle"]: one["flights"] for one in document["vehicles"]}
    assert names == {"/flights/one": 3, "/flights/two": 2}


def test_given_iron_is_no_finding_and_offsets_unwind(told):
    rows = summaries.steady(4, iron="given")
    rows = [row | {"heading_offset_deg": (178.0, -178.0)[i % 2]} for i, row in enumerate(rows)]
    document, _ = told(rows)
    series = {one["figure"]: one for one in document["series"]}
    assert "hard iron x" not in series
    assert abs(series["heading offset"]["median"]) == pytest.approx(180.0)
    assert series["heading offset"]["mad"] == pytest.approx(2.0)


def test_days_and_observers_are_chosen(told):
    from datetime import date

    days = Choice(since=date(2026, 1, 3), until=date(2026, 1, 5), observers=("fts",))
    other = [row | {"observer": "mekf"} for row in summaries.steady(9)]
    document, _ = told(summaries.steady(9) + other, days)
    rows = document["rows"]
    assert (rows["used"], rows["of other days"], rows["of other observers"]) == (3, 6, 9)
    with pytest.raises(ConfigError, match=r"--observer vae: .* They have: fts, mekf\."):
        told(summaries.steady(9) + other, Choice(observers=("vae",)))


def test_no_usable_row_says_why(told):
    rows = [row | {"status": "failed"} for row in summaries.steady(2)]
    with pytest.raises(ReadError, match=r"no row with a figure .* \(2 read, 2 not ok\)\."):
        told(rows)
