"""What a fleet looks like, and that a name does nothing."""

import csv
import re
from html.parser import HTMLParser

import pytest
import summaries

from attest import fleet
from attest.fleet import Choice, drawing, page

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


def texts(svg, kind):
    """Return place and words of each text of a kind."""
    found = re.findall(rf'<text class="{kind}" x="([^"]*)" y="([^"]*)">([^<]*)<', svg)
    return [(float(x), float(y), words) for x, y, words in found]


def test_flight_beyond_the_axis_is_an_arrow_with_its_value(written):
    rows = summaries.steady(60, "one")
    rows[17]["total_rmse_deg"] = 36.4
    _, document = written(rows)
    svg = drawing.drawing(next(x for x in document["series"] if x["figure"] == "total RMSE"))
    assert max(float(tick) for tick in re.findall(r'"end">([\d.]+)<', svg)) < 10
    ((_, _, words),) = texts(svg, "far")
    assert words == "36.40"
    assert svg.count('<path class="flight"') == 1
    assert svg.count('<circle class="flight"') == 59
    assert "<title>2026-01-18: 36.40 °</title></path>" in svg


def test_values_and_dates_do_not_lie_upon_each_other(written):
    rows = summaries.steady(300, "one")
    for i, row in enumerate(rows):
        row["hard_iron_x_ut"] += 30.0 * (i >= 100) + 40.0 * (i >= 115) - 60.0 * (i >= 290)
        row["field_ut_median"] += 60.0 * (i in {3, 8, 200})
    _, document = written(rows)
    series = {one["figure"]: one for one in document["series"]}
    svg, other = (drawing.drawing(series[name]) for name in ("hard iron x", "field/model"))
    steps = series["hard iron x"]["changes"]
    dates = texts(svg, "date")
    assert [words for *_, words in dates] == [step["by_utc"][:10] for step in steps]
    assert len(dates) == 3
    assert dates[0][1] != dates[1][1]
    assert max(x + drawing.CHARACTER * len(words) for x, _, words in dates) < drawing.WIDTH
    points = [float(y) for y in re.findall(r'<circle[^>]*cy="([^"]*)"', svg)]
    assert min(points) > max(y for _, y, _ in dates)
    assert other.count('<path class="flight"') == 3
    assert len(texts(other, "far")) == 2


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
