"""Unit quaternions (w, x, y, z) by array, body to world: ``v_w = rotate(q, v_b)``.

Every function takes and returns arrays of shape (..., 4) or (..., 3) and broadcasts. Foreign
orders exist in readers and writers only, and are turned by `from_xyzw` and `to_xyzw`.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def from_xyzw(q_xyzw: Array) -> Array:
    """Reorder (x, y, z, w) to (w, x, y, z)."""
    return np.roll(q_xyzw, 1, axis=-1)


def to_xyzw(q: Array) -> Array:
    """Reorder (w, x, y, z) to (x, y, z, w)."""
    return np.roll(q, -1, axis=-1)


def normalize(q: Array) -> Array:
    """Scale to unit length; zero gives NaN."""
    with np.errstate(invalid="ignore", divide="ignore"):
        unit: Array = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return unit


def continuous(q: Array) -> Array:
    """Choose the signs of (n, 4) quaternions so that neighbours are never opposite."""
    turns = np.flatnonzero(np.einsum("ij,ij->i", q[1:], q[:-1]) < 0.0) + 1
    if not len(turns):
        return q
    signs = np.ones(len(q))
    signs[turns] = -1.0
    signed: Array = q * np.cumprod(signs)[:, np.newaxis]
    return signed


def conjugate(q: Array) -> Array:
    """Inverse of a unit quaternion."""
    inverse: Array = q * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse


def multiply(a: Array, b: Array) -> Array:
    """Hamilton product, so that ``rotate(multiply(a, b), v) == rotate(a, rotate(b, v))``."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def rotate(q: Array, v: Array) -> Array:
    """Turn vectors by unit quaternions: body components to world components."""
    u = 2.0 * np.cross(q[..., 1:], v)
    turned: Array = v + q[..., :1] * u + np.cross(q[..., 1:], u)
    return turned


def exp(phi: Array) -> Array:
    """Quaternion of a rotation vector, rad; exact at zero."""
    half = 0.5 * np.linalg.norm(phi, axis=-1, keepdims=True)
    # sinc(x/pi) = sin(x)/x, and 1 at 0
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * phi], axis=-1)


def log(q: Array) -> Array:
    """Rotation vector of the shorter way, rad, of length at most pi."""
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.where(sine > 1e-12, 2.0 * half / sine, 2.0)
    phi: Array = scale * q[..., 1:]
    return phi


def from_euler(roll: Array, pitch: Array, yaw: Array) -> Array:
    """Quaternion of roll, pitch and yaw in radians: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr = np.cos(0.5 * roll), np.sin(0.5 * roll)
    cp, sp = np.cos(0.5 * pitch), np.sin(0.5 * pitch)
    cy, sy = np.cos(0.5 * yaw), np.sin(0.5 * yaw)
    return np.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )


def to_euler(q: Array) -> Array:
    """Roll, pitch and yaw in radians, shape (..., 3), of R = Rz(yaw) Ry(pitch) Rx(roll).

    By half sum and half difference of roll and yaw, which keep their digits where the nose points
    straight up or down: the three angles make up the attitude there too.
    """
    w, x, y, z = np.moveaxis(q, -1, 0)
    half_sum = np.arctan2(x + z, w - y)
    half_difference = np.arctan2(x - z, w + y)
    pitch = 2.0 * np.arctan2(np.hypot(x - z, w + y), np.hypot(x + z, w - y)) - 0.5 * np.pi
    roll, yaw = half_sum + half_difference, half_sum - half_difference
    turns = 2.0 * np.pi
    return np.stack(
        [roll - turns * np.round(roll / turns), pitch, yaw - turns * np.round(yaw / turns)], axis=-1
    )


def to_matrix(q: Array) -> Array:
    """Rotation matrix (..., 3, 3) of unit quaternions, body to world."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def slerp(t: NDArray[np.int64], q: Array, at: NDArray[np.int64], longest_gap: int) -> Array:
    """Interpolate (n, 4) unit quaternions at other times, NaN outside and across gaps.

    Parameters
    ----------
    t, q
        Stamps in nanoseconds, strictly increasing, and the rotations there.
    at
        Times wanted, nanoseconds.
    longest_gap
        Never interpolate between stamps further apart than this, nanoseconds. A time that equals
        a stamp takes that rotation as it is.
    """
    out = np.full((len(at), 4), np.nan)
    if not len(t):
        return out
    right = np.clip(np.searchsorted(t, at, side="left"), 0, len(t) - 1)
    left = np.maximum(right - (t[right] != at), 0)
    gap = t[right] - t[left]
    inside = (t[left] <= at) & (at <= t[right]) & (gap <= longest_gap)
    left, right, gap, at = left[inside], right[inside], gap[inside], at[inside]
    share = np.where(gap > 0, (at - t[left]) / np.maximum(gap, 1), 0.0)
    step = log(multiply(conjugate(q[left]), q[right]))
    out[inside] = multiply(q[left], exp(share[:, np.newaxis] * step))
    return out
