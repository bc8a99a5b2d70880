"""The papers' algebra, transcribed naively from OBSERVERS.md: matrices, inverses, no short cuts.

Vectors are columns here: E = [e_1 … e_k] in the world, U = [u_1 … u_k] in the body. R takes body to
world.
"""

import numpy as np


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
