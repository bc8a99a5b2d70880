"""What the tests of the observers that take weights of axes or of vectors share."""

import numpy as np
import observing
import papers
from flights import angle_deg
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from observing import IDENTITY

from attest import config
from attest.geometry import quaternion

DOWN = np.array([[0.0, 0.0, -1.0]])

per_vector = st.lists(st.floats(0.1, 5.0), min_size=5, max_size=5)


def with_w(settings, w):
    """Return a configuration with these weights of the vectors; as it is for None."""
    if w is None:
        return settings
    named = {f"v{i + 1}": float(w_i) for i, w_i in enumerate(w)}
    return settings.model_copy(update={"weights": config.VectorWeights(w=named)})


def with_gains(settings, g):
    """Return a configuration with these gains."""
    return settings.model_copy(update={"gains": g})


def assert_weights_turn_along(observer, case, settings, Q):
    """The world may be turned by one of `axis_turns` if the weights of its axes turn along."""
    k = observing.turned_weights(settings.weights.k, Q)
    along = settings.model_copy(update={"weights": config.VectorWeights(k=k)})
    here = observer.estimate(case.samples(), case.start(settings))
    there = case.in_a_turned_world(Q)
    there = observer.estimate(there.samples(), there.start(along))
    observing.assert_turned_world(here, there, Q)


def assert_world_may_turn(observer, case, settings, Q):
    """With weights of the vectors a run is the same in any world."""
    here = observer.estimate(case.samples(), case.start(settings))
    there = case.in_a_turned_world(Q)
    there = observer.estimate(there.samples(), there.start(settings))
    observing.assert_turned_world(here, there, Q)


def assert_body_may_turn(observer, case, settings, Q):
    """However the sensors are mounted, a run is the same."""
    here = observer.estimate(case.samples(), case.start(settings))
    there = case.in_a_turned_body(Q)
    there = observer.estimate(there.samples(), there.start(settings))
    observing.assert_turned_body(here, there, Q)


def assert_diagnostics(observer, case, settings, w):
    """s_norm and cost are the papers', by weights of the axes and of the vectors."""
    three, U3 = papers.joined(case.E.T, case.U[0].T)
    of_vectors = np.diag(w[: len(case.E)])
    for chosen, e, u, W in (
        (settings, three, U3, papers.W(three, np.diag(settings.weights.k))),
        (with_w(settings, w), case.E.T, case.U[0].T, of_vectors),
    ):
        found = observer.estimate(case.samples(), case.start(chosen))
        R = quaternion.to_matrix(case.q)
        left, s = e - R @ u, papers.s_L(R, e @ W @ u.T)
        assert_allclose(found.s_norm[0], np.linalg.norm(s), atol=1e-8)
        assert_allclose(found.cost[0], 0.5 * np.trace(left.T @ left @ W), atol=1e-8)


def assert_stays_at_rest(observer, settings):
    """A perfect estimate of a body at rest stays where it is."""
    found = observer.estimate(observing.at_rest(50), observing.starting(settings))
    assert_allclose(found.q, np.broadcast_to(IDENTITY, (50, 4)))
    for still in (found.s_norm, found.gyro_bias, found.angular_velocity):
        assert not still.any()


def assert_integrates(observer):
    """Without vectors, the estimate is the integrated gyroscope; return it."""
    Omega = observing.motion(500)
    nothing = observing.sampled(Omega, np.empty((500, 0, 3)), [])
    found = observer.estimate(nothing, observer.Config())
    assert angle_deg(found.q, observing.truth(IDENTITY, Omega)).max() < 1e-6
    assert not found.gyro_bias.any()
    return found


def one_vector(n):
    """Return samples of a body that turns slowly and sees one vector, and the truth."""
    gyro = np.tile([0.0, 0.0, 0.02], (n, 1))
    q = observing.truth(quaternion.exp(np.array([0.4, -0.3, 0.0])), gyro)
    return observing.sampled(gyro, observing.seen(q, DOWN), DOWN), q


def assert_follows_one_vector(observer, settings, n):
    """One vector is followed; return the estimate."""
    made, _ = one_vector(n)
    found = observer.estimate(made, observing.starting(settings))
    assert_allclose(quaternion.rotate(found.q[-1], made.body[-1, 0]), DOWN[0], atol=1e-3)
    return found


def assert_leaves_a_half_turn(observer, settings, half_turn, n, within_deg):
    """A half turn off is an equilibrium that any push leaves."""
    made, q = observing.at_rest(n), quaternion.exp(half_turn)
    stuck = observer.estimate(made, observing.starting(settings, q))
    observing.assert_sound(stuck)
    assert stuck.s_norm[0] < 1e-14
    pushed = quaternion.multiply(quaternion.exp(np.full(3, 1e-6)), q)
    left = observer.estimate(made, observing.starting(settings, pushed))
    assert angle_deg(left.q[-1], IDENTITY) < within_deg
