"""Whether a reference turns as the gyroscope does, and if not, what it seems to be."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.inspection import turning
from attest.inspection.turning import CLEAR, FITS, Fit
from attest.recording import Note, Recording, Reference, Signal

Array = NDArray[np.float64]

FINEST = 0.02
"""Faster references are thinned to this step, s."""
NORTH = np.array([1.0, 0.0, 0.0])


def default(recording: Recording) -> Reference | None:
    """Return the reference that a run compares with unless told otherwise."""
    return next(iter(recording.references.values()), None)


def north(reference: Reference) -> Signal:
    """Return the world's first axis in the body by a reference, a vector like a measured one."""
    return _seen(reference, reference.q)


def doubts(recording: Recording, found: Mapping[str, Fit]) -> Iterator[Note]:
    """Yield that the default reference does not turn as the gyroscope does."""
    reference, fit = default(recording), found.get("reference")
    if reference is None or fit is None or fit.as_read >= FITS:
        return
    text = f"the reference {reference.name} does not turn as the gyroscope does: it seems to be "
    for form, mended in (
        ("world to body", quaternion.conjugate(reference.q)),
        ("in the order (x, y, z, w)", np.roll(reference.q, 1, axis=1)),
        ("in the order (w, x, y, z)", np.roll(reference.q, -1, axis=1)),
    ):
        other = turning.fit(recording.signals["gyro"], _seen(reference, mended))
        if other is not None and other.as_read > CLEAR:
            yield Note(text + form, doubt=True)
            return
    if fit.best > CLEAR and fit.unique and not fit.shared:
        alone = not any(other.as_read >= FITS for other in found.values())
        neutral = f"the gyroscope's axes and those of the reference {reference.name} differ"
        yield Note(neutral if alone else text + "of a body with other axes", doubt=True)


def _seen(reference: Reference, q: Array) -> Signal:
    every = max(1, int(FINEST / turning.period(reference.t)))
    body = quaternion.rotate(quaternion.conjugate(q[::every]), NORTH)
    return Signal(reference.t[::every], body, reference.name)
