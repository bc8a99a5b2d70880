"""Variational attitude estimator with gyroscope bias, a Lie group variational integrator.

[VAE]  M. Izadi, S. P. Viswanathan, A. K. Sanyal, C. Silvestre, P. Oliveira, "The variational
       attitude estimator in the presence of bias in angular velocity measurements". Theorem 3.1,
       (11), (20); discrete Proposition 5.1, (30)-(33).

Symbols: R (as a quaternion q), beta_hat estimates of attitude and bias; omega = Omega_m -
Omega_hat - beta_hat; m its inertia, D its dissipation; P inertia of the bias; U0 Wahba's cost and
Phi(U0) the potential; s_L residual.

Departures: W is that of [FTS] (12), or diagonal as in the paper with ``weights.w``. The implicit
equations (32), (33) for omega at the end of a step are solved at the beginning of the next one,
where its measurement is at hand.
"""

from math import cos, sin, sqrt
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from attest.claims import Claim
from attest.config import Configuration, Section, VectorWeights
from attest.estimates import Estimates
from attest.geometry import mat3, so3, wahba
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.observer import (
    COLUMNS,
    Observer,
    between,
    constant_between,
    estimates,
    gain_matrices,
    initial_attitude,
    initial_omega,
    mean_rate,
    record,
    steps,
)
from attest.samples import Samples, segments

Array = NDArray[np.float64]
State = tuple[Quaternion, Vector, Vector]
"""q, omega, beta_hat."""
Numbers = tuple[float, Vector, Vector, int, float]
"""m, D, P, Phi, tolerance of the Newton-Raphson iteration."""

POTENTIALS = ("linear", "logarithmic", "quadratic")
MOST_ITERATIONS = 20
SMALL = 1e-4
"""Squared angle below which the Jacobian's coefficients are series."""
Positive = Annotated[float, Field(gt=0)]


class Gains(Section):
    """Gains of [VAE] Theorem 3.1 and Proposition 5.1."""

    theorem = "[VAE, Theorem 3.1]"

    m: Positive = 0.22
    """Inertia of omega; less follows changes quicker."""
    D: tuple[Positive, Positive, Positive] = (4.5, 4.5, 4.5)
    """Diagonal of the dissipation; more follows the vectors less, the gyroscope more."""
    P: tuple[Positive, Positive, Positive] = (2900.0, 2900.0, 2900.0)
    """Diagonal of the bias's inertia; more changes the bias slower."""
    Phi: Literal["linear", "logarithmic", "quadratic"] = "linear"
    """Potential of Wahba's cost x: x, ln(1 + x) (large residuals count less), x + x²/2 (more)."""
    tolerance: Annotated[float, Field(gt=0, le=1e-3)] = 1e-12
    """Of the Newton-Raphson iteration for omega, rad/s."""


class Config(Configuration):
    """Configuration of ``vae``; the defaults suit flight logs."""

    observer: str = "vae"
    gains: Gains = Gains()
    weights: VectorWeights = VectorWeights(k=(1.2, 1.0, 30.0))


@kernel
def slope(Phi: int, cost: float) -> float:
    """Return Phi'(x) of a potential, by its place in `POTENTIALS`, at Wahba's cost x."""
    x = max(cost, 0.0)  # rounding may leave it below
    if Phi == 1:
        return 1.0 / (1.0 + x)
    return 1.0 if Phi == 0 else 1.0 + x


@kernel
def _right_jacobian(phi: Vector) -> Matrix:
    """Return Jr with exp(phi + d) = exp(phi) exp(Jr d) to first order in d."""
    x = so3.dot(phi, phi)
    if x < SMALL:
        b, c = 0.5 - x / 24.0, 1.0 / 6.0 - x / 120.0
    else:
        angle = sqrt(x)
        b, c = (1.0 - cos(angle)) / x, (angle - sin(angle)) / (x * angle)
    A = mat3.hat(phi)
    return mat3.plus(mat3.plus(mat3.IDENTITY, mat3.times(-b, A)), mat3.times(c, mat3.matmul(A, A)))


@kernel
def solve(
    c: Vector, y: Vector, h: float, m: float, start: Vector, tolerance: float
) -> tuple[Vector, int]:
    """Solve m omega = exp(-h hat(c - omega)) y for omega by Newton-Raphson, (32) with (33).

    Returns
    -------
    omega
        The solution, or the last iterate.
    iterations : int
        How many it took; `MOST_ITERATIONS` + 1 where it did not converge.
    """
    omega = start
    for iteration in range(1, MOST_ITERATIONS + 1):
        phi = so3.scale(-h, so3.sub(c, omega))
        E = so3.matrix(so3.exp(phi))
        F = so3.sub(so3.scale(m, omega), mat3.apply(E, y))
        turned = mat3.matmul(mat3.matmul(E, mat3.hat(y)), _right_jacobian(phi))
        J = mat3.plus(mat3.diagonal((m, m, m)), mat3.times(h, turned))
        change = mat3.apply(mat3.inverse(J), F)
        omega = so3.sub(omega, change)
        if so3.dot(change, change) <= tolerance * tolerance:
            return omega, iteration
    return omega, MOST_ITERATIONS + 1


@kernel
def step(
    state: State,
    Omega_m: Vector,
    L: Matrix,
    constant: float,
    before: float,
    h: float,
    numbers: Numbers,
) -> tuple[State, State, Vector, float, int]:
    """Finish the step of length before, and advance attitude and bias by h, (30)-(33).

    Returns
    -------
    after
        q and beta_hat after the step, with the omega of its beginning.
    now
        q, omega and beta_hat at its beginning.
    s
        The residual s_L there.
    cost : float
        Wahba's cost there.
    iterations : int
        Of the Newton-Raphson iteration.
    """
    q, omega, beta = state
    m, D, P, Phi, tolerance = numbers
    B = mat3.matmul(mat3.transpose(so3.matrix(q)), L)
    s, cost = wahba.residual(B), wahba.cost(constant, B)
    force = so3.scale(slope(Phi, cost), s)
    damped = (
        (m - before * D[0]) * omega[0] + before * force[0],
        (m - before * D[1]) * omega[1] + before * force[1],
        (m - before * D[2]) * omega[2] + before * force[2],
    )
    c = so3.sub(Omega_m, beta)
    omega, iterations = solve(c, damped, before, m, omega, tolerance)  # (32), (33)
    Omega_hat = so3.sub(c, omega)
    pushed = (force[0] / P[0], force[1] / P[1], force[2] / P[2])
    after = (
        so3.multiply(q, so3.exp(so3.scale(h, Omega_hat))),  # (30)
        omega,
        so3.add(beta, so3.scale(h, pushed)),  # (31)
    )
    return after, (q, omega, beta), s, cost, iterations


@kernel
def run(
    h: Array,
    substeps: NDArray[np.int64],
    gyro: Array,
    L: Array,
    start: State,
    numbers: Numbers,
    out: Array,
) -> None:
    """Fold (30)-(33) over the steps; row i of out (n, 13) is the state at step i.

    The last column is the most Newton-Raphson iterations that a sub-step before took.
    """
    state, before, most = start, 0.0, 0
    for i in range(len(h)):
        for j in range(substeps[i]):
            Omega_m, L_j = mean_rate(gyro, i, j, substeps[i]), between(L, i, j, substeps[i])
            constant = constant_between(L, i, j, substeps[i])
            state, now, s, cost, iterations = step(
                state, Omega_m, L_j, constant, before, h[i], numbers
            )
            most, before = max(most, iterations), h[i]
            if j == 0:
                q, omega, beta = now
                Omega_hat = so3.sub(so3.sub(so3.row(gyro, i), beta), omega)
                record(out, i, q, Omega_hat, beta, sqrt(so3.dot(s, s)), cost)
                out[i, 12], out[i, 13] = sqrt(so3.dot(omega, omega)), most
                most = 0


def estimate(samples: Samples, config: Config) -> Estimates:
    """Estimate attitude and gyroscope bias; the bias survives a restart, the rest starts anew."""
    gains = config.gains
    numbers = (gains.m, gains.D, gains.P, POTENTIALS.index(gains.Phi), gains.tolerance)
    out = np.empty((len(samples.t), COLUMNS + 2))
    beta = np.array(config.initial.bias)
    for part in segments(samples):
        gyro = samples.gyro[part]
        q = initial_attitude(samples, part, config.initial)
        omega = initial_omega(gyro, part, config.initial, beta)
        start = (so3.as_quaternion(q), so3.as_vector(omega), so3.as_vector(beta))
        L = gain_matrices(samples, part, config.weights)
        run(steps(samples, part), samples.substeps[part], gyro, L, start, numbers, out[part])
        beta = out[part.stop - 1, 7:10]
    return estimates(
        "vae", samples, out, states={"omega_norm": out[:, 12], "newton_iterations": out[:, 13]}
    )


def lyapunov(found: Estimates, config: Config, beta_tilde: Array) -> Array:
    """Return V = m/2 omega.omega + Phi(U0) + 1/2 beta_tilde.P beta_tilde, [VAE] (13), (22)."""
    gains = config.gains
    x = np.maximum(found.cost, 0.0)
    potential = {"linear": x, "logarithmic": np.log1p(x), "quadratic": x + 0.5 * x**2}[gains.Phi]
    on_bias = 0.5 * beta_tilde**2 @ np.array(gains.P)
    V: Array = 0.5 * gains.m * found.states["omega_norm"] ** 2 + potential + on_bias
    return V


def promises(samples: Samples, found: Estimates, config: Config) -> tuple[Claim, ...]:
    """Say how the implicit equation was solved, and whether dissipation is what it says."""
    iterations = found.states["newton_iterations"][1:]
    failed = int((iterations > MOST_ITERATIONS).sum())
    h = max(float(steps(samples, part).max(initial=0.0)) for part in segments(samples))
    largest = h * max(config.gains.D) / config.gains.m
    most = min(int(iterations.max(initial=0)), MOST_ITERATIONS)
    mean = float(np.sum(iterations)) / max(len(iterations), 1)
    return (
        Claim(
            statement=f"omega solves (32) to {config.gains.tolerance:g} rad/s",
            source="VAE, Proposition 5.1",
            seen=f"Newton-Raphson took {mean:.1f} iterations in the mean, {most} at most; "
            f"{failed} steps did not converge",
            holds=failed == 0,
            value=float(failed),
            bound=0.0,
        ),
        Claim(
            statement="explicit dissipation is stable: h D/m < 2",
            source="VAE, (32)",
            seen=f"h D/m is {largest:.3g} at most",
            holds=largest < 2.0,
            value=largest,
            bound=2.0,
        ),
    )


OBSERVER = Observer(
    title="Variational attitude and gyroscope bias",
    paper="Izadi, Viswanathan, Sanyal, Silvestre, Oliveira: Theorem 3.1, (11), (20), (30)-(33)",
    config=Config,
    estimate=estimate,
    lyapunov=lyapunov,
    promises=promises,
)
