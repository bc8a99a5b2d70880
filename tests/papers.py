"""The papers' algebra, transcribed naively from OBSERVERS.md: matrices, inverses, no short cuts.

Vectors are columns here: E = [e_1 … e_k] in the world, U = [u_1 … u_k] in the body. R takes body to
world.
"""

import numpy as np
from scipy.linalg import expm


def hat(a):
    """hat(a) b = a x b."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def vex(A):
    """Undo `hat`."""
    return np.array([A[2, 1], A[0, 2], A[1, 0]])


def joined(E, U):
    """Two vectors get their cross product as a third, [FTS] (6)-(7)."""
    if E.shape[1] != 2:
        return E, U
    return (
        np.column_stack([E, np.cross(E[:, 0], E[:, 1])]),
        np.column_stack([U, np.cross(U[:, 0], U[:, 1])]),
    )


def W(E, K):
    """Weights of the vectors, [FTS] (12)."""
    inverse = np.linalg.inv(E @ E.T)
    return E.T @ inverse @ K @ inverse @ E


def L(E, U, K):
    """L = E W U^T."""
    return E @ W(E, K) @ U.T


def s_L(R, L):
    """Residual."""
    return vex(L.T @ R - R.T @ L)


def w_L(R, L, Omega_hat, Omega_b):
    """Rate of the residual, [FTS] (48)."""
    first = L.T @ R @ hat(Omega_hat) + hat(Omega_hat) @ R.T @ L
    second = R.T @ L @ hat(Omega_b) + hat(Omega_b) @ L.T @ R
    return vex(first) - vex(second)


def cost(R, E, U, K):
    """Wahba's cost U = 1/2 <E - R U, (E - R U) W>."""
    left = E - R @ U
    return 0.5 * np.trace(left.T @ left @ W(E, K))


def exp(phi):
    """exp(hat(phi)), Rodrigues."""
    angle = np.linalg.norm(phi)
    if angle == 0.0:
        return np.eye(3)
    A = hat(phi / angle)
    return np.eye(3) + np.sin(angle) * A + (1.0 - np.cos(angle)) * A @ A


def fts(R, omega, beta_hat, Omega_m, E, U, K, k_p, k_v, kappa, mu, p, k_b):  # noqa: PLR0913, PLR0917
    """Right-hand sides of [FTS] (49), (51) and (50): R_hat', omega', beta_hat'."""
    a = 1.0 - 1.0 / p
    Omega_hat = Omega_m - omega - beta_hat
    residual = s_L(R, L(E, U, K))
    rate = w_L(R, L(E, U, K), Omega_hat, Omega_m - beta_hat)
    z_L = residual / (residual @ residual) ** a  # (46)
    Psi = omega - kappa * z_L  # (47)
    H = np.eye(3) - 2.0 * a * np.outer(residual, residual) / (residual @ residual)  # (52)
    omega_dot = (
        k_p * residual
        - k_v * Psi / (Psi @ Psi) ** a
        + mu * kappa / (residual @ residual) ** a * H @ rate
    ) / mu  # (51)
    return R @ hat(Omega_m - beta_hat - omega), omega_dot, k_p / k_b * residual


def predicted(R, E):
    """Return v_i = R^T e_i, columns."""
    return R.T @ E


def cgo(R, beta_hat, Omega_m, E, U, W, K_P, K_I):
    """Right-hand sides of [FTS] (90), (91): R_hat', beta_hat'; sums over W in place of one sum."""
    V, k = predicted(R, E), range(E.shape[1])
    ell = sum(W[i, j] * np.cross(U[:, i], V[:, j]) for i in k for j in k)
    return R @ hat(Omega_m - beta_hat + K_P * ell), -K_I * ell


def mahony(R, b, Omega_y, v_0, v, k, k_P, k_I):
    """Right-hand sides of [Mahony08] (32a), (32b): R_hat', b_hat'."""
    v_hat = R.T @ v_0
    omega_mes = sum(k_i * np.cross(v[:, i], v_hat[:, i]) for i, k_i in enumerate(k))  # (32c)
    return R @ (hat(Omega_y - b) + k_P * hat(omega_mes)), -k_I * omega_mes


def vae(R, omega, beta_hat, Omega_m, E, U, W, m, D, P, slope):  # noqa: PLR0913, PLR0917
    """Right-hand sides of [VAE] Theorem 3.1, (11), (20): R_hat', omega', beta_hat'."""
    left = E - R @ U
    U0 = 0.5 * np.trace(left.T @ left @ W)
    residual = s_L(R, E @ W @ U.T)
    Omega_hat = Omega_m - omega - beta_hat
    torque = -m * np.cross(Omega_hat, omega) + slope(U0) * residual - D @ omega
    return R @ hat(Omega_hat), torque / m, slope(U0) * np.linalg.inv(P) @ residual


def vae_step(R, omega, beta_hat, Omega_m, E, U, W, m, D, P, slope, h, solve):  # noqa: PLR0913, PLR0917
    """One step of [VAE] (30)-(33); Omega_m, U are pairs: at its beginning and at its end.

    solve(F, x) is a root of F near x.
    """

    def force(R, U):
        left = E - R @ U
        return slope(0.5 * np.trace(left.T @ left @ W)) * s_L(R, E @ W @ U.T)

    R_next = R @ exp(h * (Omega_m[0] - omega - beta_hat))  # (30)
    beta_next = beta_hat + h * np.linalg.inv(P) @ force(R, U[0])  # (31)
    known = (m * np.eye(3) - h * D) @ omega + h * force(R_next, U[1])

    def implicit(omega_next):
        Omega_hat = Omega_m[1] - omega_next - beta_next  # (33)
        return m * omega_next - exp(-h * Omega_hat) @ known  # (32)

    return R_next, solve(implicit, omega), beta_next


def Ps(X):
    """Symmetric part."""
    return 0.5 * (X + X.T)


def game(R, beta_hat, P, Omega_m, E, U, W, Q_Omega, Q_b):
    """Right-hand sides of [FTS] (82), (86) and (83)-(85): R_hat', beta_hat' and P' by blocks.

    The scan's 2 Ps(...) in (83) is Ps(...). W_ij I are in place of Q_i, those of a diagonal W.
    """
    P_a, P_c, P_b = P
    V, k = predicted(R, E), range(E.shape[1])
    pairs = [(W[i, j] * np.eye(3), U[:, i], V[:, i], V[:, j]) for i in k for j in k]
    ell = sum(np.cross(Q @ (v_i - u_i), v_j) for Q, u_i, v_i, v_j in pairs)  # (87)
    S = sum(hat(v_i).T @ Q @ hat(v_j) for Q, _, v_i, v_j in pairs)  # (88)
    C = sum(Ps(Q @ np.outer(v_i - u_i, v_j)) for Q, u_i, v_i, v_j in pairs)
    E_ = np.trace(C) * np.eye(3) - C  # (89)
    Omega_b = Omega_m - beta_hat
    a = Q_Omega + Ps(P_a @ hat(2.0 * Omega_b - P_a @ ell)) + P_a @ (E_ - S) @ P_a - P_c - P_c.T
    c = -hat(Omega_b - P_a @ ell) @ P_c + P_a @ (E_ - S) @ P_c - P_b
    b = Q_b + P_c.T @ (E_ - S) @ P_c
    return R @ hat(Omega_b - P_a @ ell), -P_c.T @ ell, (a, c, b)


def mekf_update(R, beta_hat, P, E, U, noise):
    """Take in u_i = R^T e_i + noise of variance noise_i about each axis: R_hat, beta_hat, P.

    Kalman's 6x6 equations for (theta, beta - beta_hat), R = R_hat exp(hat(theta)).
    """
    V = predicted(R, E)
    H = np.vstack([np.hstack([hat(v), np.zeros((3, 3))]) for v in V.T])
    S = H @ P @ H.T + np.kron(np.diag(noise), np.eye(3))
    gain = P @ H.T @ np.linalg.inv(S)
    x = gain @ (U - V).T.ravel()
    left = np.eye(6) - gain @ H
    joseph = left @ P @ left.T + gain @ np.kron(np.diag(noise), np.eye(3)) @ gain.T
    return R @ exp(x[:3]), beta_hat + x[3:], joseph


def mekf_transition(Omega, h):
    """Carry (theta, beta - beta_hat) over h: theta' = -Omega x theta - (beta - beta_hat)."""
    return expm(h * np.block([[-hat(Omega), -np.eye(3)], [np.zeros((3, 6))]]))


def mekf_predict(R, P, Omega, h, carried, intensity):
    """Carry R_hat and P over h by a transition, noise of diagonal intensity added: R_hat, P."""
    return R @ exp(h * Omega), carried @ P @ carried.T + h * np.diag(intensity)
