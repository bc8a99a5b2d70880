"""What ties the nodes of a path together, linear about the path as it stands.

A node is attitude, velocity and gyroscope bias. Its errors are theta in the world, R = exp(hat
theta) R_hat, and dv, db. The constants are M (9), the hard iron (3), the field along its known
direction and along the vertical (2), the scale of gravity (1) and the accelerometer's bias (3).
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, so3
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Vector
from attest.smoothing import stretch
from attest.smoothing.chain import Chain
from attest.smoothing.path import Expected, Nodes, Path
from attest.smoothing.stretch import Log, Sums

Array = NDArray[np.float64]

NODE, CONSTANTS = 9, 18
THETA, V, BIAS = 0, 3, 6
"""Of a node; those of the next node follow, and behind them the constants."""
M, IRON, FIELD, GRAVITY, LEAN = 18, 27, 30, 32, 33
"""Columns of the constants."""
TAIL = 3.0
"""Degrees of freedom of Student's t, as which residuals are distributed that outliers are in."""


@kernel
def matrix_of(c: Array) -> Matrix:
    """Return M of the constants."""
    return (c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8])


@kernel
def put(J: Array, column: int, sign: float, A: Matrix) -> None:
    """Put sign A into columns of J (3, 36)."""
    for i in range(3):
        for j in range(3):
            J[i, column + j] = sign * A[3 * i + j]


@kernel
def put_between(J: Array, column: int, at: float, A: Matrix) -> None:
    """Put A into columns of both nodes, for what is felt at a share of the way between them."""
    put(J, column, 1.0 - at, A)
    put(J, NODE + column, at, A)


@kernel
def turn_to(path: Path, k: int, sums: Sums, at: float) -> Matrix:
    """Return the world's turn that takes what the gyroscope makes of R_k to the path there.

    It grows from none at node k to what the two nodes differ by.
    """
    return so3.matrix(so3.exp(so3.scale(at, mismatch(path, k, sums))))


@kernel
def weight(r: Vector, variance: float, tails: bool) -> float:
    """Return what an outlier of r counts for, against 1, [Student's t over three axes]."""
    if not tails:
        return 1.0
    return (TAIL + 3.0) / (TAIL + 3.0 + so3.dot(r, r) / variance)


@kernel
def add(chain: Chain, k: int, J: Array, r: Vector, information: float) -> None:
    """Add the factor information |r + J x|² of node k, the next and the constants, and clear J."""
    H, U, B, C = chain
    for a in range(3):
        for i in range(J.shape[1]):
            w = information * J[a, i]
            if w == 0.0:
                continue
            if i < NODE:
                for j in range(NODE):
                    H[k, i, j] += w * J[a, j]
                    U[k, i, j] += w * J[a, NODE + j]
            elif i < 2 * NODE:
                for j in range(NODE):
                    H[k + 1, i - NODE, j] += w * J[a, NODE + j]
            border = B[k, i] if i < NODE else (B[k + 1, i - NODE] if i < M else C[i - M])
            for j in range(CONSTANTS):
                border[j] += w * J[a, M + j]
            border[CONSTANTS] -= w * r[a]
    J[:] = 0.0


@kernel
def mismatch(path: Path, k: int, sums: Sums) -> Vector:
    """Return log(R_{k+1} R^T), where R is what the gyroscope makes of R_k."""
    q = so3.row4(path.q, k + 1)
    return so3.log(so3.multiply(q, so3.conjugate(so3.from_matrix(sums.R))))


@kernel
def gyroscope(
    chain: Chain, k: int, J: Array, sums: Sums, path: Path, of_M: Array, noise: Expected
) -> None:
    """Tie attitudes by the turn between them: theta_{k+1} - theta_k + S db - of_M dM = 0."""
    r = mismatch(path, k, sums)
    put(J, THETA, -1.0, mat3.IDENTITY)
    put(J, NODE + THETA, 1.0, mat3.IDENTITY)
    put(J, BIAS, 1.0, sums.turned)
    for i in range(3):
        for j in range(9):
            J[i, M + j] = -of_M[i, j]
    variance = sums.turn_noise + noise.scale**2 * sums.turn2 + 1e-12
    add(chain, k, J, r, 1.0 / variance)


@kernel
def bias_walk(chain: Chain, k: int, J: Array, path: Path, time: float, noise: Expected) -> None:
    """Tie the biases of neighbours."""
    put(J, BIAS, -1.0, mat3.IDENTITY)
    put(J, NODE + BIAS, 1.0, mat3.IDENTITY)
    r = so3.sub(so3.row(path.b, k + 1), so3.row(path.b, k))
    add(chain, k, J, r, 1.0 / (noise.bias_walk**2 * time + 1e-14))


@kernel
def rest(
    chain: Chain, k: int, J: Array, sums: Sums, path: Path, nodes: Nodes, noise: Expected
) -> None:
    """Take the mean rate at rest for the bias."""
    put(J, BIAS, 1.0, mat3.IDENTITY)
    r = so3.sub(so3.row(path.b, k), sums.rate)
    variance = noise.rest_rate**2
    told = sums.time / max(nodes.rest[k], sums.time)  # the whole rest tells as much as one value
    add(chain, k, J, r, weight(r, variance, noise.tails) * told / variance)


@kernel
def velocity(chain: Chain, k: int, J: Array, sums: Sums, path: Path) -> None:
    """Tie velocities by specific force: dv_{k+1} - dv_k + hat(R f) theta + R da + e dg = 0."""
    c, T = path.c, turn_to(path, k, sums, 0.5)
    leant = mat3.matmul(T, sums.leant)
    lean = so3.sub(mat3.apply(T, sums.velocity), mat3.apply(leant, (c[15], c[16], c[17])))
    felt = so3.sub(lean, so3.scale(c[14], sums.expected))
    r = so3.sub(so3.sub(so3.row(path.v, k + 1), so3.row(path.v, k)), felt)
    put(J, V, -1.0, mat3.IDENTITY)
    put(J, NODE + V, 1.0, mat3.IDENTITY)
    put_between(J, THETA, 0.5, mat3.hat(lean))
    put(J, LEAN, 1.0, leant)
    for i in range(3):
        J[i, GRAVITY] = sums.expected[i]
    lost = sums.time - sums.force_time
    variance = sums.push_noise + 100.0 * lost * lost + 1e-8
    add(chain, k, J, r, 1.0 / variance)


@kernel
def still(chain: Chain, k: int, path: Path, nodes: Nodes, time: float, noise: Expected) -> None:
    """Expect the velocity of a node to be no more than bodies have, and none at rest."""
    H, _, B, _ = chain
    r = so3.row(path.v, k)
    speed = noise.aided_speed if nodes.moving[k] else noise.speed
    told = min(1.0, time / noise.speed_time)
    if nodes.rest[k] > 0.0:
        speed, told = noise.rest_speed, min(1.0, time / nodes.rest[k])
    information = weight(r, speed * speed, noise.tails) * told / (speed * speed)
    for i in range(3):
        H[k, V + i, V + i] += information
        B[k, V + i, CONSTANTS] -= information * r[i]


@kernel
def field(
    chain: Chain, k: int, J: Array, sums: Sums, path: Path, nodes: Nodes, north: Vector,
    noise: Expected,
) -> tuple[float, float]:  # fmt: skip
    """Compare the mean field, less the hard iron, with the world's.

    Return what that counts for, and the variance of an axis that it shows, less the delay's.
    """
    c, T = path.c, turn_to(path, k, sums, sums.field_at)
    R = mat3.matmul(T, sums.field_R)
    seen = so3.sub(mat3.apply(T, sums.field), mat3.apply(R, (c[9], c[10], c[11])))
    r = so3.sub(so3.sub(seen, so3.scale(c[12], north)), (0.0, 0.0, c[13]))
    put_between(J, THETA, sums.field_at, mat3.times(-1.0, mat3.hat(seen)))
    put(J, IRON, -1.0, R)
    for i in range(3):
        J[i, FIELD] = -north[i]
    J[2, FIELD + 1] = -1.0
    late2 = noise.field_delay**2 * sums.turn2 / max(sums.time, 1e-12)
    variance = noise.field**2 + late2
    # values that are off by the same count as one, as far as the gyroscope leads from each to each
    drift = sums.turn_noise + noise.scale**2 * sums.turn2
    same = min(max(noise.field_time, nodes.rest[k]), noise.field**2 * sums.time / max(drift, 1e-12))
    told = sums.time / max(same, sums.time)
    counts = weight(r, variance, noise.tails)
    add(chain, k, J, r, counts * told / variance)
    return counts, max(so3.dot(r, r) / 3.0 - late2, 0.0)


@kernel
def direction(
    chain: Chain, k: int, J: Array, log: Log, path: Path, nodes: Nodes, sums: Sums, j: int,
    noise: Expected,
) -> None:  # fmt: skip
    """Compare the mean of any other measured direction with what it should be."""
    q, b, M_hat = so3.row4(path.q, k), so3.row(path.b, k), matrix_of(path.c)
    u, e, at, seen = stretch.mean_direction(log, nodes.at[k], nodes.at[k + 1], q, b, M_hat, j)
    if seen == 0:
        return
    u = mat3.apply(turn_to(path, k, sums, at), u)
    put_between(J, THETA, at, mat3.times(-1.0, mat3.hat(u)))
    variance, r = noise.direction**2, so3.sub(u, e)
    told = sums.time / max(noise.direction_time, sums.time)
    add(chain, k, J, r, weight(r, variance, noise.tails) * told / variance)


@kernel
def build(
    chain: Chain, log: Log, nodes: Nodes, path: Path, north: Vector, noise: Expected, fields: Array
) -> None:
    """Add all factors; fields (N, 2) is what `field` returns of each stretch, NaN of none."""
    J, of_M = np.zeros((3, 2 * NODE + CONSTANTS)), np.empty((3, 9))
    M_hat, time = matrix_of(path.c), 0.0
    fields[:] = np.nan
    for k in range(len(nodes.at) - 1):
        first, last = nodes.at[k], nodes.at[k + 1]
        if nodes.broken[k]:
            bias_walk(chain, k, J, path, nodes.gap[k], noise)
            still(chain, k, path, nodes, time, noise)
            continue
        q, b = so3.row4(path.q, k), so3.row(path.b, k)
        sums = stretch.add_up(log, first, last, q, b, M_hat, of_M)
        time = sums.time
        gyroscope(chain, k, J, sums, path, of_M, noise)
        bias_walk(chain, k, J, path, time, noise)
        still(chain, k, path, nodes, time, noise)
        if sums.force_time > 0.0:
            velocity(chain, k, J, sums, path)
        if nodes.rest[k] > 0.0:
            rest(chain, k, J, sums, path, nodes, noise)
        if sums.fields > 0:
            counted, shown = field(chain, k, J, sums, path, nodes, north, noise)
            fields[k, 0], fields[k, 1] = counted, shown
        for j in range(log.valid.shape[1]):
            direction(chain, k, J, log, path, nodes, sums, j, noise)
    still(chain, len(nodes.at) - 1, path, nodes, time, noise)
