"""``attest fleet`` as a person or a script meets it."""

import csv
import json
import subprocess
import sys
from itertools import islice

import pytest
import summaries

HEAD = 300
"""Lines of the sample flight that make a short log."""


def attest(*arguments, command="fleet"):
    call = [sys.executable, "-m", "attest", command, *map(str, arguments)]
    return subprocess.run(call, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    rows = summaries.steady(30)
    for row in rows[15:]:
        row["hard_iron_x_ut"] += 9.0
    rows[3]["field_ut_median"] = 120.0
    rows[0]["status"] = "failed"
    return summaries.write(tmp_path_factory.mktemp("moved"), rows + summaries.steady(12, "two"))


def test_it_tells_what_changed_first(moved, tmp_path):
    found = attest(moved, moved / "summary.csv", "--output", tmp_path)
    assert (found.returncode, found.stderr) == (0, "")
    lines = found.stdout.splitlines()
    assert lines[:5] == [
        "2 vehicles, 41 flights  fts",
        "  from        2026-01-01 to 2026-01-30",
        "  rows        41 used; left out 2 that did not end well, 41 of a log and observer that "
        "are there twice",
        "  unsure      41 rows by firmware, board or system id, which several vehicles may share "
        "(--by folder keeps folders apart)",
        "  judged      16 series of 10 flights or more",
    ]
    changes = lines[lines.index("  changes") + 1 :]
    titles = "vehicle observer figure when from to deviations chance"
    assert " ".join(changes[0].split()) == titles
    assert changes[1].split()[:6] == ["one", "fts", "hard", "iron", "x", "2026-01-16"]
    odd = lines[lines.index("  odd flights") + 2]
    assert odd.split()[:5] == ["one", "2026-01-04", "0003.BIN", "field/model", "244.9"]
    assert lines[-1] == f"  written     {tmp_path}/  fleet.html fleet.csv"
    assert (tmp_path / "fleet.html").exists()


def test_names_that_would_command_the_terminal_are_spelt_out(tmp_path):
    rows = summaries.steady(12, "a\x1b]0;pwned\x07b")
    for row in rows:
        row["observer"] = "f\x1b[2Jts"
    found = attest(summaries.write(tmp_path / "odd", rows), "--output", tmp_path / "out")
    assert found.returncode == 0
    assert "\x1b" not in found.stdout
    assert "a\\x1b]0;pwned\\x07b" in found.stdout
    assert "f\\x1b[2Jts" in found.stdout


def test_json_is_the_document(moved, tmp_path):
    found = attest(moved, "--json", "--until", "2026-01-12", "--output", tmp_path)
    document = json.loads(found.stdout)
    assert document["schema"] == 1
    assert document["last_utc"] == "2026-01-12T12:00:00+00:00"
    assert {one["vehicle"]: one["flights"] for one in document["vehicles"]} == {
        "one": 11,
        "two": 12,
    }


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ((), 2, "Missing argument 'SUMMARY...'. See `attest fleet -h`."),
        (("no/such",), 1, "no/such: no such file. Name a summary of `attest batch`."),
        (("FOLDER", "-o", "vae"), 2, "--observer vae: not in the summaries. They have: fts."),
        (("FOLDER", "--since", "soon"), 2, "'soon' does not match the format '%Y-%m-%d'."),
        (
            ("FOLDER", "--since", "2027-01-01"),
            1,
            "FOLDER: no row with a figure that can be used (42 read, 1 not ok, 41 of other days). "
            "Name other summaries, or choose less.",
        ),
    ],
)
def test_what_cannot_be_done_is_one_line(moved, tmp_path, arguments, code, words):
    given = [str(moved) if argument == "FOLDER" else argument for argument in arguments]
    found = attest(*given, "--output", tmp_path / "out")
    assert (found.returncode, found.stdout) == (code, "")
    assert words.replace("FOLDER", str(moved)) in found.stderr.replace("python -m attest", "attest")
    assert len(found.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def later(sample, path, days, stronger):
    """Write the beginning of a flight so many days later, in a field that is so much stronger."""
    with sample.open(newline="") as file, path.open("w", newline="") as out:
        rows = csv.DictReader(file)
        written = csv.DictWriter(out, rows.fieldnames)
        written.writeheader()
        for row in islice(rows, HEAD):
            seconds, _, rest = row["time_s"].partition(".")
            row["time_s"] = f"{int(seconds) + 86400 * days}.{rest}"
            if row["mag_x"]:
                row |= {key: stronger * float(row[key]) for key in ("mag_x", "mag_y", "mag_z")}
            written.writerow(row)


def test_batch_of_flights_whose_field_changes_is_flagged(tmp_path, sample_logs):
    (tmp_path / "logs").mkdir()
    for i in range(14):
        stronger = 1.0 + 0.001 * (i % 3) + 0.2 * (i >= 7)
        path = tmp_path / "logs" / f"{99 - i}.csv"
        later(sample_logs / "quadcopter.csv", path, i, stronger)
    quick = ("-o", "paper/cgo", "--write", "json", "--jobs", "1")
    done = attest(tmp_path / "logs", "--output", tmp_path / "out", *quick, command="batch")
    assert done.returncode == 0, done.stderr
    found = attest(tmp_path / "out", "--json", "--output", tmp_path)
    document = json.loads(found.stdout)
    flagged = [one for one in document["series"] if one["changes"]]
    assert [one["figure"] for one in flagged] == ["field/model"]
    (step,) = flagged[0]["changes"]
    assert step["by_utc"][:10] == "2026-05-08"
    assert step["after"] == pytest.approx(1.2 * step["before"], rel=0.02)
    assert document["vehicles"][0]["vehicle"] == f"folder {tmp_path / 'logs'}"
