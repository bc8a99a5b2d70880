"""[REL] section 4: relative attitude from four vectors, without and with noise.

[REL]  N. Wang, R. Hamrah, A. K. Sanyal, "A finite-time stable observer for relative attitude
       estimation".
"""

from collections.abc import Sequence
from dataclasses import replace

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
    configure,
    run,
    samples,
    seconds,
    start,
)
from attest.simulation.flight import Flight

STEADY = 5.0
"""s, from when on an error is steady."""


def reproduce(seeds: Sequence[int]) -> Experiment:
    """Run it; the seeds draw the noise of the second simulation."""
    flight = simulation.simulate("rel-4")
    t, error = seconds(flight), _error(flight)
    flights = [simulation.simulate("rel-4-noise", seed) for seed in seeds]
    noisy = np.array([_error(each) for each in flights])
    y = "principal angle [deg]"
    return Experiment(
        name="rel-4",
        title="Relative attitude from four vectors",
        paper="Wang, Hamrah, Sanyal, section 4, Figs. 2, 3",
        seeds=len(seeds),
        claims=_claims(flight, error, flights, noisy),
        panels={
            "rel-4-fig2": (Panel(title="without noise", y=y, lines={"": (t, error)}),),
            "rel-4-fig3": (Panel(title="with noise, first seed", y=y, lines={"": (t, noisy[0])}),),
        },
        notes=(
            "The paper leaves motion, step and level of noise open: the motion of [FTS] (96), "
            "h = 0.01 s, and normal noise of 0.01 in each entry of L; K = diag(3, 2, 1).",
        ),
    )


def _claims(
    flight: Flight, error: Array, flights: Sequence[Flight], noisy: Array
) -> tuple[Claim, ...]:
    t = seconds(flight)
    rms, halved = _rms(t, noisy), _rms(t, [_error(_halfway(flight, each)) for each in flights])
    std = np.degrees(flights[0].constants["vector_std"][0])
    mu, w_n = flight.constants["rel_mu"][0], flight.constants["rel_w_n"][0]
    lag = np.degrees(2.0 * mu * np.linalg.norm(flight.omega, axis=1).max() / w_n)
    return (
        at_most(
            "without noise the error falls below 0.3° within 2 s and stays there",
            REGRESSION,
            after(t, error, 2.0),
            0.3,
            "° at most from 2 s on",
        ),
        Claim(
            statement="without noise the error converges to zero",
            source="Section 4, Fig. 2",
            seen=f"to {after(t, error, 5.0):.3f}°, the lag of the pre-filter "
            f"(2 mu |Omega|/w_n is {lag:.3f}° at most); not to zero",
            holds=after(t, error, 5.0) < 1e-3,
            value=after(t, error, 5.0),
        ),
        Claim(
            statement="with noise the error converges to a neighbourhood whose size depends on the "
            "noise's level",
            source="Section 4, Fig. 3",
            seen=f"RMS {rms:.2f}°, {noisy[:, t >= STEADY].max():.2f}° at most, under noise of "
            f"{std:.2f}°; RMS {halved:.2f}° under half of it",
            holds=halved < 0.75 * rms < 0.75 * 180.0,
            value=rms,
        ),
    )


def _rms(t: Array, errors: Sequence[Array] | Array) -> float:
    return float(np.sqrt(np.mean(np.array(errors)[:, t >= STEADY] ** 2)))


def _halfway(flight: Flight, noisy: Flight) -> Flight:
    """Return a flight with half of another's noise."""
    signals = {
        name: replace(signal, y=0.5 * (signal.y + noisy.signals[name].y))
        for name, signal in flight.signals.items()
    }
    return replace(flight, signals=signals)


def _error(flight: Flight) -> Array:
    constants = flight.constants
    gains = {name: constants[f"rel_{name}"][0] for name in ("k_p", "p", "mu", "w_n")}
    document = {"gains": gains, "initial": {"attitude": start(flight)["attitude"]}}
    return attitude_error(run(samples(flight), configure("relative_fts", document)).q, flight)
