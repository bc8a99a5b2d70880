"""[VAE] section 6: bounded noise of known frequencies, and a constant bias.

[VAE]  M. Izadi, S. P. Viswanathan, A. K. Sanyal, C. Silvestre, P. Oliveira, "The variational
       attitude estimator in the presence of bias in angular velocity measurements".
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from attest import simulation
from attest.claims import Claim
from attest.geometry import quaternion
from attest.observers import vae
from attest.recording import Signal
from attest.reproduction.experiment import (
    Array,
    Experiment,
    Panel,
    attitude_error,
    bias_error,
    components,
    configure,
    energy,
    run,
    samples,
    seconds,
    start,
)
from attest.simulation.flight import Flight

Run = tuple[Array, Array, Array, Array, Array]
"""Errors of attitude, rate and bias, Newton's iterations, and V."""
NOISE_DEG = 2.4
"""Bound of a vector's noise."""
K = (3.0, 2.0, 1.0)
"""Weights."""


def reproduce(seeds: Sequence[int]) -> Experiment:
    """Run it; the seeds draw the phases of the noise."""
    flights = [simulation.simulate("vae-6", seed) for seed in seeds]
    found = [_run(flight) for flight in flights]
    t = seconds(flights[0])
    return Experiment(
        name="vae-6",
        title="Bounded noise and a constant bias",
        paper="Izadi, Viswanathan, Sanyal, Silvestre, Oliveira, section 6, Figs. 1-3",
        seeds=len(flights),
        claims=_claims(flights[0], found),
        panels=_panels(t, found[0]),
        notes=(
            "Nine directions, all seen all the time: the axes and the diagonals of the coordinate "
            "planes; W of [FTS] (12) with K = diag(3, 2, 1); Phi(x) = x.",
            "At h = 0.01 s the waves of 100 and 200 Hz are constants: offsets of up to 0.5° and "
            "0.37 °/s that no observer can tell from the truth.",
        ),
    )


def _claims(flight: Flight, found: Sequence[Run]) -> tuple[Claim, ...]:
    t = seconds(flight)
    late = [float(each[0][t >= 30.0].max()) for each in found]
    room = [_neighbourhood(flight, each[2][t >= 30.0]) for each in found]
    bias_fall = float(np.median([_length(each[2][-1]) / _length(each[2][0]) for each in found]))
    iterations = max(float(each[3].max()) for each in found)
    V = _run(_without_noise(flight))[4]
    growth = float(np.diff(V).max())
    return (
        Claim(
            statement="the attitude error converges to a neighbourhood set by the noise's bounds: "
            f"in the last 10 s the vectors' {NOISE_DEG:g}° and what the bias left holds off, "
            "D |beta_tilde|/(k2 + k3)",
            source="Section 6, Fig. 1",
            seen=f"at most {np.median(late):.2f}° (median of the seeds) to {max(late):.2f}°, where "
            f"{np.median(room):.2f}° to {max(room):.2f}° are allowed",
            holds=all(a <= b for a, b in zip(late, room, strict=True)),
            value=max(late),
            bound=max(room),
        ),
        Claim(
            statement="the bias error converges; with P = 2000 I not within 40 s",
            source="Section 6, Fig. 3",
            seen=f"at 40 s {bias_fall:.0%} of what it was",
            holds=bias_fall < 1.0,
            value=bias_fall,
            bound=1.0,
        ),
        Claim(
            statement="Newton-Raphson solves the implicit step",
            source="Section 6",
            seen=f"{iterations:.0f} iterations at most",
            holds=iterations <= vae.MOST_ITERATIONS,
            value=iterations,
            bound=float(vae.MOST_ITERATIONS),
        ),
        Claim(
            statement="without noise the energy of the errors never grows",
            source="Theorem 4.2",
            seen=f"by {growth:.2g} at most in a step, of {V[0]:.3g}",
            holds=bool(growth <= 1e-9 * V[0]),
            value=growth,
            bound=1e-9 * float(V[0]),
        ),
    )


def _panels(t: Array, shown: Run) -> dict[str, tuple[Panel, ...]]:
    error, omega, bias, _, _ = shown
    return {
        "vae-6-fig1": (
            Panel(title="attitude error", y="principal angle [deg]", lines={"": (t, error)}),
        ),
        "vae-6-fig2": (
            Panel(title="rate error", y="Omega - Omega_hat [rad/s]", lines=components(t, omega)),
        ),
        "vae-6-fig3": (
            Panel(title="bias error", y="beta - beta_hat [rad/s]", lines=components(t, -bias)),
        ),
    }


def _run(flight: Flight) -> Run:
    """Return errors of attitude (degrees), rate and bias, Newton's iterations, and V."""
    constants = flight.constants
    gains = {"m": constants["vae_m"][0], "D": list(constants["vae_d"])}
    document = {
        "gains": gains | {"P": list(constants["vae_p"])},
        "weights": {"k": list(K)},
        "initial": start(flight),
    }
    configuration = configure("vae", document)
    found = run(samples(flight), configuration)
    omega = flight.omega - found.angular_velocity
    return (
        attitude_error(found.q, flight),
        omega,
        bias_error(found, flight),
        found.states["newton_iterations"],
        energy(found, configuration, flight),
    )


def _neighbourhood(flight: Flight, beta_tilde: Array) -> float:
    """Return NOISE_DEG and the angle at which s_L = D omega balances a bias error, degrees."""
    worst = float(np.linalg.norm(beta_tilde * np.array(flight.constants["vae_d"]), axis=1).max())
    return NOISE_DEG + float(np.degrees(worst / (K[1] + K[2])))


def _without_noise(flight: Flight) -> Flight:
    """Return the same flight as perfect sensors see it; the truth is held over a step, as (30)."""
    turns = quaternion.multiply(quaternion.conjugate(flight.q[:-1]), flight.q[1:])
    h = np.diff(flight.t)[:, np.newaxis] * 1e-9
    rate = np.concatenate([quaternion.log(turns) / h, flight.omega[-1:]])
    back = quaternion.conjugate(flight.q)
    signals = {
        name: replace(signal, y=quaternion.rotate(back, np.array(flight.constants[name])))
        for name, signal in flight.signals.items()
        if name in flight.constants
    }
    beta = np.array(flight.constants["gyro_bias"])
    return replace(flight, signals={**signals, "gyro": Signal(flight.t, rate + beta, "")})


def _length(v: Array) -> float:
    return float(np.linalg.norm(v))
