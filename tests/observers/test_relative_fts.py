from dataclasses import replace
from itertools import combinations

import numpy as np
import observing
import papers
import papers_rigid
import pytest
from flights import START, angle_deg, recording
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from observing import HALF_TURNS, IDENTITY, H
from papers_rigid import biased
from scipy.signal import lsim
from strategies import arrays, frames, rotations, vectors, weights

from attest import config
from attest.conditioning import condition
from attest.errors import ConfigError
from attest.geometry import mat3, quaternion, so3
from attest.observers import relative_fts
from attest.recording import Signal

PAPER = relative_fts.Config(
    gains=relative_fts.Gains(k_p=3.0, p=1.1, mu=0.414, w_n=80.0 * np.pi),
    weights=config.Weights(k=(3.0, 2.0, 1.0)),
)
"""Gains of [REL] section 4."""
D = np.vstack([np.eye(3), np.array([1.0, 2.0, 1.0]) / np.sqrt(6.0)])
"""The four vectors of [REL] section 4."""
PLACES = {
    "point1": (0.5, 0.0, 0.1),
    "point2": (0.0, 0.4, -0.2),
    "point3": (-0.3, 0.0, 0.6),
    "point4": (0.2, -0.5, 0.0),
}
"""Feature points on an object, m."""
LAG = np.rad2deg(2.0 * 0.414 / (80.0 * np.pi))
"""What the filter's lag makes of a rate of 1 rad/s, degrees."""

AT_REST = 10
"""Steps after which it no longer shows that the filter starts at rest."""

gains = st.builds(
    relative_fts.Gains,
    k_p=st.floats(0.1, 5.0),
    p=st.floats(1.01, 1.99),
    mu=st.floats(0.1, 2.0),
    w_n=st.floats(1.0, 1000.0),
)


def moving(n, q_0=IDENTITY, rows=D):
    """Return samples of vectors over motion (96), their true attitudes and rates."""
    Omega = observing.motion(n)
    q = observing.truth(q_0, Omega)
    return observing.sampled(np.full((n, 3), np.nan), observing.seen(q, rows), rows), q, Omega


def start_at(q, settings=PAPER):
    return observing.starting(settings, q)


@given(data=st.data(), last=vectors())
def test_the_rate_is_eqs_9_to_12(data, last):
    l_f = data.draw(frames(data.draw(st.integers(2, 5))))
    l_dot = data.draw(arrays(3 * len(l_f), 10.0)).reshape(-1, 3)
    valid = np.ones((1, len(l_f)), np.bool_)
    found = relative_fts.rate(l_f[np.newaxis], l_dot, valid, 0, so3.as_vector(last))
    G = np.vstack([papers.hat(column) for column in l_f])
    assert_allclose(found, np.linalg.pinv(G) @ l_dot.ravel(), atol=1e-8)
    assert_allclose(found, papers_rigid.Omega_f(l_f.T, l_dot.T), atol=1e-8)


@given(data=st.data(), last=vectors())
def test_columns_that_are_not_valid_are_not_in_the_rate(data, last):
    l_f, l_dot = data.draw(frames(5)), data.draw(arrays(15, 10.0)).reshape(-1, 3)
    valid = np.array([[True, False, True, False, True]])
    found = relative_fts.rate(l_f[np.newaxis], l_dot, valid, 0, so3.as_vector(last))
    of_valid = papers_rigid.Omega_f(l_f[valid[0]].T, l_dot[valid[0]].T)
    assert_allclose(found, of_valid, rtol=1e-6, atol=1e-7)


@given(Omega=vectors(), last=vectors(), count=st.integers(1, 3))
def test_along_one_direction_the_rate_about_it_is_the_last_one(Omega, last, count):
    along = np.array([0.6, 0.0, -0.8])
    l_f = np.outer([1.0, -0.5, 2.0][:count], along)
    l_dot = np.cross(l_f, Omega)
    valid = np.ones((1, count), np.bool_)
    found = relative_fts.rate(l_f[np.newaxis], l_dot, valid, 0, so3.as_vector(last))
    assert_allclose(found, Omega + (last - Omega) @ along * along, atol=1e-9)


def test_without_a_column_the_rate_is_the_last_one():
    nothing = np.zeros((1, 3, 3)), np.zeros((3, 3)), np.zeros((1, 3), np.bool_)
    assert relative_fts.rate(*nothing, 0, (1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)


@given(case=observing.cases(n=1), Omega=vectors(5.0), k=weights, g=gains)
def test_a_step_is_eqs_40_to_42(case, Omega, k, g):
    d, x = papers.joined(case.E.T, case.U[0].T)
    Gamma, R = d @ papers.W(d, np.diag(k)) @ x.T, quaternion.to_matrix(case.q)
    s = papers.s_L(R, Gamma)
    assume(s @ s > 1e-6)
    omega = g.k_p * R @ s / (s @ s) ** (1.0 - 1.0 / g.p)  # (40)
    Omega_hat = Omega - R.T @ omega  # (41)
    args = so3.as_vector(Omega), mat3.matrix_row(Gamma.reshape(1, 9), 0), H, g.k_p, g.p
    q, rate, residual, _ = relative_fts.step(so3.as_quaternion(case.q), *args)
    assert_allclose(residual, s, atol=1e-9 * max(k))
    assert_allclose(rate, Omega_hat, atol=1e-7 * max(k) * g.k_p)
    turned = R @ papers.exp(H * Omega_hat)  # (42)
    assert_allclose(quaternion.to_matrix(np.array(q)), turned, atol=1e-8 * max(k) * g.k_p)


@pytest.mark.parametrize("rows", [D, D[:3], D[[0, 3]]])
@given(q=rotations, k=weights, g=gains)
@settings(max_examples=10)
def test_a_run_is_the_paper_from_measurement_to_estimate(rows, q, k, g):
    made, *_ = moving(25, quaternion.exp(np.array([1.0, -2.0, 0.5])), rows)
    chosen = PAPER.model_copy(update={"gains": g, "weights": config.Weights(k=tuple(k.tolist()))})
    found = relative_fts.estimate(made, start_at(q, chosen))
    measured = np.moveaxis(made.body, 2, 1)
    numbers = (g.k_p, g.p, g.mu, g.w_n)
    R, Omega_hat = papers_rigid.relative_fts(
        rows.T, measured, quaternion.to_matrix(q), H, np.diag(k), *numbers
    )
    assume(found.s_norm.min() > 1e-2)  # at an equilibrium rounding chooses the way out
    assert_allclose(quaternion.to_matrix(found.q), R, atol=1e-6)
    assert_allclose(found.angular_velocity, Omega_hat, atol=1e-4)
    assert found.gyro_bias is None


@given(
    state=arrays(3, 10.0),
    measured=st.floats(-10.0, 10.0),
    h=st.floats(1e-4, 1.0),
    g=gains,
)
def test_a_step_of_the_filter_is_newmarks_three_equations(state, measured, h, g):
    found = relative_fts.newmark(so3.as_vector(state), measured, h, g.mu, g.w_n)
    expected = papers_rigid.newmark(*state, measured, h, g.mu, g.w_n)
    scale = 1.0 + np.abs(expected).max()
    assert_allclose(found, expected, atol=1e-9 * scale)


def filtered(x_m, h, mu, w_n, state=(0.0, 0.0, 0.0)):
    """Return x, x', x'' (n, 3) of a filter at rest that is fed x_m (n,)."""
    rows = [state]
    for measured in x_m[1:]:
        rows.append(relative_fts.newmark(rows[-1], measured, h, mu, w_n))
    return np.array(rows)


@pytest.mark.parametrize("mu", [0.414, 0.707, 1.5])
def test_in_fine_steps_the_filter_is_the_second_order_one(mu):
    h, w_n = 1e-4, 80.0 * np.pi
    t = h * np.arange(2000)
    x_m = np.sin(20.0 * t) - 0.4 * (np.cos(90.0 * t) - 1.0)
    system = [w_n**2], [1.0, 2.0 * mu * w_n, w_n**2]
    _, x, _ = lsim(system, x_m, t)
    _, v, _ = lsim(([w_n**2, 0.0], system[1]), x_m, t)
    found = filtered(x_m, h, mu, w_n, (0.0, 0.0, 0.0))
    assert_allclose(found[:, 0], x, atol=1e-4)
    assert_allclose(found[:, 1], v, atol=1e-2)


def test_the_filters_error_is_of_second_order_in_the_step():
    errors, w_n = [], 80.0 * np.pi
    for h in (4e-4, 2e-4, 1e-4):
        t = h * np.arange(round(0.1 / h) + 1)
        x_m = 1.0 - np.cos(40.0 * t)
        _, x, _ = lsim(([w_n**2], [1.0, 2.0 * 0.414 * w_n, w_n**2]), x_m, t)
        errors.append(np.abs(filtered(x_m, h, 0.414, w_n)[:, 0] - x).max())
    assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.2)


@pytest.mark.parametrize("h", [1e-4, 0.01, 0.1])
def test_the_filter_keeps_what_does_not_change_exactly(h):
    settled = filtered(np.full(500, 0.7), h, 0.414, 80.0 * np.pi, (0.7, 0.0, 0.0))
    assert_allclose(settled, np.tile([0.7, 0.0, 0.0], (500, 1)), atol=1e-15)
    risen = filtered(np.full(2000, 0.7), 0.01, 0.414, 80.0 * np.pi)
    assert_allclose(risen[-1], [0.7, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("reach", [0.1, 2.0, 10.0, 1000.0])
def test_the_filter_is_stable_at_any_step(reach):
    """x'²/2 + w_n² x²/2 never grows without input: at w_n h = 10 too."""
    h, w_n = 0.01, reach / 0.01
    state = (1.0, 0.5 * w_n, -2.0 * 0.414 * w_n * 0.5 * w_n - w_n**2)  # at which (5) holds
    rows = filtered(np.zeros(3000), h, 0.414, w_n, state)
    energy = rows[:, 1] ** 2 + w_n**2 * rows[:, 0] ** 2
    assert (np.diff(energy) <= 1e-9 * energy[0]).all()
    assert energy[-1] < 1e-3 * energy[0]


def test_the_filter_lags_by_twice_its_damping_over_its_frequency():
    ramp = filtered(H * np.arange(500), H, 0.414, 80.0 * np.pi)
    assert_allclose(H * 499 - ramp[-1, 0], 2.0 * 0.414 / (80.0 * np.pi), rtol=1e-6)
    assert_allclose(ramp[-1, 1], 1.0, rtol=1e-6)


def test_experiment_4_converges_and_stays_at_the_lag_of_the_filter():
    made, q, Omega = moving(3001, quaternion.exp(HALF_TURNS[0]))
    found = relative_fts.estimate(made, start_at(IDENTITY))
    error = angle_deg(found.q, q)
    assert_allclose(error[0], 180.0)
    assert error[200:].max() < 0.3
    lag = LAG * np.linalg.norm(Omega, axis=1)
    # the motion turns meanwhile, and steps of (42) hold the rate: half a step
    assert_allclose(error[500:], lag[500:], atol=0.12)
    assert_allclose(found.states["filtered_rate"][500:], Omega[500:], atol=0.02)
    assert_allclose(found.angular_velocity[500:], Omega[500:], atol=0.02)


def test_experiment_4_with_noise_stays_near():
    made, q, _ = moving(3001, quaternion.exp(HALF_TURNS[0]))
    rng = np.random.default_rng(1)
    noisy = replace(made, body=made.body + 0.01 * rng.normal(size=made.body.shape))
    for w_n, bound in ((80.0 * np.pi, 3.0), (20.0, 5.0)):
        chosen = PAPER.model_copy(update={"gains": relative_fts.Gains(w_n=w_n)})
        error = angle_deg(relative_fts.estimate(noisy, start_at(IDENTITY, chosen)).q, q)
        assert error[300:].max() < bound


@given(case=observing.cases(), Q=observing.axis_turns)
def test_a_run_does_not_care_how_the_object_is_turned_if_its_weights_turn_along(case, Q):
    here = relative_fts.estimate(case.samples(), case.start(PAPER))
    assume(here.s_norm.min() > 1e-3)
    turned = case.in_a_turned_world(Q)
    k = config.Weights(k=observing.turned_weights(PAPER.weights.k, Q))
    there = relative_fts.estimate(
        turned.samples(), turned.start(PAPER.model_copy(update={"weights": k}))
    )
    observing.assert_turned_world(biased(here), biased(there), Q, atol=1e-6)


@given(case=observing.cases(), Q=rotations)
def test_a_run_does_not_care_how_the_sensors_sit_in_the_observer(case, Q):
    here = relative_fts.estimate(case.samples(), case.start(PAPER))
    assume(here.s_norm.min() > 1e-3)
    turned = case.in_a_turned_body(Q)
    there = relative_fts.estimate(turned.samples(), turned.start(PAPER))
    observing.assert_turned_body(biased(here), biased(there), Q, atol=1e-6)


@given(case=observing.cases(), gyro=vectors())
def test_the_gyroscope_is_not_used(case, gyro):
    made, start = case.samples(), case.start(PAPER)
    found = relative_fts.estimate(made, start)
    other = relative_fts.estimate(replace(made, gyro=made.gyro + gyro), start)
    none = relative_fts.estimate(replace(made, gyro=np.full_like(made.gyro, np.nan)), start)
    assert found.q.tobytes() == other.q.tobytes() == none.q.tobytes()


@given(order=st.permutations(range(4)), q=rotations)
@settings(max_examples=15)
def test_the_order_of_the_vectors_changes_nothing(order, q):
    made, *_ = moving(60)
    assume(angle_deg(q, IDENTITY) < 179.0)
    other = replace(made, body=made.body[:, order], inertial=made.inertial[:, order])
    found = [relative_fts.estimate(each, start_at(q)) for each in (made, other)]
    assert angle_deg(found[0].q, found[1].q).max() < 1e-5


@pytest.mark.slow
def test_attitude_stays_a_rotation_over_a_million_steps_without_projection():
    found = relative_fts.estimate(observing.million_steps(), PAPER)
    assert np.abs(np.linalg.norm(found.q, axis=1) - 1.0).max() < 1e-10


@pytest.mark.slow
def test_every_start_but_the_unstable_ones_converges_to_the_lag_of_the_filter():
    """500 starts: 10 s are enough. At rest nothing is left of the error."""
    made, q, Omega = moving(1001)
    still = observing.at_rest(1001, D)
    ends, rests = [], []
    for start in observing.starts():
        ends.append(angle_deg(relative_fts.estimate(made, start_at(start)).q[-1], q[-1]))
        rests.append(angle_deg(relative_fts.estimate(still, start_at(start)).q[-1], IDENTITY))
    assert max(ends) < 0.3
    assert max(ends) - min(ends) < 1e-3
    assert max(rests) < 1e-3
    assert np.linalg.norm(Omega[-1]) > 0.5


@pytest.mark.parametrize("half_turn", HALF_TURNS)
def test_a_half_turn_off_is_an_equilibrium_that_any_push_leaves(half_turn):
    q, made = quaternion.exp(half_turn), observing.at_rest(2000, D)
    stuck = relative_fts.estimate(made, start_at(q))
    observing.assert_sound(biased(stuck))
    assert stuck.s_norm[0] < 1e-12
    pushed = quaternion.multiply(quaternion.exp(np.array([1e-6, 1e-6, 1e-6])), q)
    left = relative_fts.estimate(made, start_at(pushed))
    assert angle_deg(left.q[-1], IDENTITY) < 1e-3


def test_the_lyapunov_function_never_grows_and_falls_as_its_derivative_says():
    """V = U and V' = -k_p (s.s)^(1/p), (43)-(46), at rest, where the filter has no lag."""
    made = observing.at_rest(600, D)
    for start in observing.starts(10):
        found = relative_fts.estimate(made, start_at(start))
        V = found.cost
        assert np.diff(V).max() < 1e-6 * V[0]
        assert V[-1] < 1e-9
    fine = observing.at_rest(2, D, 1e-6)
    for start in observing.starts(40):
        found = relative_fts.estimate(fine, start_at(start))
        expected = -3.0 * found.s_norm[0] ** (2.0 / 1.1)
        assert_allclose(np.diff(found.cost)[0] / 1e-6, expected, rtol=1e-3)


@pytest.mark.parametrize("p", [1.01, 1.1, 1.5, 1.99])
def test_a_perfect_estimate_at_rest_stays_where_it_is(p):
    chosen = PAPER.model_copy(update={"gains": relative_fts.Gains(p=p)})
    found = relative_fts.estimate(observing.at_rest(50), start_at(IDENTITY, chosen))
    assert_allclose(found.q, np.broadcast_to(IDENTITY, (50, 4)))
    assert not found.angular_velocity.any()


def test_steps_without_length_and_of_a_nanosecond_change_next_to_nothing():
    q = quaternion.exp(np.ones(3))
    L = mat3.diagonal((3.0, 2.0, 1.0))
    after, *_ = relative_fts.step(so3.as_quaternion(q), (1.0, 1.0, 1.0), L, 0.0, 3.0, 1.1)
    assert_allclose(after, q, atol=1e-15)
    found = relative_fts.estimate(observing.at_rest(3, h=1e-9), start_at(q))
    observing.assert_sound(biased(found))
    assert_allclose(found.q, np.broadcast_to(q, (3, 4)), atol=1e-7)


@settings(max_examples=150)
@given(made=observing.any_samples())
def test_no_measurement_makes_a_nan(made):
    observing.assert_sound(biased(relative_fts.estimate(made, PAPER)))


def test_gains_too_high_for_the_steps_stay_on_the_rotations():
    """The right side of (40) turns less than half a turn or so at most: nothing overflows."""
    made, *_ = moving(500)
    wild = PAPER.model_copy(update={"gains": relative_fts.Gains(k_p=1e6)})
    observing.assert_sound(biased(relative_fts.estimate(made, wild)))


def test_a_restart_starts_all_anew():
    made, q = observing.restarted(np.zeros(3))
    i = 2000
    found = relative_fts.estimate(made, start_at(quaternion.exp(np.ones(3))))
    alone = observing.sampled(made.gyro[i:], made.body[i:], np.eye(3))
    assert angle_deg(found.q[i:], relative_fts.estimate(alone, PAPER).q).max() < 1e-6
    assert angle_deg(found.q[i], q[i]) < 1e-6


@pytest.mark.parametrize("parts", [2, 5])
def test_sub_steps_are_the_run_of_rates_and_vectors_that_much_finer(parts):
    rng, n = np.random.default_rng(3), 20
    Omega_f, Gamma = rng.normal(size=(n, 3)), 0.3 * rng.normal(size=(n, 10)) + np.eye(10)[0]
    place = np.arange((n - 1) * parts) / parts

    def between(y, shift):
        at = np.minimum(place + shift, n - 1)
        return np.stack([np.interp(at, np.arange(n), column) for column in y.T], axis=1)

    coarse, fine = np.empty((n, 12)), np.empty((len(place), 12))
    start = so3.as_quaternion(quaternion.exp(np.ones(3)))
    h, each = np.full(n, H), np.full(n, parts)
    relative_fts.run(h, each, Omega_f, Gamma, start, 3.0, 1.1, coarse)
    h, each = np.full(len(place), H), np.ones(len(place), np.int64)
    middles = between(Omega_f, 0.5 / parts), between(Gamma, 0.0)
    relative_fts.run(h, each, *middles, start, 3.0, 1.1, fine)
    assert_allclose(coarse[:-1, :4], fine[::parts, :4], atol=1e-12)
    assert_allclose(coarse[:-1, 10:], fine[::parts, 10:], atol=1e-9)


def object_points(n=500, hidden=(), places=PLACES, **configured):
    """Return samples of points in steps of 10 ms over motion (96), notes, settings and truth.

    Each hidden is (name, first, last) in steps.
    """
    Omega = observing.motion(n)
    q = observing.truth(quaternion.exp(np.array([0.4, 0.1, -0.9])), Omega)
    t = START + np.arange(n) * 10_000_000
    centre = np.array([3.0, -1.0, 0.5])
    signals = {}
    for name, place in places.items():
        seen = np.ones(n, np.bool_)
        for _, first, last in (gap for gap in hidden if gap[0] == name):
            seen[first:last] = False
        a = centre + quaternion.rotate(quaternion.conjugate(q), np.array(place))
        signals[name] = Signal(t[seen], a[seen], name)
    chosen = PAPER.model_copy(update={"points": configured.get("points", places)})
    made, notes = condition(recording(signals), chosen)
    return made, notes, chosen, q


def told(notes):
    return {note.text: note.count for note in notes}


HIDDEN = "step with a point hidden: the others are used"
FEW = "step with fewer than three points: the turn that they leave open goes on at its last rate"
LINE = "step whose visible points lie on one line: the turn about it is not observable"


def test_points_give_the_attitude_of_the_observer_in_the_objects_frame():
    made, notes, chosen, q = object_points()
    found = relative_fts.estimate(made, chosen)
    assert found.frames == ("object", "observer")
    assert not notes
    assert angle_deg(found.q, q)[AT_REST:].max() < 0.3
    assert relative_fts.estimate(made, PAPER).frames is None


def test_the_size_of_the_object_changes_nothing():
    _, _, _, q = made_of = object_points()
    large = {name: tuple(100.0 * np.array(place)) for name, place in PLACES.items()}
    scaled = object_points(places=large)
    found = [relative_fts.estimate(made, c) for made, _, c, _ in (made_of, scaled)]
    assert angle_deg(found[0].q, found[1].q).max() < 1e-6
    assert angle_deg(found[1].q, q)[AT_REST:].max() < 0.3


@pytest.mark.parametrize("order", [[3, 2, 1, 0], [1, 3, 0, 2]])
def test_the_order_of_the_points_changes_nothing(order):
    here = object_points()
    there = object_points(points=dict([list(PLACES.items())[i] for i in order]))
    found = [relative_fts.estimate(made, chosen) for made, _, chosen, _ in (here, there)]
    assert angle_deg(found[0].q, found[1].q).max() < 1e-6


def test_points_hidden_for_a_while_are_reported_and_the_others_used():
    made, notes, chosen, q = object_points(hidden=[("point2", 100, 200), ("point4", 250, 300)])
    assert told(notes) == {HIDDEN: 150}
    error = angle_deg(relative_fts.estimate(made, chosen).q, q)
    assert error[AT_REST:].max() < 0.5


def test_every_point_may_be_hidden_in_turn():
    gaps = [(name, 50 * i, 50 * i + 50) for i, name in enumerate(PLACES, start=1)]
    made, _, chosen, q = object_points(hidden=gaps)
    assert angle_deg(relative_fts.estimate(made, chosen).q, q)[AT_REST:].max() < 0.5


def test_two_points_hold_their_direction_and_the_rest_goes_on_with_the_last_rate():
    gaps = [("point3", 200, 250), ("point4", 200, 250)]
    made, notes, chosen, q = object_points(hidden=gaps)
    assert told(notes) == {HIDDEN: 50, FEW: 50}
    assert [note.doubt for note in notes] == [False, True]
    found = relative_fts.estimate(made, chosen)
    observing.assert_sound(biased(found))
    error = angle_deg(found.q, q)
    between = np.subtract(PLACES["point1"], PLACES["point2"])
    along = [
        quaternion.rotate(quaternion.conjugate(each[200:250]), between) for each in (found.q, q)
    ]
    assert_allclose(*along, atol=0.005)
    assert error[:250].max() < 10.0
    assert error[400:].max() < 0.3


def test_without_a_point_the_attitude_goes_on_with_the_last_rate():
    gaps = [(name, 200, 230) for name in ("point1", "point2", "point3")]
    gaps += [("point4", 200, 210), ("point4", 220, 230)]
    made, notes, chosen, q = object_points(hidden=gaps)
    assert len(made.t) == 480
    assert told(notes)[FEW] == 10
    found = relative_fts.estimate(made, chosen)
    observing.assert_sound(biased(found))
    truth = q[np.isin(np.arange(500), (made.t - START) // 10_000_000)]
    error = angle_deg(found.q, truth)
    assert error[:211].max() < 5.0
    assert error[350:].max() < 0.3


def test_points_on_a_line_are_reported_and_make_no_nan():
    places = PLACES | {"point5": (0.25, 0.2, -0.05)}  # between the first two
    gaps = [("point3", 200, 300), ("point4", 200, 300)]
    made, notes, chosen, q = object_points(hidden=gaps, places=places)
    assert told(notes) == {HIDDEN: 100, LINE: 100}
    found = relative_fts.estimate(made, chosen)
    observing.assert_sound(biased(found))
    assert angle_deg(found.q, q)[450:].max() < 0.3


def test_a_point_hidden_at_first_is_waited_for():
    gaps = [("point3", 0, 50), ("point4", 0, 50)]
    made, _, chosen, q = object_points(hidden=gaps)
    found = relative_fts.estimate(made, chosen)
    observing.assert_sound(biased(found))
    assert angle_deg(found.q, q)[250:].max() < 0.3


def pairs_of(places):
    return [np.subtract(places[a], places[b]) for a, b in combinations(places, 2)]


def test_the_vectors_are_the_differences_of_the_points():
    made, *_, q = object_points(10)
    d = np.array(pairs_of(PLACES))
    longest = np.linalg.norm(d, axis=1).max()
    assert_allclose(made.inertial[0], d / longest)
    assert_allclose(made.body, observing.seen(q, d) / longest, atol=1e-12)


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("k_p", 0.0, "greater than 0"),
        ("p", 1.0, "greater than 1"),
        ("p", 2.0, "less than 2"),
        ("mu", 0.0, "greater than 0"),
        ("w_n", -1.0, "greater than 0"),
    ],
)
def test_a_gain_out_of_the_theorems_range_is_refused(key, value, allowed):
    assert observing.refusal(relative_fts, key, value) == (
        f"my.yaml: 'gains.{key}' is {value}. It must be: {allowed} [REL, Theorem 3.1]."
    )


@pytest.mark.parametrize(
    "points",
    [
        {},
        {"point1": [0, 0, 0], "point2": [1, 0, 0]},
        {"point1": [0, 0, 0], "point2": [1, 1, 0], "point3": [3, 3, 0]},
        {"point1": [0, 0, 0], "point2": [0, 0, 0], "point3": [1, 0, 0]},
        {"a": [1, 2, 3], "b": [1, 2, 3], "c": [1, 2, 3], "d": [1, 2, 3]},
    ],
)
def test_too_few_points_and_points_on_a_line_are_refused(points):
    with pytest.raises(ConfigError) as caught:
        config.validate(
            relative_fts.Config, {"observer": "relative_fts", "points": points}, "my.yaml"
        )
    said = str(caught.value)
    assert said.startswith("my.yaml: 'points' is {")
    assert said.endswith(": three points are needed that are not on one line [REL, (9)-(12)].")
    assert "\n" not in said


def test_three_points_off_a_line_are_enough():
    points = {"a": [0, 0, 0], "b": [1, 0, 0], "c": [0, 1, 0]}
    document = {"observer": "relative_fts", "points": points}
    assert config.validate(relative_fts.Config, document, "my.yaml").points["b"] == (1.0, 0.0, 0.0)
    made, _, chosen, q = object_points(300, places=points)
    assert angle_deg(relative_fts.estimate(made, chosen).q, q)[AT_REST:].max() < 0.3
