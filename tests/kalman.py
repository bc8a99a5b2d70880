"""What the tests of the filters that carry a covariance of attitude and bias share."""

from dataclasses import replace

import numpy as np
import observing
from flights import angle_deg
from numpy.testing import assert_allclose
from strategies import arrays


def split(P):
    """Return blocks P_a, P_c, P_b of P (6, 6)."""
    return P[:3, :3], P[:3, 3:], P[3:, 3:]


def tuples(blocks):
    """Return blocks as kernels take them."""
    return tuple(tuple(block.ravel().tolist()) for block in blocks)


def blocks(P):
    """Return what `tuples` was given."""
    return tuple(np.array(block).reshape(3, 3) for block in P)


def whole(P):
    """Return P (6, 6) of a kernel's blocks."""
    P_a, P_c, P_b = blocks(P)
    return np.block([[P_a, P_c], [P_c.T, P_b]])


def covariances(least):
    """Return a strategy of covariances (6, 6) whose eigenvalues are at least this."""
    return arrays(36, 1.0).map(
        lambda a: 0.2 * a.reshape(6, 6) @ a.reshape(6, 6).T + least * np.eye(6)
    )


def assert_steps_need_length(observer, case, wide):
    """Steps without length change nothing, short ones little; wide starts at 60 degrees."""
    made = replace(case.samples(), t=np.zeros(len(case.gyro), np.int64))
    found = observer.estimate(made, case.start(wide))
    assert angle_deg(found.q, case.q).max() < 1e-9
    assert_allclose(found.gyro_bias, np.broadcast_to(case.bias, (len(case.gyro), 3)))
    assert_allclose(found.states["attitude_std"], np.deg2rad(60.0))
    short = observer.estimate(replace(case, h=1e-9).samples(), case.start(wide))
    assert angle_deg(short.q, case.q).max() < 1e-4
    assert_allclose(short.states["attitude_std"], found.states["attitude_std"], atol=1e-6)
    return found


def assert_starts_anew(observer, wide, beta):
    """A restart starts attitude and covariance anew and keeps the bias."""
    made, q = observing.restarted(beta)
    found = observer.estimate(made, wide)
    assert angle_deg(found.q[2000], q[2000]) < 1e-5
    assert_allclose(found.states["attitude_std"][2000], np.deg2rad(60.0))
    assert_allclose(found.gyro_bias[2000], found.gyro_bias[1999], atol=1e-4)
    assert_allclose(found.gyro_bias[1999], beta, atol=0.01)
    assert angle_deg(found.q[2000:], q[2000:]).max() < 0.5
