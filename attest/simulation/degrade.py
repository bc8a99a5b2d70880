"""Worse sensors, worse links: pure functions of a flight, for any scenario.

    degrade(flight, Degradation(rate={"gyro": 50.0}, gaps=((10.0, 15.0),), drop=0.01))

Each signal is sampled anew, then gets its bias, its noise and its quantum, and fails for a while,
as GPS does; then samples are lost.
The truth stays as it was, and a bias that is known as a truth grows by what is added. Amounts are
in a signal's own units: SI, but degrees for latitude and longitude. What is random is drawn by the
flight's seed, for each signal apart.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from attest.errors import ConfigError
from attest.recording import Signal
from attest.simulation.flight import Array, Flight, Times

HIGHEST_RATE = 10_000.0
"""Hz."""
LARGEST = 1e12
"""Of any other number; its inverse is the smallest amount."""

_NOISE, _LOSS = 11, 12  # streams of random numbers apart from a scenario's own
_OWN = 0.9  # of the usual step: with jitter, still the signal's own rate
_LATEST = 1e9  # s, whose nanoseconds fit into 64 bits
_LONGEST = 1.5  # of interpolation, in usual steps: across what is longer there is nothing


Span = tuple[float, float]
Jump = tuple[float, float, tuple[float, ...]]


@dataclass(frozen=True, slots=True)
class Degradation:
    """What to do to a flight; signals by name."""

    rate: Mapping[str, float] = field(default_factory=dict)
    """Samples per second, Hz."""
    bias: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Constant to add, by axis."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of normal noise to add to each axis."""
    quantum: Mapping[str, float] = field(default_factory=dict)
    """Step to round to."""
    jump: Mapping[str, tuple[Jump, ...]] = field(default_factory=dict)
    """From when, until when, seconds from the first sample, and by what a signal is off then."""
    stuck: Mapping[str, tuple[Span, ...]] = field(default_factory=dict)
    """From and until when it stays what it was."""
    silent: Mapping[str, tuple[Span, ...]] = field(default_factory=dict)
    """From and until when there is none."""
    drop: float = 0.0
    """Share of the samples that are lost at random, 0 to below 1."""
    gaps: tuple[Span, ...] = ()
    """From and until when nothing is received, seconds from the first sample."""


def degrade(flight: Flight, how: Degradation) -> Flight:
    """Do all of it, in the order of sensor, then link.

    Raises
    ------
    ConfigError
        The flight has no such signal, or a number is out of its range.
    """
    for name, rate in how.rate.items():
        flight = resample(flight, name, rate)
    for name, offset in how.bias.items():
        flight = add_bias(flight, name, offset)
    for name, std in how.noise.items():
        flight = add_noise(flight, name, std)
    for name, quantum in how.quantum.items():
        flight = quantise(flight, name, quantum)
    for name, jumps in how.jump.items():
        for start, end, offset in jumps:
            flight = jump(flight, name, (start, end), offset)
    for name, spans in how.stuck.items():
        flight = hold(flight, name, spans)
    for name, spans in how.silent.items():
        flight = silence(flight, name, spans)
    return lose(drop(flight, how.drop), how.gaps)


def resample(flight: Flight, name: str, rate: float) -> Flight:
    """Sample a signal at another rate.

    A lower rate, or its own, picks the sample nearest to each tick: stamp, noise and all. A rate
    over a tenth higher interpolates linearly, though never across a gap: it adds nothing new.
    """
    signal = _signal(flight, name, "rate")
    if not 0.0 < rate <= HIGHEST_RATE:
        raise ConfigError(f"rate {name}={rate:g}: out of range. Give Hz above 0, up to 10000.")
    if len(signal.t) < 2:
        return flight
    ticks = np.arange(signal.t[0], signal.t[-1] + 1, 1e9 / rate).astype(np.int64)
    usual = float(np.median(np.diff(signal.t)))
    if 1e9 / rate >= _OWN * usual:
        return _with(flight, name, _pick(signal, ticks))
    return _with(flight, name, _interpolate(signal, ticks, _LONGEST * usual))


def add_bias(flight: Flight, name: str, offset: tuple[float, ...]) -> Flight:
    """Add a constant to a signal, and to the truth about its bias."""
    signal = _signal(flight, name, "bias")
    axes = signal.y.shape[1]
    if len(offset) != axes or not all(abs(value) <= LARGEST for value in offset):
        given = ",".join(f"{value:g}" for value in offset)
        raise ConfigError(f"bias {name}={given}: not usable. Give {axes} numbers up to 1e12.")
    known = f"{name}_bias"
    total = np.array(flight.constants.get(known, np.zeros(axes))) + offset
    truth = dict(flight.truth)
    if known in truth:
        truth[known] = replace(truth[known], y=truth[known].y + offset)
    constants = {**flight.constants, known: tuple(total.tolist())}
    biased = replace(signal, y=signal.y + offset)
    return replace(_with(flight, name, biased), constants=constants, truth=truth)


def add_noise(flight: Flight, name: str, std: float) -> Flight:
    """Add normal noise to each axis of a signal."""
    signal = _signal(flight, name, "noise")
    _require_amount("noise", name, std)
    rng = _generator(flight, _NOISE, name)
    return _with(
        flight, name, replace(signal, y=signal.y + std * rng.standard_normal(signal.y.shape))
    )


def quantise(flight: Flight, name: str, quantum: float) -> Flight:
    """Round a signal to whole multiples of a step."""
    signal = _signal(flight, name, "quantum")
    _require_amount("quantum", name, quantum)
    counts = np.rint(signal.y / quantum) + 0.0  # and no -0.0
    return _with(flight, name, replace(signal, y=quantum * counts))


def jump(flight: Flight, name: str, span: Span, offset: tuple[float, ...]) -> Flight:
    """Add a constant to a signal for a while."""
    signal = _signal(flight, name, "jump")
    axes = signal.y.shape[1]
    if len(offset) != axes or not all(abs(value) <= LARGEST for value in offset):
        given = ",".join(f"{value:g}" for value in offset)
        raise ConfigError(f"jump {name}={given}: not usable. Give {axes} numbers up to 1e12.")
    during = _during(flight, signal.t, f"jump {name}=", (span,))
    return _with(flight, name, replace(signal, y=signal.y + np.outer(during, offset)))


def hold(flight: Flight, name: str, spans: tuple[Span, ...]) -> Flight:
    """Let a signal stay what it was for a while."""
    signal = _signal(flight, name, "stuck")
    during = _during(flight, signal.t, f"stuck {name}=", spans)
    last = np.maximum.accumulate(np.where(during, 0, np.arange(len(during))))
    return _with(flight, name, replace(signal, y=signal.y[last]))


def silence(flight: Flight, name: str, spans: tuple[Span, ...]) -> Flight:
    """Leave out the samples of one signal for a while; its first always arrives."""
    signal = _signal(flight, name, "silent")
    heard = ~_during(flight, signal.t, f"silent {name}=", spans) | (signal.t == signal.t[0])
    return _with(flight, name, replace(signal, t=signal.t[heard], y=signal.y[heard]))


def drop(flight: Flight, share: float) -> Flight:
    """Lose a share of the samples at random; signals of one clock are lost together.

    A message carries all that has its stamp. One sample of each clock always arrives.
    """
    if not 0.0 <= share < 1.0:
        raise ConfigError(f"drop {share:g}: out of range. Give a share from 0 to below 1.")
    if share == 0.0:
        return flight
    arrived: dict[bytes, Array] = {}
    signals = {}
    for name, signal in flight.signals.items():
        clock = signal.t.tobytes()
        if clock not in arrived:
            drawn = _generator(flight, _LOSS, str(len(arrived))).random(len(signal.t))
            arrived[clock] = drawn >= min(share, drawn.max(initial=0.0))
        kept = arrived[clock]
        signals[name] = replace(signal, t=signal.t[kept], y=signal.y[kept])
    return replace(flight, signals=signals)


def lose(flight: Flight, gaps: tuple[Span, ...]) -> Flight:
    """Receive nothing of any sensor between moments, in seconds from the first sample."""
    return replace(flight, outages=flight.outages + _spans(flight, "gap ", gaps))


def _spans(flight: Flight, what: str, spans: tuple[Span, ...]) -> tuple[tuple[int, int], ...]:
    """Return nanoseconds of what is in seconds from the first sample of any sensor."""
    for start, end in spans:
        if not 0.0 <= start < end <= _LATEST:
            text = f"{what}{start:g}:{end:g}"
            raise ConfigError(f"{text}: not a span. Give seconds, the lower first.")
    first = min(int(signal.t[0]) for signal in flight.signals.values() if len(signal.t))
    return tuple((first + round(a * 1e9), first + round(b * 1e9)) for a, b in spans)


def _during(flight: Flight, t: Times, what: str, spans: tuple[Span, ...]) -> NDArray[np.bool_]:
    inside = [(a <= t) & (t < b) for a, b in _spans(flight, what, spans)]
    return np.asarray(np.logical_or.reduce([np.zeros(len(t), np.bool_), *inside]))


def _signal(flight: Flight, name: str, what: str) -> Signal:
    if name not in flight.signals:
        held = ", ".join(sorted(flight.signals))
        raise ConfigError(f"{what} {name}: {flight.scenario} has no such signal. It has: {held}.")
    return flight.signals[name]


def _require_amount(what: str, name: str, amount: float) -> None:
    if not 1.0 / LARGEST <= amount <= LARGEST:
        raise ConfigError(f"{what} {name}={amount:g}: out of range. Give 1e-12 to 1e12.")


def _with(flight: Flight, name: str, signal: Signal) -> Flight:
    return replace(flight, signals={**flight.signals, name: signal})


def _generator(flight: Flight, stream: int, name: str) -> np.random.Generator:
    return np.random.default_rng([flight.seed, stream, *name.encode()])


def _pick(signal: Signal, ticks: Times) -> Signal:
    """Take the sample nearest to each tick, once."""
    right = np.clip(np.searchsorted(signal.t, ticks), 1, len(signal.t) - 1)
    nearer = ticks - signal.t[right - 1] <= signal.t[right] - ticks
    picked = np.unique(right - nearer)
    return replace(signal, t=signal.t[picked], y=signal.y[picked])


def _interpolate(signal: Signal, ticks: Times, longest: float) -> Signal:
    """Draw lines between samples no further apart than the longest, ns."""
    right = np.clip(np.searchsorted(signal.t, ticks), 1, len(signal.t) - 1)
    apart = signal.t[right] - signal.t[right - 1]
    near = (apart <= longest) | (ticks == signal.t[right]) | (ticks == signal.t[right - 1])
    share = ((ticks - signal.t[right - 1]) / apart)[:, np.newaxis]
    y = signal.y[right - 1] + share * (signal.y[right] - signal.y[right - 1])
    return replace(signal, t=ticks[near], y=y[near])
