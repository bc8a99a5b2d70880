"""[ESO] section 6: attitude, rate and disturbance torque of a controlled body.

[ESO]  N. Wang, A. K. Sanyal, "A Hölder-continuous extended state observer for rigid body attitude
       dynamics", IFAC-PapersOnLine 55-22, 2022.
"""

from collections.abc import Sequence

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
    components,
    configure,
    run,
    samples,
    seconds,
    start,
)
from attest.simulation.flight import Flight

Run = tuple[Array, Array, Array, Array]
"""Errors of attitude, rate and torque, and |sigma_tilde|."""
LATE = 35.0
"""s, from when on the errors are those of the end."""


def reproduce(seeds: Sequence[int]) -> Experiment:
    """Run it; the seeds draw the noise."""
    flight = simulation.simulate("eso-6")
    t = seconds(flight)
    clean = _run(flight)
    noisy = [_run(simulation.simulate("eso-6-noise", seed)) for seed in seeds]
    return Experiment(
        name="eso-6",
        title="Attitude, rate and disturbance torque",
        paper="Wang, Sanyal, section 6, Figs. 1-3",
        seeds=len(seeds),
        claims=_claims(t, clean, noisy),
        panels=_panels(t, clean, noisy[0]),
        notes=(
            "The paper does not give the vectors, K and h: those of [REL] (58)-(61), "
            "K = diag(3, 2, 1), h = 0.01 s.",
        ),
    )


def _claims(t: Array, clean: Run, noisy: Sequence[Run]) -> tuple[Claim, ...]:
    error, _, _, sigma = clean
    worst = [after(t, each[0], LATE) for each in noisy]
    mean = np.mean([each[0][t >= LATE].mean() for each in noisy])
    return (
        at_most(
            "without noise the attitude error converges near zero: below 0.05° at the end",
            REGRESSION,
            float(error[-1]),
            0.05,
            f"° ({after(t, error, LATE):.3g}° at most from {LATE:g} s on)",
        ),
        at_most(
            "without noise the disturbance is followed: |sigma_tilde| about 0.015 at the end",
            REGRESSION,
            float(sigma[-1]),
            0.02,
            "rad/s²",
        ),
        Claim(
            statement="with noise the attitude error converges to a neighbourhood of zero, here 5°",
            source="Section 6, Figs. 1-3",
            seen=f"attitude {mean:.2f}° in the mean from {LATE:g} s on, {max(worst):.2f}° at most: "
            "a constant offset, for the paper's `rand` has a mean of one half",
            holds=max(worst) < 5.0,
            value=max(worst),
            bound=5.0,
        ),
    )


def _panels(t: Array, clean: Run, shown: Run) -> dict[str, tuple[Panel, ...]]:
    error, rate, torque, _ = clean
    return {
        "eso-6-fig1": (
            Panel(
                title="attitude error",
                y="principal angle [deg]",
                lines={"with noise": (t, shown[0]), "without": (t, error)},
                log=True,
            ),
        ),
        "eso-6-fig2": (
            Panel(
                title="rate error, with noise",
                y="Omega - Omega_hat [rad/s]",
                lines=components(t, shown[1]),
            ),
            Panel(title="without", y="[rad/s]", lines=components(t, rate)),
        ),
        "eso-6-fig3": (
            Panel(
                title="disturbance torque error, with noise",
                y="tau_d - tau_d_hat [N m]",
                lines=components(t, shown[2]),
            ),
            Panel(title="without", y="[N m]", lines=components(t, torque)),
        ),
    }


def _run(flight: Flight) -> Run:
    """Return errors of attitude (degrees), rate, torque (N·m), and |sigma_tilde| (rad/s²)."""
    constants = flight.constants
    names = {"alpha": "alpha", "gamma": "gamma", "kappa": "kappa", "k_sigma": "k_sigma"}
    gains = {key: constants[f"eso_{name}"][0] for key, name in names.items()}
    document = {
        "gains": gains | {"k_Psi": constants["eso_k_psi"][0]},
        "weights": {"k": [3.0, 2.0, 1.0]},
        "initial": start(flight, disturbance=list(constants["initial_sigma"])),
        "plant": {"inertia": list(constants["inertia"])},
    }
    found = run(samples(flight), configure("eso", document))
    torque = flight.truth["disturbance_torque"].y - found.states["disturbance_torque"]
    sigma: Array = np.linalg.norm(torque / np.array(constants["inertia"]), axis=1)
    return attitude_error(found.q, flight), flight.omega - found.angular_velocity, torque, sigma
