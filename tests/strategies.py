"""What hypothesis draws: rotations, directions and vectors, the awkward ones among them."""

import numpy as np
from hypothesis import strategies as st

from attest.geometry import quaternion

NEAR = 1e-7
"""How near to the identity the smallest rotations are, rad."""


def arrays(size, largest):
    """Draw an array of components that are at most this large."""
    component = st.floats(-largest, largest, width=32)
    return st.tuples(*[component] * size).map(np.array)


def vectors(largest=10.0):
    """Draw a vector whose components are at most this large."""
    return arrays(3, largest)


def unit(v):
    """Scale to unit length; what is next to nothing becomes the last axis."""
    length = np.linalg.norm(v)
    return v / length if length > 0.01 else np.eye(len(v))[-1]


directions = arrays(3, 1.0).map(unit)
"""Unit vectors."""

anywhere = arrays(4, 1.0).map(unit)
small = directions.map(lambda axis: quaternion.exp(NEAR * axis))
half_turns = (directions | st.sampled_from(list(np.eye(3)))).map(
    lambda axis: quaternion.exp(np.pi * axis)
)

rotations = anywhere | small | half_turns
"""Unit quaternions (w, x, y, z): from everywhere, near the identity, and at a half turn."""

weights = st.lists(st.floats(1.0, 30.0, width=32), min_size=3, max_size=3, unique=True).map(
    np.array
)
"""K = diag(k1, k2, k3), distinct and at least 1."""


@st.composite
def frames(draw, count):
    """Draw unit vectors (count, 3), of which the first three are well apart."""
    axes = quaternion.to_matrix(draw(anywhere))
    near = [unit(axis + 0.4 * draw(directions)) for axis in axes[:count]]
    return np.stack([*near, *(draw(directions) for _ in range(count - 3))])
