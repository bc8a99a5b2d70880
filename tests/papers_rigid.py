"""[ESO], [REL] and TRIAD, transcribed naively from OBSERVERS.md, as `papers` does the others."""

from dataclasses import replace

import numpy as np
from papers import W, exp, hat, joined, s_L, vex, w_L


def eso(R, Omega_hat, sigma_hat, Omega_m, tau, J, L, gains):
    """Right-hand sides of [ESO] (30) and Psi of (29): R_hat', Omega_hat', sigma_hat', Psi."""
    alpha, gamma, kappa, k_sigma, k_Psi = gains
    s = s_L(R, L)
    w = w_L(R, L, Omega_hat, Omega_m)  # (27)
    z_L = (s @ s) ** ((alpha - 1.0) / gamma) * s  # (26)
    H = np.eye(3) - 2.0 * (1.0 - alpha) / gamma * np.outer(s, s) / (s @ s)  # (28)
    Psi = Omega_m - Omega_hat - kappa * z_L  # (29)
    Omega_dot = (
        np.linalg.inv(J) @ (np.cross(J @ Omega_m, Omega_m) + tau)
        + sigma_hat
        + (Psi @ Psi) ** ((alpha - 1.0) / 2.0) * k_Psi * Psi
        - kappa * (s @ s) ** ((alpha - 1.0) / gamma) * H @ w
    )
    return R @ hat(Omega_hat), Omega_dot, k_sigma * (Psi @ Psi) ** (alpha - 1.0) * Psi, Psi


def V_a(Psi, sigma_tilde, alpha, k_sigma):
    """Lyapunov function of rate and disturbance, [ESO] (34)."""
    return 0.5 * (k_sigma / alpha * (Psi @ Psi) ** alpha + sigma_tilde @ sigma_tilde)


def newmark(x, v, a, x_m, h, mu, w_n):
    """Newmark's method, gamma 1/2 and beta 1/4, as three equations solved at once."""
    equations = [
        [1.0, 0.0, -0.25 * h * h],  # x+ = x + h v + h²/4 (a + a+)
        [0.0, 1.0, -0.5 * h],  # v+ = v + h/2 (a + a+)
        [w_n**2, 2.0 * mu * w_n, 1.0],  # a+ + 2 mu w_n v+ + w_n² x+ = w_n² x_m
    ]
    given = [x + h * v + 0.25 * h * h * a, v + 0.5 * h * a, w_n**2 * x_m]
    return np.linalg.solve(equations, given)


def Omega_f(L_f, L_dot):
    """Rate of columns L_f that change by L_dot, [REL] (9)-(12), for G of full column rank."""
    G = np.vstack([hat(column) for column in L_f.T])
    return np.linalg.inv(G.T @ G) @ G.T @ L_dot.T.ravel()


def relative_fts(D, L, R, h, K, k_p, p, mu, w_n):
    """Run [REL] (9)-(12), (23), (40)-(42) over L (n, 3, k); return R_hat (n, 3, 3) and Omega_hat.

    The filter starts at rest at the first measurement.
    """
    x, v, a = L[0], np.zeros_like(L[0]), np.zeros_like(L[0])
    attitudes, rates = [], []
    for i, measured in enumerate(L):
        if i:
            for place in np.ndindex(x.shape):
                state = x[place], v[place], a[place]
                x[place], v[place], a[place] = newmark(*state, measured[place], h, mu, w_n)
        else:
            x = measured.copy()
        d, x_joined = joined(D, x)
        Gamma = d @ W(d, K) @ x_joined.T
        s = vex(Gamma.T @ R - R.T @ Gamma)
        omega = k_p * R @ s / (s @ s) ** (1.0 - 1.0 / p)  # (40)
        Omega_hat = Omega_f(x, v) - R.T @ omega  # (41)
        attitudes.append(R)
        rates.append(Omega_hat)
        R = R @ exp(h * Omega_hat)  # (42)
    return np.array(attitudes), np.array(rates)


def triad(E, U):
    """TRIAD for two vectors, by the two triads as columns, [Black64]."""
    triads = []
    for a, b in (E.T, U.T):
        c = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
        triads.append(np.column_stack([a, c, np.cross(a, c)]))
    return triads[0] @ triads[1].T


def biased(found):
    """Return estimates with a bias of zero, of an observer that estimates none."""
    assert found.gyro_bias is None
    return replace(found, gyro_bias=np.zeros_like(found.angular_velocity))
