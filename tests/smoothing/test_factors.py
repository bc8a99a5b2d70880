"""Each factor's row of the normal equations against residuals that SciPy's rotations make."""

import numpy as np
import pytest
from flights import samples
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from attest.geometry import quaternion
from attest.smoothing import chain, factors, inputs
from attest.smoothing.factors import CONSTANTS, NODE
from attest.smoothing.path import Expected, Nodes, Path
from attest.smoothing.stretch import Log

N, H = 12, 0.02
NORTH = np.array([0.4, 0.1, -0.9])
UP = np.array([0.0, 0.0, 9.8])
NOISE = Expected(
    scale=0.0,
    bias_walk=0.01,
    rest_rate=0.001,
    rest_speed=0.05,
    speed=3.0,
    aided_speed=1.0,
    speed_time=0.5,
    field=0.03,
    field_time=10.0,
    field_delay=0.0,
    direction=0.03,
    direction_time=1.0,
    tails=False,
)


def log(rng, **other):
    """Return measurements that fit each other by chance only."""
    none = np.zeros(N, np.bool_)
    made = Log(
        h=np.full(N, H),
        gyro=np.array([0.5, -0.3, 0.8]) + 0.02 * rng.normal(size=(N, 3)),
        turn_noise=np.full(N, 1e-4),
        force=UP + rng.normal(size=(N, 3)),
        push_noise=np.full(N, 1e-3),
        expected=UP[np.newaxis],
        force_valid=none,
        field=rng.normal(size=(N, 3)),
        field_valid=none,
        measured=rng.normal(size=(N, 1, 3)),
        known=rng.normal(size=(1, 1, 3)),
        valid=none[:, np.newaxis],
    )
    return made._replace(**other)


def path(rng, first):
    """Return two nodes whose attitudes differ by about what the gyroscope turns."""
    q = Rotation.random(random_state=1).as_quat(scalar_first=True)
    c = 0.01 * rng.normal(size=CONSTANTS)
    c[[12, 14]] += 1.0
    p = Path(np.stack([q, q]), rng.normal(size=(2, 3)), 0.01 * rng.normal(size=(2, 3)), c)
    _, _, end = body_to_world(first, p, N - 1)
    near = Rotation.from_rotvec(0.002 * rng.normal(size=3)) * end
    return p._replace(q=np.stack([q, near.as_quat(scalar_first=True)]))


def moved(p, x):
    """Return the path changed by x: two nodes' theta, v, b, and the constants."""
    nodes, c = x[: 2 * NODE].reshape(2, NODE), x[2 * NODE :]
    return Path(
        quaternion.multiply(quaternion.exp(nodes[:, :3]), p.q),
        p.v + nodes[:, 3:6],
        p.b + nodes[:, 6:],
        p.c + c,
    )


def body_to_world(log, p, last):
    """Return the attitudes at each step and amid it, by SciPy; the last is the second node's."""
    M = np.eye(3) + p.c[:9].reshape(3, 3)
    ends = np.concatenate([log.gyro[1:], log.gyro[-1:]])
    rate = (0.5 * (log.gyro + ends) - p.b[0]) @ M.T
    R = Rotation.from_quat(p.q[0], scalar_first=True)
    begins, middles = [], []
    for i in range(last):
        begins.append(R)
        middles.append(R * Rotation.from_rotvec(0.5 * H * rate[i]))
        R = R * Rotation.from_rotvec(H * rate[i])
    return begins, middles, R


def residual(log, p, last=N - 1):
    """Return the weighed residuals of all factors, transcribed."""
    begins, middles, end = body_to_world(log, p, last)
    following = Rotation.from_quat(p.q[1], scalar_first=True)
    off = (following * end.inv()).as_rotvec()
    time = H * last
    out = [off / np.sqrt(1e-4 * last + 1e-12), (p.b[1] - p.b[0]) / np.sqrt(1e-4 * time + 1e-14)]
    if log.force_valid.any():
        f = 0.5 * (log.force[:-1] + log.force[1:]) - p.c[15:18]
        felt = sum(R.apply(f_i) for R, f_i in zip(middles, f, strict=False)) * H
        felt = Rotation.from_rotvec(0.5 * off).apply(felt) - p.c[14] * log.expected[0] * time
        out.append((p.v[1] - p.v[0] - felt) / np.sqrt(1e-3 * last + 1e-8))
    if log.field_valid.any():
        at = (last - 1) / 2 / last
        seen = np.mean([R.apply(m - p.c[9:12]) for R, m in zip(begins, log.field, strict=False)], 0)
        r = Rotation.from_rotvec(at * off).apply(seen) - p.c[12] * NORTH - p.c[13] * np.eye(3)[2]
        drift = 1e-4 * last
        same = min(10.0, 0.03**2 * time / drift)
        out.append(r / 0.03 * np.sqrt(time / max(same, time)))
    if log.valid.any():
        at = (last - 1) / 2 / last
        u = log.measured[:, 0]
        seen = np.mean([R.apply(u_i) for R, u_i in zip(begins, u, strict=False)], axis=0)
        out.append(
            (Rotation.from_rotvec(at * off).apply(seen) - log.known[0, 0]) / 0.03 * np.sqrt(time)
        )
    speeds = p.v / 3.0 * np.sqrt(min(1.0, time / 0.5))
    return np.concatenate([*out, *speeds])


def built(log, p):
    """Return the whole normal equations of two nodes, dense, and their right side."""
    none = np.zeros(2, np.bool_)
    nodes = Nodes(np.array([0, N - 1]), none, np.zeros(2), np.zeros(2), none)
    made = chain.empty(2, NODE, CONSTANTS)
    factors.build(made, log, nodes, p, tuple(NORTH.tolist()), NOISE, np.empty((2, 2)))
    A = np.zeros((2 * NODE + CONSTANTS,) * 2)
    A[:NODE, :NODE], A[NODE : 2 * NODE, NODE : 2 * NODE] = made.H
    A[:NODE, NODE : 2 * NODE], A[NODE : 2 * NODE, :NODE] = made.U[0], made.U[0].T
    A[: 2 * NODE, 2 * NODE :] = np.concatenate(made.B[:, :, :-1])
    A[2 * NODE :, : 2 * NODE] = A[: 2 * NODE, 2 * NODE :].T
    A[2 * NODE :, 2 * NODE :] = made.C[:, :-1]
    return A, np.concatenate([made.B[0, :, -1], made.B[1, :, -1], made.C[:, -1]])


ALL = np.ones(N, np.bool_)


@pytest.mark.parametrize(
    "seen",
    [{}, {"force_valid": ALL}, {"field_valid": ALL}, {"valid": ALL[:, np.newaxis]}],
    ids=["gyroscope", "velocity", "field", "direction"],
)
def test_normal_equations_are_those_of_the_transcribed_residuals(seen):
    rng = np.random.default_rng(5)
    made = log(rng, **seen)
    p = path(rng, made)
    zero, h = np.zeros(2 * NODE + CONSTANTS), 1e-6
    J = np.stack(
        [
            (residual(made, moved(p, zero + h * e)) - residual(made, moved(p, zero - h * e)))
            / (2 * h)
            for e in np.eye(len(zero))
        ],
        axis=1,
    )
    A, b = built(made, p)
    # errors are taken as small, and to grow linearly from one node to the next, which those of
    # bias and scale do at a steady rate to some hundredths; residuals are exact
    scale = np.sqrt(np.outer(np.diag(J.T @ J) + 1.0, np.diag(J.T @ J) + 1.0))
    assert_allclose(A / scale, J.T @ J / scale, atol=0.03)
    expected = -J.T @ residual(made, p)
    assert_allclose(b, expected, atol=0.03 * np.abs(expected).max())


@pytest.mark.parametrize("gap", [5.0, 3600.0])
def test_a_bias_wanders_over_a_restart_for_as_long_as_that_lasts(gap):
    rng = np.random.default_rng(5)
    made = chain.empty(2, NODE, CONSTANTS)
    none = np.zeros(2, np.bool_)
    nodes = Nodes(np.array([0, 1]), ~none, np.array([gap, 0.0]), np.zeros(2), none)
    measured = log(rng)
    p = path(rng, measured)
    factors.build(made, measured, nodes, p, tuple(NORTH.tolist()), NOISE, np.empty((2, 2)))
    assert_allclose(np.diag(made.H[1])[6:], 1.0 / (NOISE.bias_walk**2 * gap + 1e-14))


def test_the_gap_of_a_restart_is_as_long_as_nothing_is_measured():
    t = np.concatenate([np.arange(100), 1000 + np.arange(50)]) * 10_000_000
    restart = np.isin(np.arange(150), [0, 100])
    body = np.tile(np.eye(3)[:1], (150, 1, 1))
    made = inputs.nodes(samples(t, np.zeros((150, 3)), body, body[:1], restart=restart), 0.25)
    (at,) = np.flatnonzero(made.broken)
    assert made.at[at] == 99
    assert_allclose(made.gap, np.where(made.broken, 9.01, 0.0))


def test_an_outlier_counts_for_less_and_never_for_nothing():
    count = [factors.weight((x, 0.0, 0.0), 1.0, True) for x in (0.0, 1.0, 10.0, 1e3)]
    assert count[0] == 1.0
    assert np.all(np.diff(count) < 0.0)
    assert count[-1] > 0.0
    # Student's t of 3 degrees over 3 axes: weight (3 + 3)/(3 + r²), in units of its centre's 2
    assert_allclose(count[2], 6.0 / 106.0)
    assert factors.weight((1e3, 0.0, 0.0), 1.0, False) == 1.0
