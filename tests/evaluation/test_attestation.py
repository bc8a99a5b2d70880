from dataclasses import replace

import numpy as np
import pytest
from flights import samples
from scipy.stats import chi2

from attest import evaluation
from attest.config import Evaluation
from attest.estimates import Estimates
from attest.geometry import quaternion
from attest.observers import fts
from attest.recording import Reference

N = 200
T = np.arange(N) * 10_000_000
IDENTITY = np.tile([1.0, 0.0, 0.0, 0.0], (N, 1))


def seen(directions):
    """Return samples at rest that see these directions."""
    inertial = np.asarray(directions, float).reshape(-1, 3)
    body = np.broadcast_to(inertial, (N, *inertial.shape)).copy()
    return samples(T, np.zeros((N, 3)), body, inertial[np.newaxis])


def estimated(q=IDENTITY, **other):
    return Estimates(
        observer="fts",
        t=T,
        q=q,
        angular_velocity=np.zeros((N, 3)),
        gyro_bias=np.zeros((N, 3)),
        s_norm=np.zeros(N),
        cost=np.zeros(N),
        updated=np.ones((N, 2), np.bool_),
        **other,
    )


def attested(given, found, metrics=None):
    return evaluation.attest(given, found, metrics, fts.Config())


def claim(claims, words):
    (found,) = [claim for claim in claims if words in claim.statement]
    return found


TWO = [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]]


def test_rotations_are_told_from_what_is_none():
    assert claim(attested(seen(TWO), estimated()), "rotation").value == 0.0
    off = claim(attested(seen(TWO), estimated(1.001 * IDENTITY)), "rotation")
    tilted = IDENTITY * 1.001
    tilted[:, 1] = 0.1
    off = claim(attested(seen(TWO), estimated(tilted)), "rotation")
    assert off.holds is False
    assert off.value > 1e-5


def test_gains_name_their_theorem():
    assert claim(attested(seen(TWO), estimated()), "gains").source == "FTS, Theorem 1"


def test_two_directions_tell_the_attitude_and_how_far_apart_they_are():
    found = claim(attested(seen(TWO), estimated()), "two independent")
    assert found.holds
    assert (
        found.seen == "two directions or more in 100.0% of the steps, 37° apart (37° at the least)"
    )


def test_one_direction_leaves_the_turn_about_it_open_and_none_leaves_all():
    given = seen(TWO)
    valid = given.valid.copy()
    valid[:50, 1] = False
    valid[:20] = False
    found = claim(attested(replace(given, valid=valid), estimated()), "two independent")
    assert found.holds is False
    assert found.seen == (
        "two directions or more in 75.0% of the steps, 37° apart (37° at the least); one in 15.0%: "
        "the turn about it is not observable then; none in 10.0%: the rate alone carries it"
    )
    nothing = seen(np.empty((0, 3)))
    assert "none in 100.0%" in claim(attested(nothing, estimated()), "two independent").seen


def test_directions_within_six_degrees_count_as_one():
    near = [[0.0, 0.0, 1.0], [np.sin(0.05), 0.0, np.cos(0.05)]]
    assert "one in 100.0%" in claim(attested(seen(near), estimated()), "two independent").seen


def test_a_falling_lyapunov_function_holds_and_a_noisy_one_is_open():
    falling = np.exp(-np.arange(N) / 10.0)
    found = claim(attested(seen(TWO), estimated(lyapunov=falling)), "Lyapunov")
    assert found.holds
    noisy = falling + 0.01 * (np.arange(N) % 2)
    found = claim(attested(seen(TWO), estimated(lyapunov=noisy)), "Lyapunov")
    assert found.holds is None
    assert "with noise no more is promised" in found.seen
    without = attested(seen(TWO), estimated())
    assert not [each for each in without if "Lyapunov" in each.statement]


@pytest.mark.parametrize("settles", [True, False])
def test_settling_is_a_promise_too(settles):
    angle = np.where(np.arange(N) < (50 if settles else N), 0.5, 0.0)
    q = np.stack([np.cos(angle / 2), np.sin(angle / 2), np.zeros(N), np.zeros(N)], axis=1)
    reference = Reference("TRUTH", "truth", T, IDENTITY)
    metrics, _ = evaluation.evaluate(seen(TWO), estimated(q), reference, Evaluation())
    found = claim(attested(seen(TWO), estimated(q), metrics), "settles below 5°")
    assert found.holds is settles
    assert found.seen == ("after 0.50 s" if settles else "not to the end")


def test_the_noise_bound_of_the_corollary_is_that_of_its_inequality():
    rng = np.random.default_rng(3)
    given = replace(seen(TWO), gyro=0.01 * rng.standard_normal((N, 3)))
    config = fts.Config()
    (bounded,) = fts.promises(given, estimated(), config)
    epsilon, g = 3.0 * 0.01 * np.sqrt(3.0), config.gains
    # V' = 0 at P = 0: k_p kappa S^(2/p) = k_p S epsilon
    S = bounded.bound
    assert g.kappa * S ** (2.0 / g.p) == pytest.approx(S * epsilon, rel=0.15)
    assert bounded.holds
    (broken,) = fts.promises(given, replace(estimated(), s_norm=np.full(N, 2.0 * S)), config)
    assert broken.holds is False


@pytest.mark.parametrize(
    ("believed", "holds", "size"),
    [
        (1.0, True, "about right"),
        (0.3, False, "too small"),
        (0.6, False, "too small"),
        (5.0, True, "larger than need be"),
    ],
)
def test_the_covariance_is_compared_with_the_error(believed, holds, size):
    rng = np.random.default_rng(3)
    sigma = 0.02 * np.array([1.0, 2.0, 3.0])
    q = quaternion.exp(sigma * rng.normal(size=(N, 3)))
    P = np.zeros((N, 6))
    P[:, [0, 3, 5]] = (believed * sigma) ** 2
    found = estimated(q, states={"attitude_covariance": P})
    given = seen(np.eye(3))
    truth = Reference("TRUTH", "truth", T, IDENTITY)
    metrics, _ = evaluation.evaluate(given, found, truth, Evaluation())
    told = claim(attested(given, found, metrics), "covariance")
    assert told.holds is holds
    share = chi2(3).cdf(7.815 * believed**2)
    assert told.value == pytest.approx(share, abs=0.05)
    assert told.seen.startswith(f"{told.value:.1%} are; the mean of eᵀP⁻¹e is ")
    assert told.seen.endswith(f", and 3 where the covariance is exact: it is {size}")
    autopilot, _ = evaluation.evaluate(given, found, replace(truth, kind="autopilot"), Evaluation())
    assert not any("covariance" in c.statement for c in attested(given, found, autopilot))


def test_a_whole_log_needs_no_two_directions_at_each_step():
    given = seen(TWO)
    given.valid[: N // 2, 1] = False
    found = estimated()
    stepped = claim(attested(given, found), "directions")
    whole = claim(evaluation.attest(given, found, None, fts.Config(), whole=True), "directions")
    assert (stepped.statement[-12:], stepped.holds, stepped.bound) == ("at each step", False, 1.0)
    assert (whole.statement[-10:], whole.holds, whole.bound) == ("in the log", True, None)
    given.valid[:, 1] = False
    none = claim(evaluation.attest(given, found, None, fts.Config(), whole=True), "directions")
    assert none.holds is False
