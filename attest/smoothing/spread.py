"""From the nodes to every step: the gyroscope carries on between them."""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, so3
from attest.geometry.jit import kernel
from attest.smoothing import stretch
from attest.smoothing.factors import matrix_of, mismatch
from attest.smoothing.path import Nodes, Path
from attest.smoothing.stretch import Log

Array = NDArray[np.float64]

COLUMNS = 16
"""q (4), rate (3), bias (3), and the attitude's covariance in the world, by rows of its upper half
(6)."""


@kernel
def spread(log: Log, nodes: Nodes, path: Path, P: Array, out: Array) -> None:
    """Fill out (n, 16) from the path and its covariances (N, 9, 9).

    What the gyroscope is off by at the next node grows linearly from the one before.
    """
    last_node, of_M = len(nodes.at) - 1, np.empty((3, 9))
    for k in range(last_node + 1):
        alone = k == last_node or nodes.broken[k]  # nothing leads on from it
        first = nodes.at[k]
        last = len(log.h) if k == last_node else nodes.at[k + 1]
        following = k if alone else k + 1
        r, time = stretch.ZERO, 0.0
        if not alone:
            q, b = so3.row4(path.q, k), so3.row(path.b, k)
            sums = stretch.add_up(log, first, last, q, b, matrix_of(path.c), of_M)
            r, time = mismatch(path, k, sums), sums.time
        _fill(log, path, P, (k, following), (first, last), r, time, out)


@kernel
def _fill(
    log: Log,
    path: Path,
    P: Array,
    between: tuple[int, int],
    steps: tuple[int, int],
    r: so3.Vector,
    time: float,
    out: Array,
) -> None:
    """Fill the steps between two nodes, which are apart by time and off by r at the second."""
    k, following = between
    N = stretch.of_gyroscope(matrix_of(path.c))
    q, b, past = so3.row4(path.q, k), so3.row(path.b, k), 0.0
    for i in range(steps[0], steps[1]):
        f = past / time if time > 0.0 else 0.0
        here = so3.normalize(so3.multiply(so3.exp(so3.scale(f, r)), q))
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = here
        rate = mat3.apply(N, so3.sub(so3.row(log.gyro, i), b))
        out[i, 4], out[i, 5], out[i, 6] = rate
        column = 10
        for a in range(3):
            out[i, 7 + a] = (1.0 - f) * path.b[k, a] + f * path.b[following, a]
            for c in range(a, 3):
                out[i, column] = (1.0 - f) * P[k, a, c] + f * P[following, a, c]
                column += 1
        half = stretch.half_turn(log.gyro, i, b, N, log.h[i])
        q = so3.multiply(q, so3.exp(so3.scale(2.0, half)))
        past += log.h[i]
