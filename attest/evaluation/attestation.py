"""What every observer's theory promises, against what was seen in a run.

[BarShalom01]  Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with applications to tracking
               and navigation", 2001, 5.4: the normalised estimation error squared.
"""

import numpy as np
from numpy.typing import NDArray

from attest.claims import Claim
from attest.config import Configuration
from attest.estimates import Estimates
from attest.evaluation import errors
from attest.geometry import directions, quaternion
from attest.metrics import Metrics
from attest.samples import Samples

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Growth of a Lyapunov function, in units of its start, that is none."""
STAYED = 0.1
"""Share of a run after settling from which staying there can be told."""
CHUNK = 1 << 16
WITHIN = 7.815
"""95 % of chi-squared of three are below this."""
ENOUGH = 0.9
"""Share of the errors within that; they follow each other in time, so 95 % come out roughly."""
LARGER, SMALLER = 1.5, 6.0
"""Means of chi-squared of three, half and twice its own, beyond which a covariance is off."""


def attest(
    samples: Samples,
    estimates: Estimates,
    metrics: Metrics | None,
    config: Configuration,
    *,
    whole: bool = False,
) -> tuple[Claim, ...]:
    """Say whether what all observers are promised came out: SO(3), V, settling, conditioning.

    One that looks at the ``whole`` log at once needs no two directions at each step.
    """
    return (
        _rotations(estimates.q),
        *_gains(config),
        _observable(samples, whole=whole),
        *_lyapunov(estimates, samples.restart),
        *_settling(metrics),
        *_consistent(samples, estimates, metrics),
    )


def _rotations(q: Array) -> Claim:
    """Take the worst |R^T R - I| (largest entry); nothing is projected after the fact."""
    worst = 0.0
    for begin in range(0, len(q), CHUNK):
        R = quaternion.to_matrix(q[begin : begin + CHUNK])
        off = np.swapaxes(R, -1, -2) @ R - np.eye(3)
        worst = float(np.max([worst, np.abs(off).max(initial=0.0)]))  # NaN stays NaN
    return Claim(
        statement="every estimate is a rotation",
        source="SO(3)",
        seen=f"largest entry of |RᵀR - I| is {worst:.2g}",
        holds=worst < 1e-9,
        value=worst,
        bound=1e-9,
    )


def _gains(config: Configuration) -> tuple[Claim, ...]:
    """Say which theorem's conditions the configuration was checked against."""
    theorem = getattr(getattr(config, "gains", None), "theorem", "")
    if "Theorem" not in theorem:
        return ()
    return (
        Claim(
            statement="gains and weights are in the range that the theory allows",
            source=theorem.strip("[]"),
            seen="checked when the configuration was read",
            holds=True,
        ),
    )


def _observable(samples: Samples, *, whole: bool) -> Claim:
    """Say how many independent directions there were, and how well they tell the attitude."""
    found = np.zeros((len(samples.t), 2))
    if samples.names:
        directions.independent(samples.inertial, samples.body, samples.valid, found)
    return _directions(found, whole=whole)


def _directions(found: Array, *, whole: bool) -> Claim:
    count, angle = found[:, 0], np.rad2deg(found[:, 1])
    shares = [float(np.mean(count == number)) for number in (2, 1, 0)]
    words = [f"two directions or more in {shares[0]:.1%} of the steps"]
    if shares[0]:
        least, median = np.nanmin(angle), np.nanmedian(angle)
        words[0] += f", {median:.0f}° apart ({least:.0f}° at the least)"
    if shares[1]:
        words.append(f"one in {shares[1]:.1%}: the turn about it is not observable then")
    if shares[2]:
        words.append(f"none in {shares[2]:.1%}: the rate alone carries it")
    where = "in the log" if whole else "at each step"
    return Claim(
        statement=f"two independent directions tell the attitude {where}",
        source="rank E = 3",
        seen="; ".join(words),
        holds=shares[0] > 0.0 if whole else shares[0] == 1.0,
        value=shares[0],
        bound=None if whole else 1.0,
    )


def _lyapunov(estimates: Estimates, restart: NDArray[np.bool_]) -> tuple[Claim, ...]:
    """Compare V with itself one step before; only without noise is it promised to fall."""
    V = estimates.lyapunov
    if V is None or restart[1:].all():
        return ()
    growth = np.diff(V)[~restart[1:]]
    worst, share = float(growth.max()), float(np.mean(growth > ROUNDING * V[0]))
    fell = share == 0.0
    seen = (
        f"from {V[0]:.3g} to {V[-1]:.3g}, never up"
        if fell
        else f"from {V[0]:.3g} to {V[-1]:.3g}, up in {share:.0%} of the steps, by {worst:.2g} at "
        "most: with noise no more is promised"
    )
    return (
        Claim(
            statement="the Lyapunov function never grows without noise",
            source="Lyapunov function of the paper, with the true bias",
            seen=seen,
            holds=True if fell else None,
            value=worst,
            bound=ROUNDING * float(V[0]),
        ),
    )


def _settling(metrics: Metrics | None) -> tuple[Claim, ...]:
    if metrics is None:
        return ()
    settled, bound = metrics.settling_time_s, metrics.settling_bound_deg
    below = metrics.error_deg[:, 0] >= bound
    left = 1.0 - float(np.flatnonzero(below)[-1] + 1) / len(below) if below.any() else 1.0
    seen = "not to the end" if settled is None else f"after {settled:.2f} s"
    if settled is not None and left < STAYED:
        seen += f", and {left:.0%} of the run is left to tell"
    return (
        Claim(
            statement=f"the error settles below {bound:g}° and stays there",
            source=f"convergence, against {metrics.reference}",
            seen=seen,
            holds=None if settled is not None and left < STAYED else settled is not None,
            value=settled,
        ),
    )


def _consistent(
    samples: Samples, estimates: Estimates, metrics: Metrics | None
) -> tuple[Claim, ...]:
    """Compare the error with the covariance that came with the estimate, [BarShalom01, 5.4].

    That is open where the estimate's north is magnetic, and may be none of the truth's.
    """
    P = estimates.states.get("attitude_covariance")
    if metrics is None or metrics.kind != "truth" or P is None:
        return ()
    scored = np.isfinite(metrics.error_deg[:, 0])
    q_e = errors.attitude_error(estimates.q[scored], metrics.q_ref[scored])
    found = normalised(quaternion.log(q_e), P[scored])
    mean, inside = float(np.mean(found)), float(np.mean(found < WITHIN))
    holds, seen = inside >= ENOUGH, f"{inside:.1%} are; the mean of eᵀP⁻¹e is {mean:.2g}"
    seen += f", and 3 where the covariance is exact: it is {_size(mean)}"
    untold = not holds and "mag" in samples.names and samples.field is None
    if untold:
        seen += ", or the truth's north is another than the magnetic one"
    return (
        Claim(
            statement="95 % of the errors are within what the covariance says",
            source=f"normalised error squared, against {metrics.reference}",
            seen=seen,
            holds=None if untold else holds,
            value=inside,
            bound=ENOUGH,
        ),
    )


def _size(mean: float) -> str:
    """Say whether a covariance with this mean of e^T P^-1 e is too large or too small."""
    if mean < LARGER:
        return "larger than need be"
    return "too small" if mean > SMALLER else "about right"


def normalised(theta: Array, P: Array) -> Array:
    """Return theta^T P^-1 theta of errors (n, 3), rad, and P (n, 6) by rows of the upper half."""
    full = P[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    weighed = np.linalg.solve(full, theta[..., np.newaxis])[..., 0]
    squared: Array = np.sum(theta * weighed, axis=1)
    return squared
