import json
from dataclasses import replace

import numpy as np
import pytest

from attest import reproduction
from attest.claims import Claim
from attest.errors import ConfigError
from attest.reproduction import experiment, table


@pytest.fixture(scope="module")
def reproduced():
    made = {}

    def get(name, seeds):
        if (name, seeds) not in made:
            made[name, seeds] = reproduction.reproduce(name, seeds)
        return made[name, seeds]

    return get


def verdicts(done):
    return {claim.statement: claim.holds for claim in done.claims}


def claim(done, words):
    (found,) = [claim for claim in done.claims if words in claim.statement]
    return found


def test_without_noise_the_paper_is_right(reproduced):
    done = reproduced("fts-7.1", 1)
    assert set(verdicts(done).values()) == {True}
    assert claim(done, "finite time").value < 20.0


@pytest.mark.slow
def test_in_high_noise_the_four_are_alike_in_the_end(reproduced):
    done = reproduced("fts-7.2-high", 50)
    assert done.seeds == 50
    assert claim(done, "no remarkable difference").holds
    assert claim(done, "settles as quickly").holds


@pytest.mark.slow
def test_in_low_noise_what_comes_out_is_said_and_what_does_not_too(reproduced):
    done = reproduced("fts-7.2-low", 50)
    tuned = {each.statement.split("case I, ")[-1]: each for each in done.claims}
    assert tuned["with the noise per sample, Q_b = 0"].value >= 3.0
    assert claim(done, "as intensities").holds is False
    assert claim(done, "FTS and VAE filter").holds
    assert claim(done, "CGO does not converge").holds is False
    assert claim(done, "GAME becomes singular").holds is False


def test_the_variational_experiment_ends_in_its_neighbourhood(reproduced):
    assert set(verdicts(reproduced("vae-6", 3)).values()) == {True}


def test_the_relative_experiment_ends_at_the_lag_of_its_filter(reproduced):
    done = reproduced("rel-4", 3)
    assert claim(done, "below 0.3°").holds
    assert claim(done, "converges to zero").holds is False
    assert claim(done, "depends on the noise's level").holds


def test_the_disturbance_experiment_follows_the_disturbance(reproduced):
    done = reproduced("eso-6", 3)
    assert set(verdicts(done).values()) == {True}
    assert claim(done, "without noise the attitude error converges").value < 0.05
    assert claim(done, "disturbance is followed").value == pytest.approx(0.0144, abs=5e-4)


@pytest.mark.parametrize("name", ["fts-7.1", "vae-6", "rel-4", "eso-6"])
def test_figures_and_tables_are_written(reproduced, tmp_path, name):
    done = reproduced(name, 1 if name == "fts-7.1" else 3)
    written = list(reproduction.write(done, tmp_path))
    figures = [path for path in written if path.suffix == ".png"]
    assert [path.stem for path in figures] == list(done.panels)
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in figures)
    document = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
    assert [each["holds"] for each in document["claims"]] == [c.holds for c in done.claims]
    page = (tmp_path / f"{name}.md").read_text(encoding="utf-8")
    assert all(each.statement.replace("|", "\\|") in page for each in done.claims)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(p.name for p in written)


def test_the_same_seeds_give_the_same_table(reproduced):
    again = reproduction.reproduce("rel-4", 3)
    assert table.markdown(again) == table.markdown(reproduced("rel-4", 3))


def test_a_claim_that_fails_is_shown_as_that(reproduced):
    failed = Claim(statement="a|b", source="nowhere", seen="no", holds=False)
    still_open = Claim(statement="who knows", source="nowhere", seen="-", holds=None)
    done = replace(reproduced("fts-7.1", 1), claims=(failed, still_open))
    assert "| a\\|b | nowhere | **no** | no |" in table.markdown(done)
    assert "| who knows | nowhere | open | - |" in table.markdown(done)
    assert "   NO   a|b [nowhere]" in reproduction.text(done)


def test_an_unknown_experiment_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"^fts-8: unknown experiment\. Choose one of: fts-7\.1,"):
        reproduction.reproduce("fts-8")


def test_settling_is_the_last_time_that_the_error_is_above():
    t = np.arange(5.0)
    assert experiment.stays_below(t, np.array([9.0, 1.0, 9.0, 1.0, 1.0]), 5.0) == 3.0
    assert experiment.stays_below(t, np.array([9.0, 1.0, 1.0, 1.0, 9.0]), 5.0) is None
    assert experiment.stays_below(t, np.zeros(5), 5.0) == 0.0
