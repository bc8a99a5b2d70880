"""The most likely path of a log: Gauss-Newton over all of it, with outliers weighed down.

[Bell94]  B. M. Bell, "The iterated Kalman smoother as a Gauss-Newton method", SIAM J. Opt. 4(3).
[Barfoot24]  T. D. Barfoot, "State estimation for robotics", 2nd ed., 3.1, 5.3 and 9.1.

Each iteration linearises all factors about the path and solves for its most likely change. What a
residual counts for follows from Student's t, by its size in the iteration before.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.smoothing import chain, factors
from attest.smoothing.factors import CONSTANTS, NODE
from attest.smoothing.path import Expected, Nodes, Path
from attest.smoothing.stretch import Log

Array = NDArray[np.float64]

LEAST, MOST = 4, 20
"""Iterations."""
CLOSE = 2e-4
"""A change of attitude, rad, from which the path is taken as found."""
STRIDE = 0.5
"""The most that attitudes are changed at once, rad."""
OPEN = np.pi
"""Standard deviation of what nothing tells of an attitude, rad."""
MEDIAN = 0.789
"""Of the mean of three squared standard normals."""
LEAST_FIELD = 0.33
"""Share of the local field's expected deviation that is believed at the least."""
SPARSE = 4.0
"""Degrees of freedom of the hard iron's: most bodies have none, and some a lot."""


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known before, as standard deviations."""

    bias: float
    """rad/s."""
    scale: float
    """Of the gyroscope's errors of scale and alignment."""
    iron: float
    """In units of the field."""
    field: float
    """Of the field's strength and dip, in units of it."""
    gravity: float
    """Of the scale of gravity."""
    lean: float
    """Of the accelerometer's bias, m/s²."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """The most likely path."""

    path: Path
    P: Array
    """Covariances of the nodes, (N, 9, 9)."""
    counts: Array
    """What the field after each node counts for, (N,)."""
    off: Array
    """What the field after each node is off by, as a share of the strength, (N,); NaN of none."""
    iterations: int
    scatter: float
    """Standard deviation of the local field as it was found, as a share of the strength."""


def smooth(
    log: Log, nodes: Nodes, path: Path, north: Array, noise: Expected, prior: Prior
) -> Found:
    """Find the most likely path from a first guess."""
    first = path
    fields = np.empty((len(nodes.at), 2))
    z = np.empty((len(nodes.at), NODE))
    z_c, P_c = np.empty(CONSTANTS), np.empty((CONSTANTS, CONSTANTS))
    known = (float(north[0]), float(north[1]), float(north[2]))
    equations = chain.empty(len(nodes.at), NODE, CONSTANTS)
    change, done, expected = np.inf, 0, noise
    while done < LEAST or (change > CLOSE and done < MOST):
        for block in equations:
            block[:] = 0.0
        factors.build(equations, log, nodes, path, known, expected, fields)
        _before(equations, nodes, path, first, prior)
        chain.solve(equations, z, z_c, P_c)
        path, change = _changed(path, z, z_c)
        done += 1
        # a first guess makes outliers of anything
        expected = noise._replace(tails=done > 1, field=_scatter(fields, noise.field))
    P = np.empty((len(nodes.at), NODE, NODE))
    chain.covariances(equations, P_c, P)
    off = np.sqrt(3.0 * fields[:, 1])
    return Found(path, P, np.nan_to_num(fields[:, 0]), off, done, _shown(fields))


def _scatter(fields: Array, most: float) -> float:
    """Return the local field's standard deviation, as the log shows it where that is less."""
    return float(np.clip(_shown(fields), LEAST_FIELD * most, most))


def _shown(fields: Array) -> float:
    """Return the local field's standard deviation as the log shows it; infinite without one."""
    shown = fields[np.isfinite(fields[:, 1]), 1]
    return float(np.sqrt(np.median(shown) / MEDIAN)) if len(shown) else np.inf


def _changed(path: Path, z: Array, z_c: Array) -> tuple[Path, float]:
    """Return the path changed by a step, and how far the attitudes are turned, rad."""
    change = float(np.abs(z[:, :3]).max())
    share = min(1.0, STRIDE / change) if change > 0.0 else 1.0
    turned = quaternion.multiply(quaternion.exp(share * z[:, :3]), path.q)
    moved = Path(
        q=quaternion.normalize(turned),
        v=path.v + share * z[:, 3:6],
        b=path.b + share * z[:, 6:9],
        c=path.c + share * z_c,
    )
    return moved, change


def _before(equations: chain.Chain, nodes: Nodes, path: Path, first: Path, prior: Prior) -> None:
    """Add what is known before: of the constants, the first bias, and each stretch's attitude."""
    iron2 = prior.iron**2 + float(path.c[9:12] @ path.c[9:12]) / SPARSE
    sigma = np.repeat(
        [prior.scale, np.sqrt(iron2), prior.field, prior.gravity, prior.lean], [9, 3, 2, 1, 3]
    )
    information = 1.0 / sigma**2
    i = np.arange(CONSTANTS)
    equations.C[i, i] += information
    equations.C[:, CONSTANTS] -= information * (path.c - first.c)
    for j in range(3):
        equations.H[0, factors.BIAS + j, factors.BIAS + j] += 1.0 / prior.bias**2
        equations.B[0, factors.BIAS + j, CONSTANTS] -= (
            path.b[0, j] - first.b[0, j]
        ) / prior.bias**2
    starts = np.concatenate([[True], nodes.broken[:-1]])
    for j in range(3):
        equations.H[starts, j, j] += 1.0 / OPEN**2
