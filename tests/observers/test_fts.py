import json
import subprocess
import sys
from itertools import permutations, product
from pathlib import Path

import numba
import numpy as np
import papers
import pytest
from flights import angle_deg, samples
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from strategies import arrays, directions, frames, rotations, vectors, weights

from attest import config
from attest.errors import ConfigError
from attest.geometry import quaternion, so3, wahba
from attest.observers import fts, hoelder

PAPER = fts.Config(
    gains=fts.Gains(k_p=2.0, k_v=1.0, kappa=0.1, mu=0.35, p=1.1, k_b=None),
    weights=config.Weights(k=(3.0, 2.0, 1.0)),
)
"""configs/paper/fts.yaml, as a test below makes sure."""
ROOT = Path(__file__).resolve().parents[2]
H = 0.01
BETA = np.array([-0.1, -1.0, 0.2])
"""Bias of experiment 7.1, rad/s."""

gains = st.builds(
    fts.Gains,
    k_p=st.floats(0.1, 5.0),
    k_v=st.floats(0.1, 5.0),
    kappa=st.floats(0.05, 1.0),
    mu=st.floats(0.05, 0.95),
    p=st.floats(1.0, 1.9),
    k_b=st.floats(0.5, 100.0),
)


def numbers(g):
    return (g.k_p, g.k_v, g.kappa, g.mu, 1.0 - 1.0 / g.p, 2.0 - g.mu if g.k_b is None else g.k_b)


def run(start, gyro, U, E, K, g, h, substeps=1):
    """Run the kernel over U (n, k, 3) from start = (q, omega, beta_hat); rows of `fts.run`."""
    n = len(U)
    L, out = np.empty((n, 10)), np.empty((n, 13))
    valid = np.ones(U.shape[:2], np.bool_)
    wahba.gain_matrices(
        np.asarray(E)[np.newaxis], U, valid, so3.as_vector(np.array(K)), L, np.empty((0, 6))
    )
    q, omega, beta = start
    state = (so3.as_quaternion(q), so3.as_vector(omega), so3.as_vector(beta))
    steps = np.append(np.full(n - 1, float(h)), 0.0)
    fts.run(
        steps / substeps,
        np.full(n, substeps),
        np.ascontiguousarray(gyro),
        L,
        state,
        numbers(g),
        out,
    )
    return out


def one_step(start, gyro, U, E, K, g, h):
    """Return q, omega and beta_hat after one step of length h."""
    end = run(start, np.stack([gyro, gyro]), np.stack([U, U]), E, K, g, h)[1]
    return end[0:4], gyro - end[7:10] - end[4:7], end[7:10]


@settings(max_examples=200)
@given(
    data=st.data(),
    q=rotations,
    omega=vectors(2.0),
    beta=vectors(1.0),
    gyro=vectors(5.0),
    K=weights,
    g=gains,
)
def test_a_step_is_eqs_46_to_52_as_it_vanishes(data, q, omega, beta, gyro, K, g):
    E = data.draw(frames(data.draw(st.integers(2, 5))))
    U = E @ quaternion.to_matrix(data.draw(rotations))
    R = quaternion.to_matrix(q)
    e, u = papers.joined(E.T, U.T)
    s = papers.s_L(R, papers.L(e, u, np.diag(K)))
    Psi = omega - g.kappa * s / max((s @ s), 1e-20) ** (1.0 - 1.0 / g.p)
    assume(min(s @ s, Psi @ Psi) > 1e-6)  # there the powers are floored, below
    values = (g.k_p, g.k_v, g.kappa, g.mu, g.p, g.k_b)
    R_dot, omega_dot, beta_dot = papers.fts(R, omega, beta, gyro, e, u, np.diag(K), *values)

    h = 1e-7
    q_h, _, _ = one_step((q, omega, beta), gyro, U, E, K, g, h)
    assert_allclose((quaternion.to_matrix(q_h) - R) / h, R_dot, atol=1e-4)
    h = 1e-2  # these two are exact for any step
    _, omega_h, beta_h = one_step((q, omega, beta), gyro, U, E, K, g, h)
    scale = 1.0 + np.abs(omega_dot).max()
    assert_allclose((omega_h - omega) / h, omega_dot, atol=1e-7 * scale * max(K))
    assert_allclose((beta_h - beta) / h, beta_dot, atol=1e-9 * max(K))


@given(q=rotations, omega=vectors(2.0), beta=vectors(1.0), gyro=vectors(5.0), g=gains)
def test_a_step_of_the_attitude_is_a_turn_by_the_estimated_rate(q, omega, beta, gyro, g):
    q_h, _, _ = one_step((q, omega, beta), gyro, np.eye(3), np.eye(3), (3.0, 2.0, 1.0), g, H)
    turned = quaternion.to_matrix(q) @ papers.exp(H * (gyro - beta - omega))
    assert_allclose(quaternion.to_matrix(q_h), turned, atol=1e-13)


@given(data=st.data(), q=rotations, omega=vectors(2.0), beta=vectors(1.0), gyro=vectors(5.0))
def test_diagnostics_are_the_residual_wahbas_cost_and_psi(data, q, omega, beta, gyro):
    g, K = PAPER.gains, np.array([3.0, 2.0, 1.0])
    E = data.draw(frames(3))
    U = E @ quaternion.to_matrix(data.draw(rotations))
    row = run((q, omega, beta), gyro[np.newaxis], U[np.newaxis], E, K, g, 0.0)[0]
    R = quaternion.to_matrix(q)
    s = papers.s_L(R, papers.L(E.T, U.T, np.diag(K)))
    assert_allclose(row[4:7], gyro - beta - omega, atol=1e-14)
    assert_allclose(row[10], np.linalg.norm(s), atol=1e-8)
    assert_allclose(row[11], papers.cost(R, E.T, U.T, np.diag(K)), atol=1e-8)
    if np.linalg.norm(s) > 1e-6:
        Psi = omega - g.kappa * s / (s @ s) ** (1.0 - 1.0 / g.p)
        assert_allclose(row[12], np.linalg.norm(Psi), atol=1e-7)


AXIS_TURNS = [
    Q
    for order in permutations(range(3))
    for signs in product((-1.0, 1.0), repeat=3)
    if np.linalg.det(Q := np.diag(signs) @ np.eye(3)[list(order)]) > 0.0
]
"""The 24 turns of the world that keep K along its axes."""


@given(
    data=st.data(),
    Q=st.sampled_from(AXIS_TURNS),
    q=rotations,
    omega=vectors(2.0),
    gyro=vectors(5.0),
    g=gains,
)
def test_a_run_does_not_care_how_the_world_is_turned_if_its_weights_turn_along(
    data, Q, q, omega, gyro, g
):
    E, K = data.draw(frames(3)), np.array([3.0, 2.0, 1.0])
    U = np.stack([E @ quaternion.to_matrix(data.draw(rotations))] * 8)
    rates = np.stack([gyro] * 8)
    start = (q, omega, np.zeros(3))
    here = run(start, rates, U, E, K, g, 1e-3)
    q_turn = quaternion.from_xyzw(Rotation.from_matrix(Q).as_quat())
    turned = (quaternion.multiply(q_turn, q), omega, np.zeros(3))
    there = run(turned, rates, U, E @ Q.T, np.abs(Q) @ K, g, 1e-3)
    assume(here[:, 10].min() > 1e-3)  # at an equilibrium rounding chooses the way out
    assume(here[:, 12].min() > 1e-3)
    assert_allclose(quaternion.multiply(q_turn, here[:, :4]), there[:, :4], atol=1e-7)
    assert_allclose(here[:, 4:], there[:, 4:], atol=1e-6)


@given(data=st.data(), Q=rotations, q=rotations, omega=vectors(2.0), gyro=vectors(5.0), g=gains)
def test_a_run_does_not_care_how_the_sensors_sit_in_the_body(data, Q, q, omega, gyro, g):
    E, K = data.draw(frames(3)), np.array([3.0, 2.0, 1.0])
    U = np.stack([E @ quaternion.to_matrix(data.draw(rotations))] * 8)
    beta, rates = np.array([0.1, -0.2, 0.3]), np.stack([gyro] * 8)
    here = run((q, omega, beta), rates, U, E, K, g, 1e-3)
    turn = quaternion.to_matrix(Q)
    start = (quaternion.multiply(q, quaternion.conjugate(Q)), turn @ omega, turn @ beta)
    there = run(start, rates @ turn.T, U @ turn.T, E, K, g, 1e-3)
    assume(here[:, 10].min() > 1e-3)
    assume(here[:, 12].min() > 1e-3)
    assert_allclose(quaternion.multiply(there[:, :4], Q), here[:, :4], atol=1e-7)
    assert_allclose(there[:, 4:7], here[:, 4:7] @ turn.T, atol=1e-6)
    assert_allclose(there[:, 7:10], here[:, 7:10] @ turn.T, atol=1e-9)
    assert_allclose(there[:, 10:], here[:, 10:], atol=1e-6)


@pytest.mark.slow
def test_attitude_stays_a_rotation_over_a_million_steps_without_projection():
    rng = np.random.default_rng(1)
    gyro, U = rng.normal(size=(1001, 3)), rng.normal(size=(1001, 3, 3))
    U /= np.linalg.norm(U, axis=2, keepdims=True)
    start = (np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(3))
    out = run(start, gyro, U, np.eye(3), (3.0, 2.0, 1.0), PAPER.gains, 10.0, substeps=1000)
    assert np.abs(np.linalg.norm(out[:, :4], axis=1) - 1.0).max() < 1e-10


def motion(n):
    """Return Omega of [FTS] (96) at steps of `H`."""
    t = H * np.arange(n)
    waves = np.sin(2 * np.pi * t / 15), np.sin(2 * np.pi * t / 18 + np.pi / 20)
    return np.stack([*waves, np.cos(2 * np.pi * t / 17)], axis=1)


def truth(q_0, Omega):
    """Return R_{i+1} = R_i exp(h hat(Omega_i)), as quaternions."""
    q = [q_0]
    for rate in Omega[:-1]:
        q.append(quaternion.multiply(q[-1], quaternion.exp(H * rate)))
    return quaternion.normalize(np.array(q))


def experiment_7_1():
    """Return [FTS] 7.1: three directions without noise, upside down, with the motion of 7.2."""
    Omega = motion(3001)
    q = truth(quaternion.exp(np.array([np.pi, 0.0, 0.0])), Omega)
    t = np.arange(3001) * 10_000_000
    body = quaternion.rotate(quaternion.conjugate(q)[:, np.newaxis], np.eye(3))
    return samples(t, Omega + BETA, body, np.eye(3)[np.newaxis]), q


START_7_1 = config.Initial(
    attitude="identity", bias=(0.0, 0.0, 0.1), angular_velocity=(0.0, 0.0, 1.0)
)


def test_experiment_7_1_converges_as_the_paper_says():
    made, q = experiment_7_1()
    estimates = fts.estimate(made, PAPER.model_copy(update={"initial": START_7_1}))
    error = angle_deg(estimates.q, q)
    assert_allclose(error[0], 180.0)
    assert_allclose(estimates.angular_velocity[0], [0.0, 0.0, 1.0], atol=1e-15)
    assert_allclose(estimates.gyro_bias[0], [0.0, 0.0, 0.1])
    assert error[550:].max() < 1.0
    assert error[2000:].max() < 1e-6
    assert np.linalg.norm(estimates.gyro_bias[-1] - BETA) < 1e-8
    V = fts.lyapunov(estimates, PAPER, estimates.gyro_bias - BETA)
    assert np.diff(V).max() < 1e-12
    assert V[-1] < 1e-12 * V[0]


def test_lyapunov_function_falls_as_its_derivative_says():
    """V' = -k_p kappa (s.s)^(1/p) - k_v (Psi.Psi)^(1/p), OBSERVERS.md section 2.

    Exact where beta_hat = beta only: w_L is the rate of s_L for the rate that beta_hat leaves.
    """
    g, K, rng = PAPER.gains, np.array([3.0, 2.0, 1.0]), np.random.default_rng(5)
    for _ in range(20):
        q_true, q = rng.normal(size=(2, 4))
        q_true, q = quaternion.normalize(q_true), quaternion.normalize(q)
        Omega, omega, beta = rng.normal(size=(3, 3))
        h = 1e-7
        turn = quaternion.exp(h * Omega)
        both = np.stack([q_true, quaternion.multiply(q_true, turn)])
        U = quaternion.rotate(quaternion.conjugate(both)[:, np.newaxis], np.eye(3))
        rates = np.stack([Omega + beta] * 2)
        out = run((q, omega, beta), rates, U, np.eye(3), K, g, h)
        made = fts.estimate(samples(np.arange(2), rates, U, np.eye(3)[np.newaxis]), PAPER)
        states = {"psi_norm": out[:, 12]}
        found = {"gyro_bias": out[:, 7:10], "cost": out[:, 11], "states": states}
        changed = type(made)(**(as_dict(made) | found))
        V = fts.lyapunov(changed, PAPER, changed.gyro_bias - beta)
        s2, Psi2 = out[0, 10] ** 2, out[0, 12] ** 2
        expected = -g.k_p * g.kappa * s2 ** (1 / g.p) - g.k_v * Psi2 ** (1 / g.p)
        assert_allclose((V[1] - V[0]) / h, expected, rtol=1e-4, atol=1e-4)


def as_dict(estimates):
    return {name: getattr(estimates, name) for name in estimates.__slots__}


@pytest.mark.slow
def test_every_start_but_the_unstable_ones_converges_and_finds_the_bias():
    Omega, K = motion(3001), np.array([3.0, 2.0, 1.0])
    q = truth(np.array([1.0, 0.0, 0.0, 0.0]), Omega)
    U = quaternion.rotate(quaternion.conjugate(q)[:, np.newaxis], np.eye(3))
    beta = np.array([0.05, -0.1, 0.02])
    starts = Rotation.random(500, random_state=7).as_quat()
    errors, biases = [], []
    for start in quaternion.from_xyzw(starts):
        state = (start, np.zeros(3), np.zeros(3))
        end = run(state, Omega + beta, U, np.eye(3), K, PAPER.gains, H)[-1]
        errors.append(float(angle_deg(end[:4], q[-1])))
        biases.append(np.linalg.norm(end[7:10] - beta))
    assert max(errors) < 1e-3
    assert max(biases) < 1e-5


HALF_TURNS = [np.pi * axis for axis in np.eye(3)]


@pytest.mark.parametrize("half_turn", HALF_TURNS)
def test_a_half_turn_off_is_an_equilibrium_that_any_push_leaves(half_turn):
    n = 4000
    U = np.broadcast_to(np.eye(3), (n, 3, 3)).copy()
    still, K = np.zeros((n, 3)), np.array([3.0, 2.0, 1.0])
    q = quaternion.exp(half_turn)
    stuck = run((q, np.zeros(3), np.zeros(3)), still, U, np.eye(3), K, PAPER.gains, H)
    assert np.isfinite(stuck).all()
    assert stuck[0, 10] < 1e-14
    pushed = quaternion.multiply(quaternion.exp(np.array([1e-6, 1e-6, 1e-6])), q)
    left = run((pushed, np.zeros(3), np.zeros(3)), still, U, np.eye(3), K, PAPER.gains, H)
    assert np.linalg.norm(quaternion.log(left[-1, :4])) < 1e-6


@pytest.mark.parametrize("p", [1.0, 1.1, 1.5, 1.99])
def test_a_perfect_estimate_at_rest_stays_where_it_is(p):
    n, identity = 50, np.array([1.0, 0.0, 0.0, 0.0])
    U = np.broadcast_to(np.eye(3), (n, 3, 3)).copy()
    start = (identity, np.zeros(3), np.zeros(3))
    g = fts.Gains(p=p)
    out = run(start, np.zeros((n, 3)), U, np.eye(3), (3.0, 2.0, 1.0), g, H)
    assert_allclose(out[:, :4], np.broadcast_to(identity, (n, 4)))
    assert not out[:, 4:].any()


@given(s=vectors(), w=vectors(), g=gains)
def test_derivatives_are_finite_where_the_powers_have_no_value(s, w, g):
    zero = (0.0, 0.0, 0.0)
    s, w = so3.as_vector(s), so3.as_vector(w)
    values = numbers(g)
    slope = max(so3.dot(s, s), hoelder.FLOOR) ** -values[4]
    on_psi = so3.as_vector(g.kappa * slope * np.array(s))  # Psi = 0
    for case in ((zero, w, zero), (zero, zero, zero), (s, w, on_psi), (zero, w, s)):
        assert np.isfinite(fts.derivatives(*case, values, hoelder.powers(values[4]))).all()


def test_a_step_without_length_changes_nothing():
    start = (quaternion.exp(np.ones(3)), np.ones(3), np.ones(3))
    for substeps in (1, 4):
        U = np.stack([np.eye(3)] * 3)
        out = run(start, np.ones((3, 3)), U, np.eye(3), (3.0, 2.0, 1.0), PAPER.gains, 0.0, substeps)
        assert_allclose(out, np.broadcast_to(out[0], out.shape), atol=1e-15)


garbage = st.sampled_from([0.0, 1e-300, 1e-12, 1.0, 50.0, 999.0]).flatmap(
    lambda size: arrays(3, 1.0).map(lambda v: size * v)
)


@settings(max_examples=150)
@given(data=st.data(), shipped=st.booleans())
def test_no_measurement_makes_a_nan(data, shipped):
    n, k = data.draw(st.integers(2, 12)), data.draw(st.integers(0, 4))
    U = np.array(
        [[data.draw(directions | st.just(np.zeros(3))) for _ in range(k)] for _ in range(n)]
    )
    E = np.array([[data.draw(directions) for _ in range(k)]])
    valid = np.array([data.draw(st.lists(st.booleans(), min_size=k, max_size=k)) for _ in range(n)])
    gaps = data.draw(
        st.lists(
            st.sampled_from([1, 1000, 10_000_000, 10**9]) | st.integers(1, 10**9),
            min_size=n,
            max_size=n,
        )
    )
    t = np.cumsum(gaps)
    made = samples(
        t,
        np.array([data.draw(garbage) for _ in range(n)]),
        U.reshape(n, k, 3),
        E.reshape(1, k, 3),
        valid=valid.reshape(n, k).astype(np.bool_),
        substeps=np.clip(-(-np.diff(t, append=t[-1]) // 10_000_000), 1, 100),
        restart=np.array(
            [True, *data.draw(st.lists(st.booleans(), min_size=n - 1, max_size=n - 1))]
        ),
    )
    estimates = fts.estimate(made, fts.Config() if shipped else PAPER)
    for name in ("q", "angular_velocity", "gyro_bias", "s_norm", "cost"):
        assert np.isfinite(getattr(estimates, name)).all(), name
    assert_allclose(np.linalg.norm(estimates.q, axis=1), 1.0, atol=1e-9)


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="plain Python raises at infinity")
def test_gains_too_high_for_the_steps_are_an_error_and_never_nan():
    made, _ = experiment_7_1()
    wild = PAPER.model_copy(update={"gains": fts.Gains(k_p=500.0, kappa=500.0, k_b=0.01)})
    with pytest.raises(ConfigError, match=r"fts: .* after \d+\.\d\d s: the gains are too high"):
        fts.estimate(made, wild)


def test_a_run_in_two_parts_is_the_run_in_one():
    made, _ = experiment_7_1()
    whole = fts.estimate(made, PAPER.model_copy(update={"initial": START_7_1}))
    i = 1000
    rest = samples(made.t[i:], made.gyro[i:], made.body[i:], made.inertial)
    handed_over = config.Initial(
        attitude=tuple(whole.q[i].tolist()),
        bias=tuple(whole.gyro_bias[i].tolist()),
        angular_velocity=tuple(whole.angular_velocity[i].tolist()),
    )
    second = fts.estimate(rest, PAPER.model_copy(update={"initial": handed_over}))
    assert angle_deg(second.q, whole.q[i:]).max() < 1e-7
    assert_allclose(second.gyro_bias, whole.gyro_bias[i:], atol=1e-9)


@pytest.mark.parametrize("parts", [2, 5, 10])
def test_sub_steps_are_the_run_of_a_log_sampled_that_much_finer(parts):
    rng = np.random.default_rng(3)
    gyro, E = rng.normal(size=(20, 3)), np.eye(3)
    q = quaternion.normalize(rng.normal(size=4))
    U = np.stack([E @ papers.exp(0.02 * i * np.array([1.0, -0.5, 2.0])) for i in range(20)])
    start, K = (q, np.zeros(3), np.zeros(3)), (3.0, 2.0, 1.0)
    coarse = run(start, gyro, U, E, K, PAPER.gains, 0.05, substeps=parts)
    place = np.arange(19 * parts) / parts
    i, f = place.astype(int), (place % 1.0)[:, np.newaxis]
    middle = f + 0.5 / parts
    fine_gyro = (1.0 - middle) * gyro[i] + middle * gyro[i + 1]
    fine_U = (1.0 - f[..., np.newaxis]) * U[i] + f[..., np.newaxis] * U[i + 1]
    fine = run(start, fine_gyro, fine_U, E, K, PAPER.gains, 0.05 / parts)
    assert_allclose(coarse[:-1, :4], fine[::parts, :4], atol=1e-9)
    assert_allclose(coarse[:-1, 7:10], fine[::parts, 7:10], atol=1e-9)


def test_sub_steps_follow_a_slow_log_better_than_single_steps():
    Omega = motion(3001)
    q = truth(np.array([1.0, 0.0, 0.0, 0.0]), Omega)
    U = quaternion.rotate(quaternion.conjugate(q)[:, np.newaxis], np.eye(3))
    every = slice(None, None, 20)  # 5 Hz
    start, K = (q[0], np.zeros(3), np.zeros(3)), (3.0, 2.0, 1.0)
    single = run(start, Omega[every], U[every], np.eye(3), K, PAPER.gains, 0.2)
    divided = run(start, Omega[every], U[every], np.eye(3), K, PAPER.gains, 0.2, substeps=20)
    worst = [angle_deg(out[:, :4], q[every]).max() for out in (single, divided)]
    assert worst[1] < 0.5
    assert worst[1] < 0.2 * worst[0]


def test_a_restart_starts_the_attitude_anew_and_keeps_the_bias():
    made, q = experiment_7_1()
    i = 2000
    restart = np.isin(np.arange(3001), [0, i])
    turned = quaternion.exp(np.array([0.0, 0.0, 2.0]))  # while nobody looked, the body was turned
    body = made.body.copy()
    body[i:] = quaternion.rotate(quaternion.conjugate(turned), made.body[i:])
    gyro = made.gyro.copy()
    gyro[i:] = quaternion.rotate(quaternion.conjugate(turned), made.gyro[i:] - BETA) + BETA
    broken = samples(made.t, gyro, body, made.inertial, restart=restart)
    estimates = fts.estimate(broken, PAPER.model_copy(update={"initial": START_7_1}))
    after = quaternion.multiply(q[i:], turned)
    assert angle_deg(estimates.q[i], after[0]) < 1e-5
    assert_allclose(estimates.gyro_bias[i], estimates.gyro_bias[i - 1], atol=1e-12)
    assert angle_deg(estimates.q[i:], after).max() < 1e-3


def test_without_vectors_the_estimate_is_the_integrated_gyroscope():
    Omega = motion(500)
    q_0 = np.array([1.0, 0.0, 0.0, 0.0])
    t = np.arange(500) * 10_000_000
    made = samples(t, Omega, np.empty((500, 0, 3)), np.empty((1, 0, 3)))
    estimates = fts.estimate(made, fts.Config())
    assert angle_deg(estimates.q, truth(q_0, Omega)).max() < 1e-6
    assert not estimates.gyro_bias.any()


def test_with_one_vector_it_is_followed_and_the_turn_about_it_is_the_gyroscopes():
    n, down = 6000, np.array([[0.0, 0.0, -1.0]])
    t = np.arange(n) * 10_000_000
    tilt, heading = quaternion.exp(np.array([0.4, -0.3, 0.0])), 0.001
    body = np.broadcast_to(quaternion.rotate(quaternion.conjugate(tilt), down), (n, 1, 3)).copy()
    gyro = np.broadcast_to(
        heading * quaternion.rotate(quaternion.conjugate(tilt), -down[0]), (n, 3)
    )
    initial = config.Initial(attitude="identity")
    made = samples(t, gyro.copy(), body, down[np.newaxis])
    estimates = fts.estimate(made, fts.Config(initial=initial))
    assert_allclose(quaternion.rotate(estimates.q[-1], body[-1, 0]), down[0], atol=1e-3)


def test_estimates_of_a_quaternion_never_jump_in_sign():
    made, _ = experiment_7_1()
    q = fts.estimate(made, PAPER).q
    assert (np.sum(q[1:] * q[:-1], axis=1) > 0.0).all()


def test_the_same_samples_give_the_same_bits():
    made, _ = experiment_7_1()
    first, second = (fts.estimate(made, PAPER) for _ in range(2))
    assert first.q.tobytes() == second.q.tobytes()
    assert first.gyro_bias.tobytes() == second.gyro_bias.tobytes()


def test_the_papers_gains_are_those_shipped_as_the_papers():
    shipped = config.validate(fts.Config, config.read(config.find("paper/fts")), "paper/fts")
    assert (shipped.gains, shipped.weights) == (PAPER.gains, PAPER.weights)


def test_k_b_is_two_less_mu_where_it_is_not_given():
    made, _ = experiment_7_1()
    spelt_out = PAPER.model_copy(
        update={"gains": PAPER.gains.model_copy(update={"k_b": 2.0 - 0.35})}
    )
    q = [fts.estimate(made, settings).q for settings in (PAPER, spelt_out)]
    assert q[0].tobytes() == q[1].tobytes()


EXPERIMENT = """\
observer: fts
gains: {k_p: 2, k_v: 1, kappa: .1, mu: .35, p: 1.1, k_b: null}
weights: {k: [3, 2, 1]}
initial: {attitude: identity, bias: [0, 0, .1], angular_velocity: [0, 0, 1]}
vectors:
  - {signal: v1, reference: [1, 0, 0]}
  - {signal: v2, reference: [0, 1, 0]}
  - {signal: v3, reference: [0, 0, 1]}
conditioning: {gyroscope: {sample: begins}}
"""


def write_csv(path, made, q):
    axes = [f"{name}_{axis}" for name in ("gyro", "v1", "v2", "v3") for axis in "xyz"]
    names = ["time_s", *axes, "ref_qw", "ref_qx", "ref_qy", "ref_qz"]
    table = np.column_stack([made.gyro, made.body.reshape(-1, 9), q])
    rows = [
        ",".join([f"{t * 1e-9:.2f}", *map(repr, row)])
        for t, row in zip(made.t.tolist(), table.tolist(), strict=True)
    ]
    path.write_text("\n".join([",".join(names), *rows, ""]))


@pytest.mark.slow
def test_experiment_7_1_comes_out_of_the_command_line_as_the_paper_says(tmp_path):
    made, q = experiment_7_1()
    write_csv(tmp_path / "exp.csv", made, q)
    (tmp_path / "exp.yaml").write_text(EXPERIMENT)
    files = ["exp.csv", "--observer", "exp.yaml", "--output", "out"]
    named = [name if name.startswith("--") else str(tmp_path / name) for name in files]
    command = [sys.executable, "-m", "attest", "run", *named, "--quiet"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    written = {path.suffix: path for path in (tmp_path / "out" / "exp").iterdir()}
    summary = json.loads(written[".json"].read_text())
    assert summary["metrics"]["kind"] == "truth"
    assert summary["metrics"]["bias_error"] < 1e-8
    assert_allclose(summary["metrics"]["bias_true"], BETA, atol=1e-9)
    assert summary["estimates"]["lyapunov_growth"] < 1e-12
    poses = read_poses(written[".mcap"])
    assert len(poses) == len(q)
    error = angle_deg(poses, q)
    assert_allclose(error[0], 180.0)
    assert error[550:].max() < 1.0
    assert error[2000:].max() < 1e-6
    assert_allclose(np.sqrt(np.mean(error**2)), summary["metrics"]["total"]["rmse"], atol=1e-6)


def read_poses(path):
    """Return the estimated attitudes of an MCAP, (w, x, y, z), by rosbags."""
    from rosbags.highlevel import AnyReader

    poses = []
    with AnyReader([path]) as reader:
        wanted = [c for c in reader.connections if c.topic == "/attest/fts/pose"]
        for connection, _, raw in reader.messages(connections=wanted):
            o = reader.deserialize(raw, connection.msgtype).pose.orientation
            poses.append([o.w, o.x, o.y, o.z])
    return np.array(poses)
