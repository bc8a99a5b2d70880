from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from attest.geometry import gps


def unix(text):
    return int(datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp())


@pytest.mark.parametrize(
    ("date", "ahead"),
    [
        ("1980-01-06", 0),
        ("1981-06-30T23:59:59", 0),
        ("1981-07-01", 1),
        ("1998-12-31T23:59:59", 12),
        ("1999-01-01", 13),
        ("2005-12-31T23:59:59", 13),
        ("2006-01-01", 14),
        ("2011-06-01", 15),
        ("2013-06-01", 16),
        ("2015-07-01", 17),
        ("2016-12-31T23:59:59", 17),
        ("2017-01-01", 18),
        ("2026-01-01", 18),
    ],
)
def test_gps_is_ahead_of_utc_by_the_leap_seconds_of_the_date(date, ahead):
    seconds = unix(date) - unix("1980-01-06") + ahead
    week, within = np.array([seconds // gps.WEEK]), np.array([seconds % gps.WEEK])
    assert gps.to_unix(week, 1000 * within).tolist() == [unix(date) * 10**9]
    back = gps.from_unix(np.array([unix(date) * 10**9]))
    assert [int(part[0]) for part in back] == [week[0], within[0] * 10**9]


@given(st.integers(gps.EPOCH * 1000, 4 * 10**12))
def test_there_and_back_is_exact(ms):
    week, within = gps.from_unix(np.array([ms * 10**6]))
    assert gps.to_unix(week, within // 10**6).tolist() == [ms * 10**6]


def test_the_week_of_a_date_of_igs():
    # week 2086 began on 29 December 2019
    week, within = gps.from_unix(np.array([(unix("2019-12-29") - 18) * 10**9]))
    assert (week.tolist(), within.tolist()) == ([2086], [0])
