"""What the tests of several observers share: motions of known truth, and runs over them."""

from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
import pytest
from flights import angle_deg, samples
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from strategies import arrays, directions, frames, rotations, vectors

from attest import config
from attest.errors import ConfigError
from attest.geometry import quaternion

H = 0.01
"""Step of the papers' experiments, s."""
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
HALF_TURNS = [np.pi * axis for axis in np.eye(3)]
AXIS_TURNS = [
    Q
    for order in permutations(range(3))
    for signs in product((-1.0, 1.0), repeat=3)
    if np.linalg.det(Q := np.diag(signs) @ np.eye(3)[list(order)]) > 0.0
]
"""The 24 turns of the world that keep K along its axes."""

axis_turns = st.sampled_from(AXIS_TURNS).map(
    lambda Q: quaternion.from_xyzw(Rotation.from_matrix(Q).as_quat())
)


def motion(n, h=H):
    """Return Omega of [FTS] (96) at n steps."""
    t = h * np.arange(n)
    waves = np.sin(2 * np.pi * t / 15), np.sin(2 * np.pi * t / 18 + np.pi / 20)
    return np.stack([*waves, np.cos(2 * np.pi * t / 17)], axis=1)


def truth(q_0, Omega, h=H):
    """Return R_{i+1} = R_i exp(h hat(Omega_i)), as quaternions."""
    q = [q_0]
    for rate in Omega[:-1]:
        q.append(quaternion.multiply(q[-1], quaternion.exp(h * rate)))
    return quaternion.normalize(np.array(q))


def seen(q, E):
    """Return vectors E (k, 3) of the world as bodies of attitudes q (n, 4) see them, (n, k, 3)."""
    return quaternion.rotate(quaternion.conjugate(q)[:, np.newaxis], np.asarray(E, float))


def sampled(gyro, U, E, h=H, **other):
    """Return samples of a constant step of whole nanoseconds; E is (k, 3)."""
    t = np.arange(len(gyro)) * round(h * 1e9)
    E = np.asarray(E, float).reshape(1, -1, 3)
    return samples(t, np.ascontiguousarray(gyro), np.ascontiguousarray(U), E, **other)


def at_rest(n, E=None, h=H, **other):
    """Return samples of a body that lies along the world's axes and does not turn."""
    E = np.eye(3) if E is None else np.asarray(E, float).reshape(-1, 3)
    return sampled(np.zeros((n, 3)), np.broadcast_to(E, (n, *E.shape)), E, h, **other)


def initial(q=IDENTITY, bias=(0.0, 0.0, 0.0), rate=None):
    """Return a start at attitude q with a bias and, where given, an angular velocity."""
    return config.Initial(
        attitude=tuple(np.asarray(q).tolist()),
        bias=tuple(np.asarray(bias).tolist()),
        angular_velocity=None if rate is None else tuple(np.asarray(rate).tolist()),
    )


def starting(settings, *args, **kwargs):
    """Return a configuration that starts as `initial` says."""
    return settings.model_copy(update={"initial": initial(*args, **kwargs)})


@dataclass(frozen=True)
class Case:
    """A few steps of measurements, and where an observer of them starts."""

    gyro: np.ndarray
    U: np.ndarray
    E: np.ndarray
    q: np.ndarray
    bias: np.ndarray
    h: float

    def samples(self, **other):
        """Return the measurements."""
        return sampled(self.gyro, self.U, self.E, self.h, **other)

    def start(self, settings):
        """Return a configuration that starts there."""
        return starting(settings, self.q, self.bias)

    def in_a_turned_world(self, Q):
        """Return the same with other axes of the world: what was e is Q e."""
        return replace(self, E=quaternion.rotate(Q, self.E), q=quaternion.multiply(Q, self.q))

    def in_a_turned_body(self, Q):
        """Return the same with the sensors mounted otherwise: what was u is Q u."""
        return replace(
            self,
            gyro=quaternion.rotate(Q, self.gyro),
            U=quaternion.rotate(Q, self.U),
            q=quaternion.multiply(self.q, quaternion.conjugate(Q)),
            bias=quaternion.rotate(Q, self.bias),
        )


@st.composite
def cases(draw, n=8, h=1e-3, drift=0.1):
    """Draw a case of two to five vectors that fit one attitude, which is not the observer's.

    The gyroscope drifts by this much a step, rad/s.
    """
    E = draw(frames(draw(st.integers(2, 5))))
    body = quaternion.rotate(quaternion.conjugate(draw(rotations)), E)
    gyro = draw(vectors(5.0)) + drift * np.arange(n)[:, np.newaxis]
    U = np.broadcast_to(body, (n, *E.shape)).copy()
    return Case(gyro, U, E, draw(rotations), draw(vectors(1.0)), h)


def turned_weights(k, Q):
    """Return K along the axes of a world that one of `axis_turns` turned."""
    return tuple((np.abs(quaternion.to_matrix(Q).round()) @ np.array(k)).tolist())


def assert_turned_world(here, there, Q, atol=1e-9):
    """Both runs are the same but for the world's axes."""
    apart = angle_deg(quaternion.multiply(Q, here.q), there.q)
    assert_allclose(apart, 0.0, atol=np.rad2deg(atol))
    for name in ("angular_velocity", "gyro_bias", "s_norm", "cost"):
        assert_allclose(getattr(there, name), getattr(here, name), atol=atol, rtol=atol)


def assert_turned_body(here, there, Q, atol=1e-9):
    """Both runs are the same but for the body's axes."""
    apart = angle_deg(quaternion.multiply(there.q, Q), here.q)
    assert_allclose(apart, 0.0, atol=np.rad2deg(atol))
    for name in ("angular_velocity", "gyro_bias"):
        turned = quaternion.rotate(Q, getattr(here, name))
        assert_allclose(getattr(there, name), turned, atol=atol, rtol=atol)
    for name in ("s_norm", "cost"):
        assert_allclose(getattr(there, name), getattr(here, name), atol=atol, rtol=atol)


def assert_sound(found):
    """Estimates are finite and attitudes of unit length."""
    for name in ("q", "angular_velocity", "gyro_bias", "s_norm", "cost"):
        assert np.isfinite(getattr(found, name)).all(), name
    for name, state in found.states.items():
        assert np.isfinite(state).all(), name
    assert_allclose(np.linalg.norm(found.q, axis=1), 1.0, atol=1e-9)


def assert_sound_run(observer, made, settings):
    """Whatever was measured, `assert_sound`; what compiled code computes silently may not warn."""
    with np.errstate(all="ignore"):
        assert_sound(observer.estimate(made, settings))


def million_steps():
    """Return samples of a million sub-steps of 10 ms, of noise."""
    rng = np.random.default_rng(1)
    gyro, U = rng.normal(size=(1001, 3)), rng.normal(size=(1001, 3, 3))
    U /= np.linalg.norm(U, axis=2, keepdims=True)
    return sampled(gyro, U, np.eye(3), 10.0, substeps=np.full(1001, 1000))


def starts(count=500):
    """Return attitudes from everywhere, (count, 4)."""
    return quaternion.from_xyzw(Rotation.random(count, random_state=7).as_quat())


def ends(observer, settings, n, beta, count=500, h=H):
    """Run over motion (96) from attitudes everywhere; return last errors in degrees and rad/s."""
    Omega = motion(n, h)
    q = truth(IDENTITY, Omega, h)
    made = sampled(Omega + beta, seen(q, np.eye(3)), np.eye(3), h)
    errors, biases = [], []
    for start in starts(count):
        found = observer.estimate(made, starting(settings, start))
        errors.append(float(angle_deg(found.q[-1], q[-1])))
        biases.append(float(np.linalg.norm(found.gyro_bias[-1] - beta)))
    return np.array(errors), np.array(biases)


def restarted(beta, n=3001, i=2000):
    """Return samples that start anew at step i with the body turned unseen, and the truth."""
    Omega = motion(n)
    q = truth(quaternion.exp(np.array([0.5, -0.2, 0.8])), Omega)
    turned = quaternion.exp(np.array([0.0, 0.0, 2.0]))
    q[i:] = quaternion.multiply(q[i:], turned)
    Omega[i:] = quaternion.rotate(quaternion.conjugate(turned), Omega[i:])
    restart = np.isin(np.arange(n), [0, i])
    return sampled(Omega + beta, seen(q, np.eye(3)), np.eye(3), restart=restart), q


def assert_sub_steps(observer, settings, parts=5, atol=1e-9, *, straight=False):
    """Sub-steps are the run of a log that is sampled that much finer, its values between linear."""
    rng = np.random.default_rng(3)
    gyro, q = rng.normal(size=(20, 3)), quaternion.normalize(rng.normal(size=4))
    if straight:  # a rate without bends, between whose samples nothing is unknown
        gyro = gyro[0] + np.linspace(0.0, 1.0, 20)[:, np.newaxis] * (gyro[1] - gyro[0])
    U = seen(truth(IDENTITY, np.tile([0.4, -0.2, 0.8], (20, 1)), 0.05), np.eye(3))
    place = np.arange(19 * parts) / parts
    i, f = place.astype(int), (place % 1.0)[:, np.newaxis]
    middle = f + 0.5 / parts
    fine_gyro = (1.0 - middle) * gyro[i] + middle * gyro[i + 1]
    fine_U = (1.0 - f[..., np.newaxis]) * U[i] + f[..., np.newaxis] * U[i + 1]
    here = starting(settings, q)
    divided = np.full(20, parts)
    coarse = observer.estimate(sampled(gyro, U, np.eye(3), 0.05, substeps=divided), here)
    fine = observer.estimate(sampled(fine_gyro, fine_U, np.eye(3), 0.05 / parts), here)
    apart = angle_deg(coarse.q[:-1], fine.q[::parts])
    assert_allclose(apart, 0.0, atol=np.rad2deg(atol))
    assert_allclose(coarse.gyro_bias[:-1], fine.gyro_bias[::parts], atol=atol)


garbage = st.sampled_from([0.0, 1e-300, 1e-12, 1.0, 50.0, 999.0]).flatmap(
    lambda size: arrays(3, 1.0).map(lambda v: size * v)
)
"""Rates from nothing to more than any gyroscope measures, rad/s."""


@st.composite
def any_samples(draw, longest=4):
    """Draw samples of any measurements, validity, gaps and restarts, of up to four vectors."""
    n, k = draw(st.integers(2, 12)), draw(st.integers(0, longest))
    nothing = st.just(np.zeros(3))
    U = np.array([[draw(directions | nothing) for _ in range(k)] for _ in range(n)])
    E = np.array([[draw(directions) for _ in range(k)]])
    valid = np.array([draw(st.lists(st.booleans(), min_size=k, max_size=k)) for _ in range(n)])
    gap = st.sampled_from([1, 1000, 10_000_000, 10**9]) | st.integers(1, 10**9)
    t = np.cumsum(draw(st.lists(gap, min_size=n, max_size=n)))
    anew = draw(st.lists(st.booleans(), min_size=n - 1, max_size=n - 1))
    return samples(
        t,
        np.array([draw(garbage) for _ in range(n)]),
        U.reshape(n, k, 3),
        E.reshape(1, k, 3),
        valid=valid.reshape(n, k).astype(np.bool_),
        substeps=np.clip(-(-np.diff(t, append=t[-1]) // 10_000_000), 1, 100),
        restart=np.array([True, *anew]),
    )


def refusal(observer, key, value):
    """Return what is said of a gain, in my.yaml, that the observer refuses."""
    name = observer.Config().observer
    with pytest.raises(ConfigError) as caught:
        config.validate(observer.Config, {"observer": name, "gains": {key: value}}, "my.yaml")
    return str(caught.value)
