"""A short run of the fuzzer; `CONTRIBUTING.md` tells how to make a long one."""

import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="bounds are those of Linux")
CASES = 200


@pytest.mark.parametrize("reader", ["tlog", "dataflash", "ulog", "csv", "ros"])
def test_damaged_logs_are_read_or_refused_in_one_line(reader, tmp_path):
    import fuzz

    fuzz.warm(reader, tmp_path)
    outcomes = {number: fuzz.check(reader, number, tmp_path / "log") for number in range(CASES)}
    bad = {number: what for number, what in outcomes.items() if what not in {"read", "refused"}}
    assert not bad, "\n".join(f"--reader {reader} --case {n}\n{what}" for n, what in bad.items())
    assert 0.2 * CASES < sum(what == "read" for what in outcomes.values()) < CASES


def test_a_case_is_the_same_file_each_time():
    import fuzz

    assert fuzz.mutated("tlog", 7) == fuzz.mutated("tlog", 7) != fuzz.mutated("tlog", 8)
    assert fuzz.mutated("tlog", 7) not in fuzz.seeds("tlog")


def allocates(*_):
    return bytes(400 << 20)


def turns_forever(*_):
    while True:
        pass


@pytest.mark.parametrize(("fault", "words"), [
    (allocates, "MemoryError"),
    (turns_forever, "Excess: over 1 s"),
])  # fmt: skip
def test_the_bounds_hold(monkeypatch, tmp_path, fault, words):
    import fuzz

    monkeypatch.setattr(fuzz, "TIMEOUT", 1)
    monkeypatch.setattr(fuzz, "attempt", fault)
    assert words in fuzz.check("tlog", 0, tmp_path / "log")
