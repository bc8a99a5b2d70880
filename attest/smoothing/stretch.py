"""What the sensors add up to between two nodes: turn, velocity, and the mean field.

Everything is in the world as the path has it. Symbols: R attitude, body to world; omega the
gyroscope; b its bias; M its errors of scale and alignment, so that the rate is (1 + M)(omega - b);
f specific force; m field; e, u known and measured directions.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, so3
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

ZERO: Vector = (0.0, 0.0, 0.0)
NOTHING: Matrix = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Log(NamedTuple):
    """Measurements at n steps; what a log lacks is never valid."""

    h: Array
    """How long each step is, s, (n,); zero before a restart."""
    gyro: Array
    """rad/s, (n, 3)."""
    turn_noise: Array
    """Variance of each step's turn, rad², (n,)."""
    force: Array
    """Specific force, m/s², (n, 3)."""
    push_noise: Array
    """Variance of what each step adds to the velocity, m²/s², (n,)."""
    expected: Array
    """What it would be in the world of a body that moves as the log has it, (n, 3) or (1, 3)."""
    force_valid: Bools
    """At a step and the next."""
    field: Array
    """In units of its usual length, (n, 3)."""
    field_valid: Bools
    measured: Array
    """Further unit vectors in the body, (n, k, 3)."""
    known: Array
    """And in the world, (n, k, 3) or (1, k, 3)."""
    valid: Bools
    """(n, k)."""


class Sums(NamedTuple):
    """Of one stretch between two nodes, whose first attitude is the path's."""

    R: Matrix
    """Attitude at the end."""
    turned: Matrix
    """Of the bias: integral of R (1 + M)."""
    time: float
    """s."""
    turn2: float
    """Integral of the squared rate, rad²/s."""
    turn_noise: float
    """Variance of the turn, rad²."""
    push_noise: float
    """Variance of the velocity, m²/s²."""
    rate: Vector
    """The gyroscope's mean, rad/s."""
    velocity: Vector
    """Integral of R f, where f is valid."""
    leant: Matrix
    """Integral of R there."""
    expected: Vector
    """Integral of what f should be there."""
    force_time: float
    field: Vector
    """Mean of R m, where m is valid."""
    field_R: Matrix
    """Mean of R there."""
    fields: int
    field_at: float
    """When the field was measured in the mean, from 0 at the first node to 1 at the next."""


@kernel
def of_gyroscope(M: Matrix) -> Matrix:
    """Return 1 + M."""
    return mat3.plus(mat3.IDENTITY, M)


@kernel
def half_turn(gyro: Array, i: int, b: Vector, N: Matrix, h: float) -> Vector:
    """Return half the turn of the step from i, N (omega - b) h/2, the gyroscope linear there."""
    return so3.scale(0.5 * h, mat3.apply(N, so3.sub(so3.mean_row(gyro, i), b)))


@kernel
def add_up(
    log: Log, first: int, last: int, q: Quaternion, b: Vector, M: Matrix, of_M: Array
) -> Sums:
    """Add up the steps from first to before last; fill of_M (3, 9), the turn's derivative by M.

    Row by row, M is (M11, M12, ... M33).
    """
    N, R = of_gyroscope(M), so3.matrix(q)
    S, A, F_R = NOTHING, NOTHING, NOTHING
    rate, v, expected, F = ZERO, ZERO, ZERO, ZERO
    time, turn2, force_time, fields = 0.0, 0.0, 0.0, 0
    turn_noise, push_noise, field_at = 0.0, 0.0, 0.0
    of_M[:] = 0.0
    for i in range(first, last):
        h = log.h[i]
        if log.field_valid[i]:
            F = so3.add(F, mat3.apply(R, so3.row(log.field, i)))
            F_R = mat3.plus(F_R, R)
            fields += 1
            field_at += time
        half = half_turn(log.gyro, i, b, N, h)
        E = so3.matrix(so3.exp(half))
        R = mat3.matmul(R, E)  # in the middle of the step
        if log.force_valid[i]:
            v = so3.add(v, so3.scale(h, mat3.apply(R, so3.mean_row(log.force, i))))
            A = mat3.plus(A, mat3.times(h, R))
            j = i if len(log.expected) > 1 else 0
            expected = so3.add(expected, so3.scale(h, so3.mean_row(log.expected, j)))
            force_time += h
        rate = so3.add(rate, so3.scale(h, so3.mean_row(log.gyro, i)))
        _derivative(of_M, R, so3.scale(h, so3.sub(so3.mean_row(log.gyro, i), b)))
        S = mat3.plus(S, mat3.times(h, R))
        time += h
        turn_noise += log.turn_noise[i]
        push_noise += log.push_noise[i]
        turn2 += 4.0 * so3.dot(half, half) / h if h > 0.0 else 0.0
        R = mat3.matmul(R, E)
    over, share = 1.0 / max(time, 1e-12), 1.0 / max(fields, 1)
    return Sums(
        R, mat3.matmul(S, N), time, turn2, turn_noise, push_noise, so3.scale(over, rate), v, A,
        expected, force_time, so3.scale(share, F), mat3.times(share, F_R), fields,
        share * over * field_at,
    )  # fmt: skip


@kernel
def _derivative(of_M: Array, R: Matrix, turn: Vector) -> None:
    """Add R (turn by M) to of_M: the column of M_cd is R's column c times turn's d."""
    for a in range(3):
        for c in range(3):
            for d in range(3):
                of_M[a, 3 * c + d] += R[3 * a + c] * turn[d]


@kernel
def mean_direction(
    log: Log, first: int, last: int, q: Quaternion, b: Vector, M: Matrix, j: int
) -> tuple[Vector, Vector, float, int]:
    """Return the means of R u and of e for direction j, when that was, and of how many steps."""
    N, R, u, e, count = of_gyroscope(M), so3.matrix(q), ZERO, ZERO, 0
    time, at = 0.0, 0.0
    for i in range(first, last):
        if log.valid[i, j]:
            u = so3.add(u, mat3.apply(R, so3.item(log.measured, i, j)))
            e = so3.add(e, so3.item(log.known, i if len(log.known) > 1 else 0, j))
            count += 1
            at += time
        half = half_turn(log.gyro, i, b, N, log.h[i])
        R = mat3.matmul(R, so3.matrix(so3.exp(so3.scale(2.0, half))))
        time += log.h[i]
    share = 1.0 / max(count, 1)
    return so3.scale(share, u), so3.scale(share, e), share * at / max(time, 1e-12), count
