import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from results import result

from attest.writers.json import plain, write_json


def test_json_is_the_summary(tmp_path):
    path = tmp_path / "fts.json"
    made = result(20)
    write_json(path, made.summary)
    text = path.read_bytes().decode("utf-8")
    read = json.loads(text)
    assert read["schema"] == 1
    assert read["metrics"]["total"]["rmse_deg"] == made.metrics.total.rmse
    assert read["metrics"]["dip"] is None
    assert text.endswith("}\n")
    assert list(read) == sorted(read)


def test_equal_summaries_give_equal_bytes_whatever_their_order(tmp_path):
    made = result(20)
    turned = replace(made, summary=dict(reversed(made.summary.items())))
    write_json(tmp_path / "a.json", made.summary)
    write_json(tmp_path / "b.json", turned.summary)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_names_outside_utf8_are_escaped(tmp_path):
    path = tmp_path / "fts.json"
    write_json(path, {"path": "\udcff µ"})
    assert json.loads(path.read_text("utf-8")) == {"path": "\udcff µ"}
    assert "µ".encode() in path.read_bytes()


def test_plain_turns_what_json_does_not_know():
    value = {"a": (np.float64(1.5), np.int64(2)), "b": np.array([1.0, np.inf]), 3: Path("x")}
    assert plain(value) == {"a": [1.5, 2], "b": [1.0, None], "3": "x"}
    assert plain(np.array(3.0)) == 3.0
