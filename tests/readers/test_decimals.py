"""Columns of decimal numbers against ``float`` and ``int``."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from attest.readers import decimals

SIGNED = st.integers(-(2**63), 2**63 - 1)
TIES = st.builds(lambda m, k: f"{(2 * (m | 1 << 52) + 1) << k}", st.integers(0, 2**53 - 1),
                 st.integers(0, 9))  # fmt: skip
HALVES = st.builds(lambda m, k: f"{(2 * (m | 1 << 40) + 1) * 5**k}e-{k}",
                   st.integers(0, 2**41 - 1), st.integers(1, 8))  # fmt: skip
WRITTEN = st.builds(lambda w, q, e: f"{w}{e}{q:+d}", SIGNED, st.integers(-80, 80),
                    st.sampled_from("eE"))  # fmt: skip
FIXED = st.builds(lambda x, n: f"{x:.{n}f}", st.floats(-100, 100), st.integers(0, 17))
SHORT = st.floats(width=32, allow_nan=False, allow_infinity=False).map(repr)
LONG = st.floats(-1e60, 1e60).map(repr)


def read(rows, types):
    text = np.frombuffer(("\n".join(rows) + "\n" * 8).encode(), np.uint8)
    start = np.cumsum([0, *(len(row.encode()) + 1 for row in rows[:-1])])
    return decimals.columns(text, start, types)


def one(texts, kind):
    (column,), plain = read(texts, [kind])
    return column, plain


@given(st.lists(TIES | HALVES | WRITTEN | FIXED | SHORT | LONG, min_size=1))
def test_a_number_is_the_float64_that_python_has(texts):
    column, plain = one(texts, np.float64)
    expected = np.array([float(text) for text in texts])
    assert_array_equal(column.view(np.uint64)[plain], expected.view(np.uint64)[plain])
    written = [text.lower().partition("e")[0].strip("-") for text in texts]
    short = [len(text.replace(".", "").lstrip("0")) <= 17 for text in written]
    assert plain[short].all() or any(abs(float(text)) < 1e-60 for text in texts)


@given(st.lists(SIGNED, min_size=1))
def test_a_whole_number_is_itself(values):
    column, plain = one([f"{value:+d}" for value in values], np.int64)
    assert plain.all()
    assert column.tolist() == values


@pytest.mark.parametrize("text", ["0", "-0", "0.0", "-0.0", ".5", "5.", "+3", "1e5", "0e80", "\t7 ",
                                  "9007199254740993", "9007199254740992.5", "1e22", "1e23",
                                  "000000000000000000000001.5", "0.0000000000000000000000000001",
                                  "nan", "NaN", "-nan", " 8.41\r"])  # fmt: skip
def test_spellings_of_a_number(text):
    column, plain = one([text], np.float64)
    assert plain[0]
    assert_array_equal(column, [float(text)])
    assert np.isnan(column[0]) or np.signbit(column[0]) == np.signbit(float(text))


@pytest.mark.parametrize("text", ["", " ", "x", "-", ".", "e5", "1e", "1e+", "1.2.3", "1 2", "--1",
                                  "na", "1e9999", "1e300", "1_0", "0x1", "123456789012345678901",
                                  "1,2", "1;"])  # fmt: skip
def test_what_is_no_plain_number_is_told(text):
    assert not one([text], np.float64)[1][0]


@pytest.mark.parametrize(
    ("text", "kind", "plain"),
    [
        ("18446744073709551", np.uint64, True),
        ("9223372036854775808", np.uint64, True),
        ("9223372036854775808", np.int64, False),
        ("-9223372036854775808", np.int64, True),
        ("-9223372036854775809", np.int64, False),
        ("-1", np.uint64, False),
        ("1.0", np.int64, False),
        ("1e3", np.int64, False),
        ("nan", np.int64, False),
    ],
)
def test_a_whole_number_has_its_limits(text, kind, plain):
    column, told = one([text], kind)
    assert told[0] == plain
    assert not plain or column[0] == int(text)


def test_each_line_has_as_many_cells_as_columns():
    rows = ["1, 2.5, -3", "1, 2.5", "1, 2.5, -3, 4", "x, 1, 1", "", "7,8,9"]
    columns, plain = read(rows, [np.uint64, np.float64, np.int64])
    assert plain.tolist() == [True, False, False, False, False, True]
    assert [column[plain].tolist() for column in columns] == [[1, 7], [2.5, 8.0], [-3, 9]]


def test_many_lines_are_shared_among_threads():
    values = np.random.default_rng(0).normal(size=20_000)
    column, plain = one([repr(value) for value in values.tolist()], np.float64)
    assert plain.all()
    assert_array_equal(column, values)
