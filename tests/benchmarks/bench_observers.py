"""How quickly the observers step, each against VQF's C++ (9D), in one run.

    python tests/benchmarks/bench_observers.py [NAME...] [--samples 200000] [--rate 100] [--whole]

All are given the same simulated turning sensor with noise; prints the median of the time
per step of each, and of the ratio round by round. With ``--whole``, observers condition it as well.
"""

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import vqf

from attest import conditioning, observers, pipeline
from attest.config import Configuration
from attest.estimates import Estimates
from attest.geometry import quaternion
from attest.recording import Clock, Recording, Signal
from attest.samples import Samples

NAMES = [name for name in observers.NAMES if name != "vqf"]
GRAVITY, FIELD = np.array([0.0, 0.0, 9.81]), np.array([0.0, 20.0, -43.0])
"""Specific force at rest, m/s², and the field, µT, in east-north-up."""


def sensor(n: int, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return stamps, gyroscope, accelerometer and magnetometer."""
    draw = np.random.default_rng(1).normal
    t = np.arange(n) * round(1e9 / rate)
    s = t * 1e-9
    slow = [np.sin(s / 3.0), np.sin(s / 4.0 + 1.0), np.cos(s / 5.0)]
    q = quaternion.from_euler(0.6 * slow[0], 0.5 * slow[1], 3.0 * slow[2])
    turn = quaternion.log(quaternion.multiply(quaternion.conjugate(q[:-1]), q[1:])) * rate
    gyro = np.concatenate([turn, turn[-1:]]) + 0.01 + draw(0.0, 0.005, (n, 3))
    back = quaternion.conjugate(q)
    accel = quaternion.rotate(back, np.tile(GRAVITY, (n, 1))) + draw(0.0, 0.2, (n, 3))
    return t, gyro, accel, quaternion.rotate(back, np.tile(FIELD, (n, 1))) + draw(0.0, 0.5, (n, 3))


def samples(t: np.ndarray, gyro: np.ndarray, accel: np.ndarray, mag: np.ndarray) -> Samples:
    """Return what the observers step over."""

    def unit(v: np.ndarray) -> np.ndarray:
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    n = len(t)
    return Samples(
        t=t,
        gyro=gyro,
        body=unit(np.stack([accel, mag], axis=1)),
        inertial=unit(np.stack([GRAVITY, FIELD])[np.newaxis]),
        valid=np.ones((n, 2), np.bool_),
        names=("accel", "mag"),
        substeps=np.ones(n, np.int64),
        restart=np.arange(n) == 0,
    )


def recording(t: np.ndarray, gyro: np.ndarray, accel: np.ndarray, mag: np.ndarray) -> Recording:
    """Return the same as a log."""
    values = {"gyro": gyro, "accel": accel, "mag": 1e-6 * mag}
    return Recording(
        path=Path("sensor.csv"),
        format="csv",
        signals={name: Signal(t, y, name) for name, y in values.items()},
        references={},
        clock=Clock("of the sensor", None),
        world="enu",
        body="flu",
    )


def whole(log: Recording, config: Configuration) -> Estimates:
    """Condition a log and run the observer."""
    given, _ = conditioning.condition(log, config)
    return observers.get(config.observer).estimate(given, config)


def seconds(call: Callable[[], object]) -> float:
    """Return how long a call takes."""
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def main() -> int:
    """Time each observer and VQF in turn."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=NAMES)
    parser.add_argument("--samples", type=int, default=200_000)
    parser.add_argument("--rate", type=float, default=100.0, help="in hertz; 286 as in BROAD")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--whole", action="store_true", help="with conditioning")
    chosen = parser.parse_args()
    t, gyro, accel, mag = sensor(chosen.samples, chosen.rate)
    given, log = samples(t, gyro, accel, mag), recording(t, gyro, accel, mag)
    for name in chosen.names:
        observer = observers.get(name)
        config = observer.config()
        estimate = partial(whole, log) if chosen.whole else partial(observer.estimate, given)
        if chosen.whole:
            config = pipeline.configure(name)
        estimate(config)  # compiles
        times = np.array(
            [
                (
                    seconds(partial(estimate, config)),
                    seconds(lambda: vqf.VQF(1.0 / chosen.rate).updateBatch(gyro, accel, mag)),
                )
                for _ in range(chosen.rounds)
            ]
        )
        ours, theirs = np.median(times, axis=0) / chosen.samples * 1e9
        ratio = np.median(times[:, 0] / times[:, 1])
        sys.stdout.write(
            f"{name:13s} {ours:5.0f} ns/step, vqf 9D {theirs:4.0f} ns/step, ratio {ratio:.3f}\n"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
