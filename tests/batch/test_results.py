"""Summary and page: what hostile names and errors become in them."""

import csv
import re
import sys
from html.parser import HTMLParser

import pyarrow.parquet
import pytest

from attest import batch
from attest.batch.page import MOST

EVIL = '<script>alert("1")</script>'


def row(path, observer="fts", status="ok", **more):
    return {
        "path": path,
        "observer": observer,
        "status": status,
        "error": None,
        "folder": path.strip("/"),
        "outputs": [f"{observer}.mcap", f"{observer}.json"] if status == "ok" else [],
    } | more


@pytest.fixture
def written(tmp_path):
    def write(*rows):
        with batch.Journal(tmp_path) as journal:
            journal.append(rows)
            batch.write_results(journal, tmp_path)
        return tmp_path

    return write


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


@pytest.mark.parametrize("name", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1"])
def test_name_that_a_spreadsheet_would_run_is_text(written, name):
    folder = written(row(name, error=name, gyro_bias_x=-1.5))
    with (folder / "summary.csv").open(newline="", encoding="utf-8") as file:
        (found,) = csv.DictReader(file)
    assert found["path"] == found["error"] == f"'{name}"
    assert found["gyro_bias_x"] == "-1.5"
    assert pyarrow.parquet.read_table(folder / "summary.parquet").to_pylist()[0]["path"] == name


@pytest.mark.skipif(sys.platform == "win32", reason="names are text there")
def test_names_that_are_not_utf8_are_spelt_out(written):
    folder = written(row("/l/\udcff\n\u2603.tlog"))
    assert "/l/\\udcff\n☃.tlog" in (folder / "summary.csv").read_text(encoding="utf-8")
    assert "./l/%FF%0A%E2%98%83.tlog/fts.json" in (folder / "index.html").read_text("utf-8")


def test_page_runs_nothing_of_a_log_and_loads_nothing(written):
    evil = row(f"/l/{EVIL}", vehicle=EVIL, warnings=EVIL, reference=EVIL, total_rmse_deg=1.0)
    folder = written(evil, row("/l/b", EVIL, "failed", error=EVIL), row('/l/" onload="x'))
    text = (folder / "index.html").read_text(encoding="utf-8")
    page = Reader(text)
    assert page.tags.count("script") == 1
    assert EVIL not in text
    assert "default-src 'none'" in text
    assert all(re.match(r"\./|summary\.", link) for link in page.links)
    assert "onload" not in page.attributes


def test_page_has_failures_first_then_the_worst(written):
    folder = written(
        row("/l/good", total_rmse_deg=1.0),
        row("/l/none"),
        row("/l/bad", total_rmse_deg=50.0),
        row("/l/broken", status="crashed"),
    )
    text = (folder / "index.html").read_text(encoding="utf-8")
    assert re.findall(r'class="path" data-v="(\w+)"', text) == ["broken", "bad", "good", "none"]
    assert text.count("<svg") == 1


def test_page_has_no_more_rows_than_a_browser_sorts(written):
    folder = written(*(row(f"/l/{i:04d}", total_rmse_deg=float(i)) for i in range(MOST + 10)))
    text = (folder / "index.html").read_text(encoding="utf-8")
    assert text.count("<tr>") == MOST + 1
    assert "0009" not in re.findall(r'data-v="(\d{4})"', text)
    assert f"{MOST:,} of {MOST + 10:,}" in text


def test_nothing_at_all_is_an_empty_summary(written):
    folder = written()
    assert len((folder / "summary.csv").read_text().splitlines()) == 1
    assert pyarrow.parquet.read_table(folder / "summary.parquet").num_rows == 0


def test_same_rows_in_another_order_are_the_same_bytes(tmp_path):
    rows = [row(f"/l/{i}", observer, total_rmse_deg=i * 1.5) for i in range(9) for observer in "ab"]
    found = []
    for name, order in (("one", rows), ("other", rows[::-1])):
        with batch.Journal(tmp_path / name) as journal:
            journal.append(order)
            found.append([path.read_bytes() for path in batch.write_results(journal, tmp_path)])
    assert found[0] == found[1]
