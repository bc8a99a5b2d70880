from dataclasses import replace

import numpy as np
import observing
import papers
import pytest
import weighted
from flights import angle_deg
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from observing import HALF_TURNS, IDENTITY, H
from scipy.linalg import expm
from scipy.optimize import fsolve
from strategies import rotations, vectors, weights
from weighted import per_vector, with_gains, with_w

from attest import config
from attest.geometry import quaternion, so3
from attest.observers import vae

PAPER = vae.Config(
    gains=vae.Gains(m=5.0, D=(17.4, 18.85, 20.3), P=(2000.0, 2000.0, 2000.0)),
    weights=config.VectorWeights(k=(3.0, 2.0, 1.0)),
)
"""Gains of [VAE] section 6, with the three weights that [FTS] leaves open."""
BRISK = PAPER.model_copy(
    update={"gains": vae.Gains(m=1.0, D=(4.0, 4.0, 4.0), P=(10.0, 10.0, 10.0))}
)
"""Gains that find a bias within a minute."""
BETA = np.array([0.05, -0.1, 0.02])
POTENTIALS = {
    "linear": (lambda x: x, lambda _: 1.0),
    "logarithmic": (np.log1p, lambda x: 1.0 / (1.0 + x)),
    "quadratic": (lambda x: x + x**2 / 2.0, lambda x: 1.0 + x),
}
"""Phi and Phi'."""

positive = st.floats(0.5, 20.0)
triples = st.tuples(positive, positive, positive)
gains = st.builds(
    vae.Gains,
    m=st.floats(0.5, 10.0),
    D=triples,
    P=triples,
    Phi=st.sampled_from(vae.POTENTIALS),
)
isotropic = st.builds(
    vae.Gains,
    m=st.floats(0.5, 10.0),
    D=positive.map(lambda d: (d, d, d)),
    P=positive.map(lambda p: (p, p, p)),
    Phi=st.sampled_from(vae.POTENTIALS),
)


def omega_of(made, found):
    """Return omega = Omega_m - Omega_hat - beta_hat."""
    return made.gyro - found.angular_velocity - found.gyro_bias


def started(case, chosen, omega):
    return observing.starting(chosen, case.q, case.bias, case.gyro[0] - omega - case.bias)


def weighting(case, k, w):
    """Return the configuration's weights with E, U and W of the paper, columns."""
    if w is None:
        e, u = papers.joined(case.E.T, case.U[0].T)
        return config.VectorWeights(k=tuple(k.tolist())), e, u, papers.W(e, np.diag(k))
    named = {f"v{i + 1}": w_i for i, w_i in enumerate(w)}
    diagonal = np.diag(w[: len(case.E)])
    return config.VectorWeights(w=named), case.E.T, case.U[0].T, diagonal


@settings(max_examples=100)
@given(
    case=observing.cases(n=2, h=1e-7, drift=0.0),
    omega=vectors(2.0),
    k=weights,
    w=st.none() | per_vector,
    g=gains,
)
def test_a_step_is_eqs_11_and_20_as_it_vanishes(case, omega, k, w, g):
    chosen, e, u, W = weighting(case, k, w)
    made = case.samples()
    found = vae.estimate(made, started(case, vae.Config(gains=g, weights=chosen), omega))
    R, slope = quaternion.to_matrix(case.q), POTENTIALS[g.Phi][1]
    args = (R, omega, case.bias, case.gyro[0], e, u, W, g.m, np.diag(g.D), np.diag(g.P), slope)
    R_dot, omega_dot, beta_dot = papers.vae(*args)
    R_h, omega_h = quaternion.to_matrix(found.q), omega_of(made, found)
    scale = 1.0 + np.abs(omega_dot).max() + np.abs(beta_dot).max()
    assert_allclose((R_h[1] - R_h[0]) / case.h, R_dot, atol=1e-3)
    assert_allclose((omega_h[1] - omega_h[0]) / case.h, omega_dot, atol=1e-3 * scale)
    assert_allclose((found.gyro_bias[1] - case.bias) / case.h, beta_dot, atol=1e-8 * scale)


def root(F, near):
    far = 10.0  # its steps are in units of where it is, which must not be close to nought
    solved, *_ = fsolve(lambda x: F(x - far), near + far, xtol=1e-14, full_output=True)
    return solved - far  # the full output does not warn of rounding


@settings(max_examples=100)
@given(
    case=observing.cases(n=2, h=H, drift=0.5),
    turned=rotations,
    omega=vectors(2.0),
    k=weights,
    w=st.none() | per_vector,
    g=gains,
)
def test_a_step_of_any_length_is_eqs_30_to_33(case, turned, omega, k, w, g):
    chosen, e, u, W = weighting(case, k, w)
    case.U[1] = quaternion.rotate(turned, case.U[1])
    u_next = papers.joined(case.E.T, case.U[1].T)[1] if w is None else case.U[1].T
    made = case.samples()
    found = vae.estimate(made, started(case, vae.Config(gains=g, weights=chosen), omega))
    args = (quaternion.to_matrix(case.q), omega, case.bias, case.gyro, e, (u, u_next), W)
    values = (g.m, np.diag(g.D), np.diag(g.P), POTENTIALS[g.Phi][1], H, root)
    R, omega_next, beta = papers.vae_step(*args, *values)
    assume(H * np.linalg.norm(omega_next) < 0.9)  # where there is one solution
    scale = 1.0 + np.abs(omega_next).max() + np.abs(beta).max()
    assert_allclose(quaternion.to_matrix(found.q[1]), R, atol=1e-12)
    assert_allclose(found.gyro_bias[1], beta, atol=1e-11 * scale)
    assert_allclose(omega_of(made, found)[1], omega_next, atol=1e-9 * scale)


@settings(max_examples=200)
@given(
    c=vectors(20.0),
    start=vectors(50.0),
    turn=st.floats(1e-6, 0.9),
    m=st.floats(0.01, 100.0),
    tolerance=st.sampled_from([1e-12, 1e-9, 1e-5]),
)
def test_the_implicit_equation_is_solved_to_its_tolerance(c, start, turn, m, tolerance):
    """Whatever c is, as long as omega turns by less than 0.9 rad in a step."""
    h = min(turn / max(np.linalg.norm(start), 1e-9), 1.0)

    def F(omega, exp=papers.exp):
        return omega - exp(-h * (c - omega)) @ start

    def by_scipy(phi):
        return expm(papers.hat(phi))

    y = so3.as_vector(m * start)
    omega, iterations = vae.solve(so3.as_vector(c), y, h, m, so3.as_vector(start), tolerance)
    assert 1 <= iterations <= 8
    # the last change is below the tolerance, and the iteration converges quadratically
    assert np.linalg.norm(F(np.array(omega), by_scipy)) < tolerance + 1e-13 * np.linalg.norm(start)
    assert_allclose(omega, root(F, start), atol=10.0 * tolerance + 1e-11)


def test_a_tolerance_that_is_looser_takes_fewer_iterations():
    taken = {}
    for tolerance in (1e-12, 1e-3):
        chosen = with_gains(BRISK, vae.Gains(m=1.0, tolerance=tolerance))
        made, _ = observing.restarted(BETA, n=200, i=100)
        found = vae.estimate(made, observing.starting(chosen, rate=(3.0, -2.0, 1.0)))
        taken[tolerance] = found.states["newton_iterations"].mean()
    assert 1.0 <= taken[1e-3] < taken[1e-12] <= 4.0


def test_steps_whose_equation_is_not_solved_are_counted_and_reported():
    """A step that turns omega by more than a radian may have several solutions."""
    made = observing.at_rest(6, h=1.0)
    chosen = with_gains(PAPER, vae.Gains(m=1.0, D=(0.01, 0.01, 0.01)))
    found = vae.estimate(made, observing.starting(chosen, rate=(0.25, -0.25, 1.3)))
    iterations = found.states["newton_iterations"]
    observing.assert_sound(found)
    assert iterations[0] == 1.0
    failed = int((iterations > vae.MOST_ITERATIONS).sum())
    assert failed > 0
    solved, stable = vae.promises(made, found, chosen)
    assert (solved.holds, solved.value, solved.bound) == (False, failed, 0.0)
    assert solved.seen.endswith(f"20 at most; {failed} steps did not converge")
    assert stable.holds


def test_a_run_whose_equations_are_solved_says_so_with_its_iterations():
    made, _ = observing.restarted(BETA, n=300, i=200)
    found = vae.estimate(made, PAPER)
    solved, stable = vae.promises(made, found, PAPER)
    most = int(found.states["newton_iterations"].max())
    assert (solved.holds, solved.value) == (True, 0.0)
    assert 1 < most <= 4
    assert f"{most} at most; 0 steps did not converge" in solved.seen
    assert stable.holds
    assert_allclose(stable.value, H * 20.3 / 5.0)


def test_dissipation_that_explicit_steps_cannot_take_is_reported():
    made = observing.at_rest(10, h=0.5)
    chosen = with_gains(PAPER, vae.Gains(m=1.0, D=(1.0, 4.1, 1.0)))
    _, stable = vae.promises(made, vae.estimate(made, chosen), chosen)
    assert (stable.holds, stable.bound) == (False, 2.0)
    assert_allclose(stable.value, 2.05)
    assert stable.seen == "h D/m is 2.05 at most"


def test_a_single_sample_promises_what_it_can():
    made = observing.at_rest(1)
    claims = vae.promises(made, vae.estimate(made, PAPER), PAPER)
    assert all(claim.holds for claim in claims)


@pytest.mark.parametrize("Phi", vae.POTENTIALS)
def test_potentials_rise_from_nothing_with_the_slope_that_the_kernel_takes(Phi):
    chosen = with_gains(PAPER, vae.Gains(Phi=Phi))
    x = np.concatenate([[0.0], np.logspace(-6, 2, 60)])
    n, h = len(x), 1e-6

    def potential(cost):
        found = replace(
            vae.estimate(observing.at_rest(n), chosen),
            cost=cost,
            states={"omega_norm": np.zeros(n)},
        )
        return vae.lyapunov(found, chosen, np.zeros((n, 3)))

    slope = np.array([vae.slope(vae.POTENTIALS.index(Phi), x_i) for x_i in x.tolist()])
    assert potential(x)[0] == 0.0
    assert (slope > 0.0).all()
    assert_allclose((potential(x + h) - potential(x)) / h, slope, rtol=1e-4)
    assert_allclose(potential(x), POTENTIALS[Phi][0](x), atol=1e-15)
    assert_allclose(slope, POTENTIALS[Phi][1](x))
    # a cost that rounding leaves below zero is zero
    assert vae.slope(vae.POTENTIALS.index(Phi), -1e-9) == slope[0]
    assert potential(np.full(n, -1e-9))[0] == 0.0


@given(case=observing.cases(), omega=vectors(2.0), k=weights, w=st.none() | per_vector, g=gains)
def test_diagnostics_are_the_residual_wahbas_cost_and_omega(case, omega, k, w, g):
    chosen, e, u, W = weighting(case, k, w)
    found = vae.estimate(case.samples(), started(case, vae.Config(gains=g, weights=chosen), omega))
    R = quaternion.to_matrix(case.q)
    left, s = e - R @ u, papers.s_L(R, e @ W @ u.T)
    assert_allclose(found.s_norm[0], np.linalg.norm(s), atol=1e-7)
    assert_allclose(found.cost[0], 0.5 * np.trace(left.T @ left @ W), atol=1e-7)
    assert_allclose(found.states["omega_norm"][0], np.linalg.norm(omega), atol=1e-12)
    assert found.states["newton_iterations"][0] == 1.0


@given(case=observing.cases(), Q=observing.axis_turns, g=gains)
def test_a_run_does_not_care_how_the_world_is_turned_if_its_weights_turn_along(case, Q, g):
    weighted.assert_weights_turn_along(vae, case, with_gains(PAPER, g), Q)


@given(case=observing.cases(), Q=rotations, g=gains, w=per_vector)
def test_a_run_does_not_care_how_the_world_is_turned_with_weights_of_the_vectors(case, Q, g, w):
    weighted.assert_world_may_turn(vae, case, with_w(with_gains(PAPER, g), w), Q)


@given(case=observing.cases(), Q=rotations, g=isotropic, w=st.none() | per_vector)
def test_a_run_does_not_care_how_the_sensors_sit_in_the_body(case, Q, g, w):
    weighted.assert_body_may_turn(vae, case, with_w(with_gains(PAPER, g), w), Q)


@pytest.mark.slow
def test_attitude_stays_a_rotation_over_a_million_steps_without_projection():
    found = vae.estimate(observing.million_steps(), PAPER)
    assert np.abs(np.linalg.norm(found.q, axis=1) - 1.0).max() < 1e-10


@pytest.mark.slow
def test_every_start_but_the_unstable_ones_converges_and_finds_the_bias():
    errors, biases = observing.ends(vae, BRISK, 12001, BETA)
    assert errors.max() < 1e-3
    assert biases.max() < 1e-5


@pytest.mark.slow
def test_the_papers_gains_converge_from_everywhere_as_slowly_as_their_bias_does():
    """k/D and P of the paper put one pole at 0.01 rad/s: what the start did to the bias stays."""
    errors, biases = observing.ends(vae, PAPER, 12001, np.zeros(3))
    assert errors.max() < 1.5
    assert biases.max() < 0.015


@pytest.mark.parametrize("half_turn", HALF_TURNS)
def test_a_half_turn_off_is_an_equilibrium_that_any_push_leaves(half_turn):
    made, q = observing.at_rest(4000), quaternion.exp(half_turn)
    stuck = vae.estimate(made, observing.starting(BRISK, q))
    observing.assert_sound(stuck)
    assert stuck.s_norm[0] < 1e-14
    pushed = quaternion.multiply(quaternion.exp(np.full(3, 1e-6)), q)
    left = vae.estimate(made, observing.starting(BRISK, pushed))
    assert angle_deg(left.q[-1], IDENTITY) < 0.1


def test_a_perfect_estimate_at_rest_stays_where_it_is():
    for Phi in vae.POTENTIALS:
        weighted.assert_stays_at_rest(vae, with_gains(PAPER, vae.Gains(Phi=Phi)))


@given(case=observing.cases(), omega=vectors(2.0))
def test_a_step_without_length_changes_nothing(case, omega):
    case = replace(case, gyro=np.tile(case.gyro[0], (len(case.gyro), 1)))
    made = replace(case.samples(), t=np.zeros(len(case.gyro), np.int64))
    found = vae.estimate(made, started(case, PAPER, omega))
    assert angle_deg(found.q, case.q).max() < 1e-9
    assert_allclose(found.gyro_bias, np.broadcast_to(case.bias, (len(case.gyro), 3)))
    assert_allclose(omega_of(made, found), np.broadcast_to(omega, (len(case.gyro), 3)), atol=1e-12)
    short = vae.estimate(replace(case, h=1e-9).samples(), started(case, PAPER, omega))
    assert angle_deg(short.q, case.q).max() < 1e-4
    assert_allclose(short.angular_velocity, found.angular_velocity, atol=1e-6)


@given(
    made=observing.any_samples(),
    shipped=st.booleans(),
    w=st.none() | per_vector,
    Phi=st.sampled_from(vae.POTENTIALS),
)
def test_no_measurement_makes_a_nan(made, shipped, w, Phi):
    chosen = vae.Config() if shipped else BRISK
    chosen = with_gains(chosen, chosen.gains.model_copy(update={"Phi": Phi}))
    observing.assert_sound_run(vae, made, with_w(chosen, w))


def test_without_vectors_the_estimate_is_the_integrated_gyroscope():
    weighted.assert_integrates(vae)


@pytest.mark.parametrize("w", [None, [2.0]])
def test_with_one_vector_it_is_followed(w):
    weighted.assert_follows_one_vector(vae, with_w(BRISK, w), 6001)


@pytest.mark.parametrize("Phi", vae.POTENTIALS)
def test_lyapunov_function_falls_as_its_derivative_says(Phi):
    """V' = -omega.D omega, [VAE] (14), (23)."""
    rng, h = np.random.default_rng(5), 1e-6
    g = vae.Gains(m=1.5, D=(1.0, 2.0, 3.0), P=(5.0, 6.0, 7.0), Phi=Phi)
    for _ in range(10):
        q = quaternion.normalize(rng.normal(size=(2, 4)))
        Omega, omega, beta, beta_hat = rng.normal(size=(4, 3))
        U = observing.seen(observing.truth(q[0], np.tile(Omega, (2, 1)), h), np.eye(3))
        made = observing.sampled(np.tile(Omega + beta, (2, 1)), U, np.eye(3), h)
        for chosen in (with_gains(PAPER, g), with_w(with_gains(PAPER, g), [1.0, 2.0, 0.5])):
            rate = made.gyro[0] - omega - beta_hat
            found = vae.estimate(made, observing.starting(chosen, q[1], beta_hat, rate))
            V = vae.lyapunov(found, chosen, found.gyro_bias - beta)
            expected = -omega @ np.diag(g.D) @ omega
            assert_allclose((V[1] - V[0]) / h, expected, rtol=1e-3, atol=1e-3)


def values_of_lyapunov(chosen, h):
    Omega = observing.motion(round(12.0 / h), h)
    q = observing.truth(quaternion.exp(np.array([1.5, -0.7, 1.0])), Omega, h)
    made = observing.sampled(Omega + BETA, observing.seen(q, np.eye(3)), np.eye(3), h)
    found = vae.estimate(made, observing.starting(chosen))
    return vae.lyapunov(found, chosen, found.gyro_bias - BETA)


@pytest.mark.parametrize("Phi", vae.POTENTIALS)
@pytest.mark.parametrize("w", [None, [1.0, 2.0, 0.5]])
def test_lyapunov_function_never_grows_without_noise_but_for_the_explicit_step(Phi, w):
    """What it grows by in all, at the start where omega is next to nothing, shrinks with h."""
    chosen = with_gains(BRISK, BRISK.gains.model_copy(update={"Phi": Phi}))
    chosen = with_w(chosen, w)
    growth = {}
    for h in (H, H / 4.0):
        V = values_of_lyapunov(chosen, h)
        growth[h] = np.max(V - np.minimum.accumulate(V)) / V[0]
        assert V[-1] < 0.05 * V[0]
    assert growth[H] < 0.01
    assert growth[H / 4.0] < 0.3 * growth[H] + 1e-12


def test_a_restart_starts_attitude_and_omega_anew_and_keeps_the_bias():
    made, q = observing.restarted(BETA, n=6001, i=5000)
    found = vae.estimate(made, BRISK)
    assert angle_deg(found.q[5000], q[5000]) < 1e-5
    assert_allclose(omega_of(made, found)[5000], np.zeros(3), atol=1e-12)
    assert found.states["newton_iterations"][5000] == 1.0
    assert_allclose(found.gyro_bias[5000], found.gyro_bias[4999], atol=1e-5)
    assert_allclose(found.gyro_bias[4999], BETA, atol=1e-3)
    assert angle_deg(found.q[5000:], q[5000:]).max() < 0.2


def test_sub_steps_are_the_run_of_a_log_sampled_that_much_finer():
    observing.assert_sub_steps(vae, PAPER)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("m", 0.0, "'gains.m' is 0.0. It must be: greater than 0"),
        ("D", [1.0, 0.0, 1.0], "'gains.D.1' is 0.0. It must be: greater than 0"),
        ("P", [1.0, 1.0, -2.0], "'gains.P.2' is -2.0. It must be: greater than 0"),
        (
            "Phi",
            "cubic",
            "'gains.Phi' is \"cubic\". It must be: 'linear', 'logarithmic' or 'quadratic'",
        ),
        ("tolerance", 0.0, "'gains.tolerance' is 0.0. It must be: greater than 0"),
        ("tolerance", 0.01, "'gains.tolerance' is 0.01. It must be: less than or equal to 0.001"),
    ],
)
def test_gains_outside_the_theorem_are_refused_by_its_name(key, value, said):
    assert observing.refusal(vae, key, value) == f"my.yaml: {said} [VAE, Theorem 3.1]."
