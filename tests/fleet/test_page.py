"""What a fleet looks like, and that a name does nothing."""

import csv
import re
from html.parser import HTMLParser

import pytest
import summaries

from attest import fleet
from attest.fleet import Choice, page

EVIL = '<script>alert("1")</script>'


class Reader(HTMLParser):
    """What a browser makes of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.links, self.attributes = [], [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes |= {key for key, _ in attributes}
        self.links += [value for key, value in attributes if key in {"href", "src"}]


@pytest.fixture
def written(tmp_path):
    def write(rows):
        document = fleet.fleet([summaries.write(tmp_path, rows)], Choice())
        fleet.write_results(document, tmp_path / "out")
        return (tmp_path / "out" / "fleet.html").read_text(encoding="utf-8"), document

    return write


def moved(vehicle, **more):
    """Return rows with a step, and an odd flight."""
    rows = summaries.steady(30, vehicle, **more)
    for row in rows[15:]:
        row["hard_iron_x_ut"] += 9.0
    rows[3]["field_ut_median"] = 120.0
    return rows


def test_page_runs_nothing_of_a_summary_and_loads_nothing(written):
    rows = moved(EVIL, reference=f'{EVIL}" onload="x', observer=f"{EVIL}'")
    rows[3]["path"] = f'/x/{EVIL}" onload="y'
    text, _ = written(rows)
    found = Reader(text)
    assert found.tags.count("script") == 1
    assert EVIL not in text
    assert "default-src 'none'" in text
    assert found.links == ["fleet.csv"]
    assert "onload" not in found.attributes


def test_flagged_series_are_drawn_with_their_dates(written):
    text, document = written(moved("one") + summaries.steady(30, "two"))
    flagged = [one for one in document["series"] if one["changes"] or one["odd"]]
    assert {one["figure"] for one in flagged} >= {"hard iron x", "field/model"}
    assert text.count("<svg") == len(flagged)
    assert re.findall(r'class="date"[^>]*>([^<]*)<', text)[0] == "2026-01-16"
    assert text.count('class="odd"') == sum(len(one["odd"]) for one in flagged)
    assert text.index("<h2>Changes") < text.index("<h2>Medians") < text.index("<h2>Every series")
    assert text.index('<td data-v="one">') < text.index('<td data-v="two">')


def test_page_has_no_more_than_a_browser_shows(written, monkeypatch):
    monkeypatch.setattr(page, "MOST", 3)
    monkeypatch.setattr(page, "MOST_DRAWN", 1)
    text, _ = written([row for name in "abcde" for row in moved(name)])
    assert text.count("<svg") == 2
    assert ", 1 of 5</h2>" in text
    assert ", 3 of 5</h2>" in text


def test_name_that_a_spreadsheet_would_run_is_text(tmp_path):
    document = fleet.fleet([summaries.write(tmp_path, moved("=1+1"))], Choice())
    fleet.write_results(document, tmp_path)
    with (tmp_path / "fleet.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["vehicle"] for row in rows} == {"'=1+1"}
    assert rows[0]["figure"] == "hard iron x"
    assert rows[0]["latest_change"] == "2026-01-16T12:00:00+00:00"


def test_same_rows_are_the_same_bytes(tmp_path):
    found = []
    for order in (1, -1):
        rows = (moved("one") + moved("two"))[::order]
        document = fleet.fleet([summaries.write(tmp_path, rows)], Choice())
        found.append([path.read_bytes() for path in fleet.write_results(document, tmp_path)])
    assert found[0] == found[1]
