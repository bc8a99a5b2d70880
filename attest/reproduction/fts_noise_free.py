"""[FTS] section 7.1: finite-time convergence without noise.

[FTS]  A. K. Sanyal, R. R. Warier, R. Hamrah, "Finite time stable attitude and angular velocity bias
       estimation for rigid bodies with unknown dynamics".
"""

from collections.abc import Iterable

import numpy as np

from attest import simulation
from attest.claims import Claim
from attest.reproduction.experiment import (
    REGRESSION,
    Array,
    Experiment,
    Panel,
    after,
    at_most,
    attitude_error,
    bias_error,
    components,
    configure,
    energy,
    run,
    samples,
    seconds,
    start,
    stays_below,
)

GAINS = {"k_p": 2.0, "k_v": 1.0, "kappa": 0.1, "mu": 0.35, "p": 1.1, "k_b": None}
"""Section 7.1; k_b null is the paper's 2 - mu."""
WEIGHTS = {"k": [3.0, 2.0, 1.0]}
ROUNDING = 1e-12
"""Growth of V in a step that is none."""
ARRIVED = 1e-6
"""Degrees: what counts as zero error."""


def reproduce(_seeds: Iterable[int]) -> Experiment:
    """Run it; nothing is random."""
    flight = simulation.simulate("fts-7.1")
    configuration = configure("fts", {"gains": GAINS, "weights": WEIGHTS, "initial": start(flight)})
    found = run(samples(flight), configuration)
    t, error = seconds(flight), attitude_error(found.q, flight)
    beta_tilde = bias_error(found, flight)
    V = energy(found, configuration, flight)
    omega = flight.omega - found.angular_velocity
    panels = (
        Panel(title="attitude error", y="principal angle [deg]", lines={"": (t, error)}, log=True),
        Panel(title="rate error", y="Omega - Omega_hat [rad/s]", lines=components(t, omega)),
        Panel(title="bias error", y="beta_hat - beta [rad/s]", lines=components(t, beta_tilde)),
    )
    return Experiment(
        name="fts-7.1",
        title="Finite-time convergence from upside down, without noise",
        paper="Sanyal, Warier, Hamrah, section 7.1, Fig. 1",
        seeds=0,
        claims=_claims(t, error, np.linalg.norm(beta_tilde, axis=1), V),
        panels={"fts-7.1-fig1": panels},
        notes=(
            "The paper leaves the motion, the directions and K open: here the motion is that of "
            "7.2, (96), E = I and K = diag(3, 2, 1).",
            "Which of 2 and 1 is k_p is not readable in the paper: k_p = 2, k_v = 1 here.",
        ),
    )


def _claims(t: Array, error: Array, bias: Array, V: Array) -> tuple[Claim, ...]:
    arrived = stays_below(t, error, ARRIVED)
    return (
        Claim(
            statement="the attitude error converges to zero in finite time",
            source="Theorem 1, Fig. 1",
            seen="never"
            if arrived is None
            else f"below {ARRIVED:g}° for good from {arrived:.2f} s",
            holds=arrived is not None,
            value=arrived,
        ),
        at_most(
            "attitude error from 5.5 s on below 1°", REGRESSION, after(t, error, 5.5), 1.0, "°"
        ),
        at_most("attitude error from 20 s on", REGRESSION, after(t, error, 20.0), 1e-6, "°"),
        at_most("bias error at 30 s", REGRESSION, float(bias[-1]), 1e-8, "rad/s"),
        at_most(
            "the Lyapunov function never grows",
            "Theorem 1, (56)",
            float(np.diff(V).max()),
            ROUNDING,
            f"at most in a step, of {V[0]:.3g} at the start",
        ),
    )
