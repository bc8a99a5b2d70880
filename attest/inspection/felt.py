"""Whether an accelerometer feels what velocity and reference say: a - g, in the body.

In flight the specific force is along one axis of the body nearly always, so that only what velocity
and attitude know of the rest tells the axes of an accelerometer.
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY
from attest.inspection import carried, turning
from attest.inspection.turning import Fit
from attest.recording import Recording, Reference, Signal, seconds

Array = NDArray[np.float64]

CELL = 2.0
"""s; accelerations show, vibration and the velocity's lag hardly."""
FEWEST, MOST_CELLS = 20, 200
SLOWEST = 0.5
"""Longest usual step of the velocity, s."""


def fit(recording: Recording, reference: Reference) -> Fit | None:
    """Fit the accelerometer's axes to velocity and attitude; None where no axes stand out."""
    accel, velocity = (recording.signals.get(name) for name in ("accel", "velocity"))
    if accel is None or velocity is None or turning.period(velocity.t) > SLOWEST:
        return None
    edges = _edges(accel, velocity, reference)
    if len(edges) <= FEWEST:
        return None
    expected, felt = _expected(recording, velocity, edges), _felt(accel, reference, edges)
    off = np.einsum("pjk,nijk->pni", carried.PROPER, felt)
    # an inverted one has the axes that are read, and is told by its up
    left = [np.mean(np.sum((off - sign * expected) ** 2, axis=2), axis=1) for sign in (1.0, -1.0)]
    return carried.stands_out(np.minimum(*left))


def _edges(accel: Signal, velocity: Signal, reference: Reference) -> NDArray[np.int64]:
    clocks = (accel.t, velocity.t, reference.t)
    first, last = max(int(t[0]) for t in clocks), min(int(t[-1]) for t in clocks)
    count = min(MOST_CELLS, int((last - first) * 1e-9 / CELL))
    return first + np.arange(max(0, count + 1), dtype=np.int64) * round(CELL * 1e9)


def _expected(recording: Recording, velocity: Signal, edges: NDArray[np.int64]) -> Array:
    """Return mean a - g in the world by cell, shape (n, 3)."""
    at, stamps = seconds(edges, int(edges[0])), seconds(velocity.t, int(edges[0]))
    v = np.stack([np.interp(at, stamps, column) for column in velocity.y.T], axis=1)
    g = GRAVITY if recording.world == "ned" else -GRAVITY
    expected: Array = np.diff(v, axis=0) / CELL - np.array([0.0, 0.0, g])
    return expected


def _felt(accel: Signal, reference: Reference, edges: NDArray[np.int64]) -> Array:
    """Return the means of R e_j a_k by cell, shape (n, 3, 3, 3)."""
    part = slice(*np.searchsorted(accel.t, edges[[0, -1]]))
    t = accel.t[part]
    q = reference.q[np.clip(np.searchsorted(reference.t, t), 0, len(reference.t) - 1)]
    products = np.einsum("nij,nk->nijk", quaternion.to_matrix(q), accel.y[part]).reshape(-1, 27)
    mean: Array = turning.means(seconds(t, int(edges[0])), products, seconds(edges, int(edges[0])))
    return mean.reshape(-1, 3, 3, 3)
