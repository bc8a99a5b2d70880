from dataclasses import replace

import numba
import numpy as np
import observing
import papers
import papers_rigid
import pytest
from flights import START, angle_deg, recording, seen, stamps, tumbling
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from observing import HALF_TURNS, IDENTITY, H
from papers_rigid import biased
from scipy.integrate import solve_ivp
from strategies import anywhere, directions, rotations, vectors, weights

from attest import config
from attest.conditioning import condition
from attest.config import Conditioning
from attest.errors import ConfigError
from attest.geometry import mat3, quaternion, so3
from attest.observers import eso, eso_settings, hoelder
from attest.recording import Signal

K = config.Weights(k=(3.0, 2.0, 1.0))
PAPER = eso.Config(
    gains=eso_settings.Gains(alpha=0.85, gamma=2.0, kappa=0.15, k_sigma=5.0, k_Psi=5.0),
    weights=K,
    plant=eso_settings.Plant(inertia=(4.0, 4.0, 10.0)),
)
"""Gains and inertia of [ESO] section 6."""
FULL = np.array([[4.0, 0.3, -0.2], [0.3, 5.0, 0.5], [-0.2, 0.5, 10.0]])
"""An inertia that is not diagonal, kg m²."""
ZERO = (0.0, 0.0, 0.0)


@st.composite
def drawn_gains(draw):
    alpha = draw(st.floats(0.51, 0.99))
    return eso_settings.Gains(
        alpha=alpha,
        gamma=max(3.0 * alpha - 1.0, 1e-3) + draw(st.floats(0.0, 3.0)),
        kappa=draw(st.floats(0.05, 1.0)),
        k_sigma=draw(st.floats(0.1, 10.0)),
        k_Psi=draw(st.floats(0.1, 10.0)),
    )


@st.composite
def inertias(draw):
    turn, of_axes = quaternion.to_matrix(draw(anywhere)), draw(directions)
    J = turn @ np.diag(1.0 + 4.0 * np.abs(of_axes)) @ turn.T
    return 0.5 * (J + J.T)


def set_up(settings, *, q=IDENTITY, rate=None, sigma=ZERO, J=None, bias=ZERO):
    """Return a configuration that starts at attitude q, with a rate and a disturbance."""
    start = eso_settings.Start(
        **observing.initial(q, bias, rate).model_dump(),
        disturbance=tuple(np.asarray(sigma).tolist()),
    )
    plant = settings.plant
    if J is not None:
        plant = eso_settings.Plant(inertia=tuple(map(tuple, np.asarray(J).tolist())))
    return settings.model_copy(update={"initial": start, "plant": plant})


def sigma_of(found, J):
    """Return sigma_hat of estimates."""
    return found.states["disturbance_torque"] @ np.linalg.inv(J).T


def held(v, n):
    return np.tile(np.asarray(v, float), (n, 1))


def driven(Omega, J, sigma, h=H):
    """Return the torque (n, 3) that makes explicit steps of (6) follow Omega."""
    ahead = np.diff(Omega, axis=0, append=Omega[-1:])
    return ahead / h @ J.T - np.cross(Omega @ J.T, Omega) - sigma @ J.T


@settings(max_examples=100)
@given(
    case=observing.cases(n=2, h=1e-3),
    k=weights,
    g=drawn_gains(),
    J=inertias(),
    rate=vectors(5.0),
    sigma=vectors(3.0),
    tau=vectors(5.0),
)
def test_a_step_is_eqs_26_to_30_as_it_vanishes(case, k, g, J, rate, sigma, tau):
    settings = eso.Config(gains=g, weights=config.Weights(k=tuple(k.tolist())))
    numbers = (g.alpha, g.gamma, g.kappa, g.k_sigma, g.k_Psi)
    e, u = papers.joined(case.E.T, case.U[0].T)
    R, L = quaternion.to_matrix(case.q), papers.L(e, u, np.diag(k))
    s = papers.s_L(R, L)
    assume(s @ s > 1e-6)  # there the powers are floored, below
    Omega_m = case.gyro[0] - case.bias
    R_dot, Omega_dot, sigma_dot, Psi = papers_rigid.eso(R, rate, sigma, Omega_m, tau, J, L, numbers)
    assume(Psi @ Psi > 1e-6)
    start = set_up(settings, q=case.q, rate=rate, sigma=sigma, J=J, bias=case.bias)
    found = eso.estimate(case.samples(torque=held(tau, 2)), start)
    assert_allclose(found.states["psi_norm"][0], np.linalg.norm(Psi), rtol=1e-6)
    # the attitude turns by the rate, and the two others are exact, for any step
    assert_allclose(quaternion.to_matrix(found.q[1]), R @ papers.exp(case.h * rate), atol=1e-12)
    changes = found.angular_velocity[1] - rate, sigma_of(found, J)[1] - sigma
    for change, expected in zip(changes, (Omega_dot, sigma_dot), strict=True):
        scale = 1.0 + np.abs(expected).max()
        assert_allclose(change / case.h, expected, atol=1e-7 * scale * max(k))
    tiny = replace(case, h=1e-8)
    R_h = quaternion.to_matrix(eso.estimate(tiny.samples(), start).q[1])
    assert_allclose((R_h - R) / tiny.h, R_dot, atol=1e-5)


@given(case=observing.cases(n=1), rate=vectors(5.0), sigma=vectors(3.0), J=inertias())
def test_diagnostics_are_the_state_the_residual_and_wahbas_cost(case, rate, sigma, J):
    start = set_up(PAPER, q=case.q, rate=rate, sigma=sigma, J=J)
    found = eso.estimate(case.samples(), start)
    e, u = papers.joined(case.E.T, case.U[0].T)
    R, k = quaternion.to_matrix(case.q), np.diag(K.k)
    assert_allclose(found.angular_velocity[0], rate, atol=1e-14)
    assert_allclose(found.states["disturbance_torque"][0], J @ sigma, atol=1e-12)
    assert_allclose(found.s_norm[0], np.linalg.norm(papers.s_L(R, papers.L(e, u, k))), atol=1e-8)
    assert_allclose(found.cost[0], papers.cost(R, e, u, k), atol=1e-8)
    assert found.gyro_bias is None


def settled_nowhere(found):
    """Tell whether a run stays clear of where rounding chooses the way out."""
    return min(found.s_norm.min(), found.states["psi_norm"].min()) > 1e-2


@given(case=observing.cases(), Q=observing.axis_turns, rate=vectors(2.0), sigma=vectors(2.0))
def test_a_run_does_not_care_how_the_world_is_turned_if_its_weights_turn_along(
    case, Q, rate, sigma
):
    tau = held([0.3, -0.2, 0.1], len(case.gyro))
    here = eso.estimate(
        case.samples(torque=tau), set_up(PAPER, q=case.q, rate=rate, sigma=sigma, J=FULL)
    )
    assume(settled_nowhere(here))
    turned = case.in_a_turned_world(Q)
    k = config.Weights(k=observing.turned_weights(K.k, Q))
    settings = PAPER.model_copy(update={"weights": k})
    there = eso.estimate(
        turned.samples(torque=tau), set_up(settings, q=turned.q, rate=rate, sigma=sigma, J=FULL)
    )
    observing.assert_turned_world(biased(here), biased(there), Q, atol=1e-7)
    torques = [found.states["disturbance_torque"] for found in (here, there)]
    assert_allclose(*torques, atol=1e-7)


@given(case=observing.cases(), Q=rotations, rate=vectors(2.0), sigma=vectors(2.0), J=inertias())
def test_a_run_does_not_care_how_the_sensors_sit_in_the_body(case, Q, rate, sigma, J):
    n, tau = len(case.gyro), np.array([0.3, -0.2, 0.1])
    here = eso.estimate(
        case.samples(torque=held(tau, n)), set_up(PAPER, q=case.q, rate=rate, sigma=sigma, J=J)
    )
    assume(settled_nowhere(here))
    turned, M = case.in_a_turned_body(Q), quaternion.to_matrix(Q)
    J_turned = M @ J @ M.T
    start = set_up(
        PAPER, q=turned.q, rate=M @ rate, sigma=M @ sigma, J=0.5 * (J_turned + J_turned.T)
    )
    there = eso.estimate(turned.samples(torque=held(M @ tau, n)), start)
    observing.assert_turned_body(biased(here), biased(there), Q, atol=1e-7)
    torques = [found.states["disturbance_torque"] for found in (here, there)]
    assert_allclose(torques[1], torques[0] @ M.T, atol=1e-7)


@pytest.mark.slow
def test_attitude_stays_a_rotation_over_a_million_steps_without_projection():
    made = observing.million_steps()
    found = eso.estimate(made, PAPER)
    assert np.abs(np.linalg.norm(found.q, axis=1) - 1.0).max() < 1e-10


def section_6(duration=40.0):
    """Return [ESO] section 6 without noise: samples, configuration, true q, Omega and sigma."""
    J, K_c = np.diag([4.0, 4.0, 10.0]), np.diag([0.1, 0.2, 0.3])
    J_inverse = np.linalg.inv(J)

    def control(R):
        return -0.5 * papers.vex(K_c @ R - R.T @ K_c)

    def disturbance(t):
        waves = 0.2 * np.sin(0.2 * np.pi * t), 0.1 * np.sin(0.4 * np.pi * t)
        return np.array([*waves, 0.5 * np.cos(0.1 * np.pi * t)])

    def motion(t, x):
        R, Omega = x[:9].reshape(3, 3), x[9:]
        torque = np.cross(J @ Omega, Omega) + control(R) + disturbance(t)  # (5)
        return np.concatenate([(R @ papers.hat(Omega)).ravel(), J_inverse @ torque])

    t = H * np.arange(round(duration / H) + 1)
    start = np.concatenate([papers.exp(HALF_TURNS[0]).ravel(), [1.0, 0.5, 0.0]])
    path = solve_ivp(motion, (0.0, t[-1]), start, "DOP853", t, rtol=1e-11, atol=1e-12).y.T
    R, Omega = path[:, :9].reshape(-1, 3, 3), path[:, 9:]
    fourth = np.array([1.0, 2.0, 1.0]) / np.sqrt(6.0)
    E = np.vstack([np.eye(3), fourth])
    torque = np.array([control(R_i) for R_i in R])
    made = observing.sampled(Omega, E @ R, E, torque=torque)
    q = quaternion.normalize(np.array([so3.from_matrix(tuple(R_i.ravel())) for R_i in R]))
    sigma = np.array([disturbance(t_i) for t_i in t]) @ J_inverse.T
    return made, set_up(PAPER, rate=[0.0, 0.0, 1.0], sigma=[2.0, 3.0, 5.0]), q, Omega, sigma


def test_experiment_6_finds_attitude_rate_and_disturbance_as_the_paper_says():
    made, start, q, Omega, sigma = section_6()
    found = eso.estimate(made, start)
    error = angle_deg(found.q, q)
    assert_allclose(error[0], 180.0, atol=1e-5)
    assert_allclose(found.angular_velocity[0], [0.0, 0.0, 1.0])
    assert_allclose(found.states["disturbance_torque"][0], [8.0, 12.0, 50.0])
    sigma_tilde = sigma - sigma_of(found, np.diag([4.0, 4.0, 10.0]))
    assert error[-1] < 0.05
    assert error[-1500:].max() < 0.1
    assert_allclose(np.linalg.norm(sigma_tilde[-1]), 0.015, atol=0.001)
    assert np.linalg.norm(sigma_tilde[-1500:], axis=1).max() < 0.02
    assert np.linalg.norm((Omega - found.angular_velocity)[-1500:], axis=1).max() < 5e-3


def test_what_theorem_2_promises_of_experiment_6_holds():
    made, start, *_ = section_6()
    known, psi = eso.promises(made, eso.estimate(made, start), start)
    assert known.holds is None
    assert known.seen == "inertia as configured; control torque of the log"
    assert psi.holds
    assert 0.0 < psi.value <= psi.bound
    assert psi.source == "ESO, Theorem 2"


def claim_of_the_model(made, settings):
    return eso.promises(made, eso.estimate(made, settings), settings)[0]


def test_without_inertia_or_torque_it_is_said_what_the_disturbance_is_made_of():
    made, unknown = observing.at_rest(300), eso.Config()
    claim = claim_of_the_model(made, unknown)
    assert claim.holds is None
    assert claim.seen == (
        "inertia 1 kg m² about each axis; no control torque is known: all torque is disturbance"
    )
    torque = replace(made, torque=np.zeros((300, 3)))
    assert claim_of_the_model(torque, unknown).holds is None
    assert claim_of_the_model(made, PAPER).holds is None
    configured = set_up(PAPER).model_copy(
        update={"plant": eso_settings.Plant(inertia=(1.0, 2.0, 3.0), torque=(0.0, 0.0, 0.1))}
    )
    claim = claim_of_the_model(made, configured)
    assert claim.holds is None
    assert claim.seen == "inertia as configured; control torque as configured"


def constant_disturbance(sigma, n, q_0=IDENTITY):
    """Return samples over motion (96) under the torque that it takes, inertia `FULL`, and truth."""
    Omega = observing.motion(n)
    q = observing.truth(q_0, Omega)
    torque = driven(Omega, FULL, held(sigma, n))
    return observing.sampled(Omega, observing.seen(q, np.eye(3)), np.eye(3), torque=torque), q


def test_with_true_attitude_and_rate_a_constant_disturbance_is_found():
    sigma = np.array([0.5, -0.3, 0.8])
    made, q = constant_disturbance(sigma, 2000)
    found = eso.estimate(made, set_up(PAPER, rate=made.gyro[0], J=FULL))
    assert angle_deg(found.q[-1], q[-1]) < 1e-6
    sigma_tilde = sigma - sigma_of(found, FULL)
    assert_allclose(sigma_tilde[0], sigma)
    assert np.linalg.norm(sigma_tilde[1500:], axis=1).max() < 1e-8


def decades(scale):
    """Return when V_a of (32), at s_L = 0, is each hundredth of itself, s.

    The start is of a scale by the weights (1, alpha), for which its right sides are homogeneous.
    """
    g = PAPER.gains
    numbers = (g.alpha, (1.0 - g.alpha) / g.gamma, g.kappa, g.k_sigma, g.k_Psi)

    def right_sides(_, x):
        pull, turned, _ = eso.derivatives(ZERO, ZERO, tuple(x[:3]), numbers)
        return np.concatenate([x[3:] - np.array(pull), -np.array(turned)])

    Psi, sigma_tilde = np.array([0.2, -0.1, 0.4]), np.array([0.5, -0.3, 0.8])
    start = np.concatenate([scale * Psi, scale**g.alpha * sigma_tilde])
    t = np.linspace(0.0, 5.0, 5001)
    path = solve_ivp(right_sides, (0.0, 5.0), start, "DOP853", t, rtol=1e-9, atol=1e-13).y.T
    V = np.array([papers_rigid.V_a(x[:3], x[3:], g.alpha, g.k_sigma) for x in path])
    return np.array([t[np.argmax(V / V[0] < 100.0**-k)] for k in range(1, 8)])


def test_rate_and_disturbance_settle_in_finite_time():
    """Each hundredth takes a fraction of the time of the one before: the sum is finite."""
    taken = np.diff(decades(1.0))
    assert (taken[1:] < 0.85 * taken[:-1]).all()
    assert taken[-1] < 0.2 * taken[0]


@pytest.mark.parametrize("scale", [0.1, 3.0])
def test_rate_and_disturbance_settle_as_the_degree_of_homogeneity_says(scale):
    """(32) is of degree alpha - 1: a start scaled by c takes c^(1 - alpha) as long."""
    assert_allclose(decades(scale), scale**0.15 * decades(1.0), atol=3e-3)


def test_the_function_of_rate_and_disturbance_never_grows():
    """V_a (34), whatever the attitude's error is."""
    sigma, g = np.array([0.5, -0.3, 0.8]), PAPER.gains
    rng = np.random.default_rng(2)
    made, _ = constant_disturbance(sigma, 600)
    for wrong in observing.starts(10):
        found = eso.estimate(made, set_up(PAPER, q=wrong, rate=rng.normal(size=3), J=FULL))
        errors = zip(found.states["psi_norm"], sigma - sigma_of(found, FULL), strict=True)
        V = [papers_rigid.V_a(np.array([Psi]), tilde, g.alpha, g.k_sigma) for Psi, tilde in errors]
        assert np.diff(V).max() < 1e-6 * V[0]  # of the steps, which are not vanishing


def test_the_function_of_rate_and_disturbance_falls_as_its_derivative_says_as_steps_vanish():
    """V_a' = -k_sigma k_Psi (Psi.Psi)^((3 alpha - 1)/2); (35) has other constants."""
    h, g, rng = 1e-6, PAPER.gains, np.random.default_rng(4)
    for _ in range(20):
        q, q_true = quaternion.normalize(rng.normal(size=(2, 4)))
        Omega, rate, sigma, sigma_hat, tau = rng.normal(size=(5, 3))
        turns = np.linalg.inv(FULL) @ (np.cross(FULL @ Omega, Omega) + tau) + sigma  # (6)
        rates = np.stack([Omega, Omega + h * turns])
        both = np.stack([q_true, quaternion.multiply(q_true, quaternion.exp(h * Omega))])
        made = observing.sampled(
            rates, observing.seen(both, np.eye(3)), np.eye(3), h, torque=held(tau, 2)
        )
        found = eso.estimate(made, set_up(PAPER, q=q, rate=rate, sigma=sigma_hat, J=FULL))
        Psi, tilde = found.states["psi_norm"], sigma - sigma_of(found, FULL)
        V = [papers_rigid.V_a(Psi[i : i + 1], tilde[i], g.alpha, g.k_sigma) for i in range(2)]
        expected = -g.k_sigma * g.k_Psi * Psi[0] ** (3.0 * g.alpha - 1.0)
        assert_allclose((V[1] - V[0]) / h, expected, rtol=1e-3, atol=1e-3)


def test_wahbas_cost_never_grows_once_the_rate_is_what_the_residual_asks_for():
    """At Psi = 0 and sigma_hat = sigma, U' = -kappa (s.s)^(1 + (alpha - 1)/gamma), (39)."""
    sigma, g = np.array([0.1, -0.2, 0.05]), PAPER.gains
    a = (1.0 - g.alpha) / g.gamma
    for wrong in observing.starts(10):
        made, _ = constant_disturbance(sigma, 500)
        first = eso.estimate(made, set_up(PAPER, q=wrong, J=FULL))
        s = papers.s_L(
            quaternion.to_matrix(wrong), papers.L(np.eye(3), made.body[0].T, np.diag(K.k))
        )
        rate = made.gyro[0] - g.kappa * s / (s @ s) ** a
        found = eso.estimate(made, set_up(PAPER, q=wrong, rate=rate, sigma=sigma, J=FULL))
        assert_allclose(first.s_norm[0], np.linalg.norm(s))
        assert found.states["psi_norm"][0] < 1e-12
        assert np.diff(found.cost).max() < 1e-12
        fall = -g.kappa * found.s_norm ** (2.0 - 2.0 * a)
        assert_allclose(np.diff(found.cost)[:50] / H, fall[:50], rtol=0.05)


@pytest.mark.slow
def test_every_start_but_the_unstable_ones_converges_and_finds_rate_and_disturbance():
    """500 starts, the papers' gains but kappa = 1: 30 s are enough."""
    sigma = np.array([0.2, -0.1, 0.3])
    made, q = constant_disturbance(sigma, 3001)
    gains = PAPER.gains.model_copy(update={"kappa": 1.0})
    brisk = PAPER.model_copy(update={"gains": gains})
    ends = []
    for start in observing.starts():
        found = eso.estimate(made, set_up(brisk, q=start, J=FULL))
        left = sigma - sigma_of(found, FULL)[-1], made.gyro[-1] - found.angular_velocity[-1]
        ends.append((angle_deg(found.q[-1], q[-1]), *map(np.linalg.norm, left)))
    assert np.max(ends, axis=0)[0] < 1e-3
    assert np.max(ends, axis=0)[1:].max() < 1e-5


@pytest.mark.parametrize("half_turn", HALF_TURNS)
def test_a_half_turn_off_is_an_equilibrium_that_any_push_leaves(half_turn):
    brisk = PAPER.model_copy(update={"gains": PAPER.gains.model_copy(update={"kappa": 1.0})})
    q, made = quaternion.exp(half_turn), observing.at_rest(4000)
    stuck = eso.estimate(made, set_up(brisk, q=q))
    observing.assert_sound(biased(stuck))
    assert stuck.s_norm[0] < 1e-14
    pushed = quaternion.multiply(quaternion.exp(np.array([1e-6, 1e-6, 1e-6])), q)
    left = eso.estimate(made, set_up(brisk, q=pushed))
    assert angle_deg(left.q[-1], IDENTITY) < 1e-6


@pytest.mark.parametrize("alpha", [0.51, 0.85, 0.99])
def test_a_perfect_estimate_at_rest_stays_where_it_is(alpha):
    settings = eso.Config(gains=eso_settings.Gains(alpha=alpha), weights=K)
    found = eso.estimate(observing.at_rest(50), set_up(settings))
    assert_allclose(found.q, np.broadcast_to(IDENTITY, (50, 4)))
    assert not found.angular_velocity.any()
    assert not found.states["disturbance_torque"].any()


@given(s=vectors(), w=vectors(), g=drawn_gains())
def test_derivatives_are_finite_where_the_powers_have_no_value(s, w, g):
    a = (1.0 - g.alpha) / g.gamma
    numbers = (g.alpha, a, g.kappa, g.k_sigma, g.k_Psi)
    s, w = so3.as_vector(s), so3.as_vector(w)
    on_psi = so3.scale(g.kappa * max(so3.dot(s, s), hoelder.FLOOR) ** -a, s)  # Psi = 0
    for case in ((ZERO, w, ZERO), (ZERO, ZERO, ZERO), (s, w, on_psi), (ZERO, w, s)):
        assert np.isfinite(eso.derivatives(*case, numbers)).all()


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_step_of_a_nanosecond_changes_next_to_nothing(substeps):
    made = observing.sampled(np.ones((3, 3)), [np.eye(3)] * 3, np.eye(3), 1e-9)
    made = replace(made, substeps=np.full(3, substeps))
    q = quaternion.exp(np.ones(3))
    found = eso.estimate(made, set_up(PAPER, q=q, rate=[1.0, 0.0, 0.0], sigma=[1.0, 2.0, 3.0]))
    observing.assert_sound(biased(found))
    for y in (found.q, found.angular_velocity, found.states["disturbance_torque"]):
        assert_allclose(y, np.broadcast_to(y[0], y.shape), atol=1e-6)


def test_a_step_without_length_changes_nothing():
    state = (so3.as_quaternion(quaternion.exp(np.ones(3))), (1.0, 0.0, 2.0), (1.0, 2.0, 3.0))
    J = mat3.diagonal((4.0, 4.0, 10.0))
    numbers = (0.85, 0.075, 0.15, 5.0, 5.0)
    L = mat3.diagonal((3.0, 2.0, 1.0))
    after, *_ = eso.step(state, (1.0, 1.0, 1.0), ZERO, L, 6.0, 0.0, (J, mat3.inverse(J)), numbers)
    assert_allclose(np.concatenate(after), np.concatenate(state), atol=1e-15)


@settings(max_examples=150)
@given(made=observing.any_samples(), shipped=st.booleans())
def test_no_measurement_makes_a_nan(made, shipped):
    observing.assert_sound(biased(eso.estimate(made, eso.Config() if shipped else PAPER)))


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="plain Python raises at infinity")
def test_gains_too_high_for_the_steps_are_an_error_and_never_nan():
    made, _ = constant_disturbance(np.zeros(3), 3000)
    wild = PAPER.model_copy(
        update={"gains": eso_settings.Gains(alpha=0.99, k_Psi=1e4, k_sigma=1e6)}
    )
    with pytest.raises(ConfigError, match=r"eso: .* after \d+\.\d\d s: the gains are too high"):
        eso.estimate(made, wild)


def test_without_vectors_the_estimate_is_the_integrated_gyroscope():
    made, q = constant_disturbance(np.zeros(3), 500)
    nothing = replace(made, body=np.empty((500, 0, 3)), inertial=np.empty((1, 0, 3)))
    nothing = replace(nothing, valid=np.ones((500, 0), np.bool_), names=())
    found = eso.estimate(nothing, set_up(PAPER, J=FULL))
    assert angle_deg(found.q, q).max() < 1e-6
    assert np.abs(found.states["disturbance_torque"]).max() < 1e-9


def test_with_one_vector_it_is_followed_and_the_turn_about_it_is_the_gyroscopes():
    n, down, heading = 6000, np.array([0.0, 0.0, -1.0]), 0.001
    tilt = quaternion.exp(np.array([0.4, -0.3, 0.0]))
    body = quaternion.rotate(quaternion.conjugate(tilt), down)
    made = observing.sampled(held(-heading * body, n), held(body, n)[:, np.newaxis], down)
    brisk = PAPER.model_copy(update={"gains": PAPER.gains.model_copy(update={"kappa": 1.0})})
    found = eso.estimate(made, set_up(brisk))
    assert_allclose(quaternion.rotate(found.q[-1], body), down, atol=1e-3)
    late = quaternion.multiply(quaternion.conjugate(found.q[3000]), found.q[-1])
    assert_allclose(quaternion.log(late), -heading * 29.99 * body, atol=1e-4)


def test_a_torque_of_the_configuration_is_the_same_as_one_of_the_log_and_goes_before_it():
    made, _ = constant_disturbance(np.zeros(3), 500)
    torque = (0.4, -0.2, 0.3)
    start = set_up(PAPER)
    given_twice = start.model_copy(
        update={"plant": start.plant.model_copy(update={"torque": torque})}
    )
    of_log = eso.estimate(replace(made, torque=held(torque, 500)), start)
    of_config = eso.estimate(made, given_twice)
    none = eso.estimate(replace(made, torque=None), start)
    assert of_log.q.tobytes() == of_config.q.tobytes()
    assert not np.allclose(none.q, of_log.q)
    zero = eso.estimate(replace(made, torque=np.zeros((500, 3))), start)
    assert none.q.tobytes() == zero.q.tobytes()


def test_an_unknown_inertia_reads_torques_as_angular_accelerations():
    made, _ = constant_disturbance(np.zeros(3), 500)
    unknown = set_up(PAPER).model_copy(update={"plant": eso_settings.Plant()})
    of_one = set_up(PAPER, J=np.eye(3))
    found = [eso.estimate(made, settings) for settings in (unknown, of_one)]
    assert found[0].q.tobytes() == found[1].q.tobytes()


def test_inertia_by_its_diagonal_is_the_whole_matrix():
    made, _ = constant_disturbance(np.zeros(3), 500)
    found = [
        eso.estimate(made, settings)
        for settings in (set_up(PAPER), set_up(PAPER, J=np.diag([4.0, 4.0, 10.0])))
    ]
    assert found[0].q.tobytes() == found[1].q.tobytes()


def test_a_known_bias_is_taken_off_the_gyroscope_and_held():
    beta = np.array([0.1, -0.2, 0.05])
    made, _ = constant_disturbance(np.array([0.1, 0.0, 0.2]), 1000)
    plain = eso.estimate(made, set_up(PAPER, J=FULL))
    off = eso.estimate(replace(made, gyro=made.gyro + beta), set_up(PAPER, J=FULL, bias=beta))
    assert angle_deg(plain.q, off.q).max() < 1e-6


def test_a_restart_starts_all_anew_and_keeps_the_known_bias():
    beta = np.array([0.1, -0.2, 0.05])
    made, _ = observing.restarted(beta)
    start = set_up(PAPER, rate=[0.0, 0.0, 1.0], sigma=[2.0, 3.0, 5.0], bias=beta)
    found = eso.estimate(made, start)
    i = 2000
    alone = observing.sampled(made.gyro[i:], made.body[i:], np.eye(3))
    anew = PAPER.model_copy(update={"initial": eso_settings.Start(bias=tuple(beta.tolist()))})
    expected = eso.estimate(alone, anew)
    assert angle_deg(found.q[i:], expected.q).max() < 1e-6
    assert_allclose(found.angular_velocity[i:], expected.angular_velocity, atol=1e-12)
    torques = found.states["disturbance_torque"][i:], expected.states["disturbance_torque"]
    assert_allclose(*torques, atol=1e-12)
    assert not torques[0][0].any()
    assert_allclose(found.angular_velocity[i], made.gyro[i] - beta)


@pytest.mark.parametrize("parts", [2, 5])
def test_sub_steps_are_the_run_of_a_log_sampled_that_much_finer(parts):
    rows = 20
    # a gyroscope that is linear between the rows, whose sub-steps take its middle
    coarse = observing.sampled(
        np.linspace([0.1, 0.2, 0.3], [0.5, -0.2, 0.4], rows),
        np.broadcast_to(np.eye(3), (rows, 3, 3)),
        np.eye(3),
        parts * H,
        substeps=np.full(rows, parts),
        torque=held([0.1, 0.2, 0.3], rows),
    )
    place = (np.arange((rows - 1) * parts) + 0.5) / parts
    fine_gyro = np.stack(
        [np.interp(place, np.arange(rows), column) for column in coarse.gyro.T], axis=1
    )
    fine = observing.sampled(
        fine_gyro,
        np.broadcast_to(np.eye(3), (len(place), 3, 3)),
        np.eye(3),
        torque=held([0.1, 0.2, 0.3], len(place)),
    )
    start = set_up(PAPER, q=quaternion.exp(np.array([1.0, 0.5, -0.3])), rate=ZERO)
    slow, quick = eso.estimate(coarse, start), eso.estimate(fine, start)
    assert_allclose(slow.q[:-1], quick.q[::parts], atol=1e-12)
    torques = [found.states["disturbance_torque"] for found in (slow, quick)]
    assert_allclose(torques[0][:-1], torques[1][::parts], atol=1e-10)


def test_the_same_samples_give_the_same_bits():
    made, start, *_ = section_6(5.0)
    first, second = (eso.estimate(made, start) for _ in range(2))
    assert first.q.tobytes() == second.q.tobytes()


def with_torque(t_torque, torque, **sections):
    """Return the samples of a log of 100 Hz and 5 s that has a control torque at other times."""
    t = stamps(100.0, 5.0)
    signals = {
        "gyro": Signal(t, np.zeros((len(t), 3)), "GYRO"),
        "accel": seen(tumbling, t, [0.0, 0.0, -9.8]),
        "torque": Signal(t_torque, torque, "TORQUE"),
    }
    return condition(recording(signals), eso.Config(**sections))[0]


def test_the_logs_torque_is_interpolated_to_the_gyroscopes_stamps():
    t = START + np.arange(11) * 500_000_000
    torque = np.outer(np.arange(11), [1.0, -2.0, 0.5])
    made = with_torque(t, torque)
    expected = np.outer((made.t - START) * 2e-9, [1.0, -2.0, 0.5])
    assert_allclose(made.torque, expected, atol=1e-9)


def test_the_logs_torque_is_zero_where_it_is_older_than_a_vector_may_be():
    t = START + np.array([1_000_000_000, 1_010_000_000, 4_000_000_000])
    conditioning = Conditioning(max_age_s=0.5)
    made = with_torque(t, np.ones((3, 3)), conditioning=conditioning)
    seconds = (made.t - START) * 1e-9
    near = np.min(np.abs(seconds[:, np.newaxis] - [1.0, 1.01, 4.0]), axis=1) <= 0.5 + 1e-9
    assert_allclose(made.torque, held(near.astype(float), 3).T)
    assert 0 < near.sum() < len(near)


def test_a_log_without_torque_has_none():
    t = stamps(100.0, 1.0)
    log = recording({"gyro": Signal(t, np.zeros((100, 3)), "GYRO")})
    assert condition(log, eso.Config())[0].torque is None


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("alpha", 0.5, "greater than 0.5"),
        ("alpha", 1.0, "less than 1"),
        ("gamma", 0.0, "greater than 0"),
        ("kappa", 0.0, "greater than 0"),
        ("k_sigma", -1.0, "greater than 0"),
        ("k_Psi", 0.0, "greater than 0"),
    ],
)
def test_a_gain_out_of_the_theorems_range_is_refused(key, value, allowed):
    assert observing.refusal(eso, key, value) == (
        f"my.yaml: 'gains.{key}' is {value}. It must be: {allowed} [ESO, Theorem 1]."
    )


def refusal(**document):
    with pytest.raises(ConfigError) as caught:
        config.validate(eso.Config, {"observer": "eso", **document}, "my.yaml")
    return str(caught.value)


def test_a_degree_too_low_for_the_exponent_is_refused():
    assert refusal(gains={"alpha": 0.9, "gamma": 1.6}) == (
        'my.yaml: \'gains\' is {"alpha": 0.9, "gamma": 1.6}: '
        "gamma - 3 alpha + 1 >= 0 is needed [ESO, Theorem 2]."
    )
    config.validate(
        eso.Config, {"observer": "eso", "gains": {"alpha": 0.75, "gamma": 1.25}}, "my.yaml"
    )


@pytest.mark.parametrize(
    "inertia",
    [
        [1, 1, 0],
        [1, -1, 1],
        [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]],
        [[1, 2, 0], [2, 1, 0], [0, 0, 1]],
        [[0, 0, 0], [0, 0, 0], [0, 0, 0]],
    ],
)
def test_an_inertia_of_no_rigid_body_is_refused(inertia):
    said = refusal(plant={"inertia": inertia})
    assert said.startswith("my.yaml: 'plant.inertia' is [")
    assert said.endswith(": a symmetric positive definite J is needed [ESO, Theorem 1].")
    assert "\n" not in said
