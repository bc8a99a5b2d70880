"""Whether a reference turns as the gyroscope does, and if not, what it seems to be."""

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.geometry import frames, quaternion
from attest.inspection import compared, mounting, turning, worlds
from attest.inspection.compared import Cells
from attest.inspection.turning import CLEAR, FITS, NEARLY, SIGNED, Fit
from attest.recording import Note, Recording, Reference, Signal

Array = NDArray[np.float64]

FINEST = 0.02
"""Faster references are thinned to this step, s."""
NORTH = np.array([1.0, 0.0, 0.0])
PROPER = SIGNED[np.linalg.det(SIGNED) > 0.0][1:]
"""The 23 ways to turn axes onto others."""
FLU = np.diag([1.0, -1.0, -1.0])
OTHERWISE = "does not turn as the gyroscope does"
SURE = 0.95
"""Share of its turning that the gyroscope explains, from which no shift is looked for."""
STUCK, WHOLLY = 0.2, 0.99
"""Shares of the gyroscope's turns at which a reference that is stuck, at times or wholly, stands
still."""
SHORTEST_SHIFT = 0.15
"""Shifts below this are left to the run, which finds them itself, s."""
LONGEST_OFFSET = 1.9
"""A run finds and takes off shifts below this, s."""
MOST_NAMED = 2
"""Forms that fit alike and are still named."""


def default(recording: Recording) -> Reference | None:
    """Return the reference that a run compares with unless told otherwise."""
    return next(iter(recording.references.values()), None)


def north(reference: Reference) -> Signal:
    """Return the world's first axis in the body by a reference, a vector like a measured one."""
    every = max(1, int(FINEST / turning.period(reference.t)))
    body = quaternion.rotate(quaternion.conjugate(reference.q[::every]), NORTH)
    return Signal(reference.t[::every], body, reference.name)


def doubts(recording: Recording, found: Mapping[str, Fit], witness: str) -> Iterator[Note]:
    """Yield that the default reference does not turn as the gyroscope does.

    The witness is what turns as the gyroscope does, in words; empty where nothing does.
    """
    reference, fit = default(recording), found.get("reference")
    if reference is None or (not witness if fit is None else fit.as_read > SURE):
        return
    gyro = turning.thinned(recording.signals["gyro"])
    recording = replace(recording, signals={**recording.signals, "gyro": gyro})
    cells = compared.cells(gyro, reference)
    if cells is None:
        return
    share = compared.explained(cells, np.eye(3))
    fits = share >= FITS or (fit is not None and fit.as_read >= FITS)
    what = _stuck(cells, witness)
    if what is None and not fits:
        what = _form(recording, reference, cells, bool(witness))
    what = what or _late(recording, reference, share)
    if what is None and witness and not fits:
        what = f"{OTHERWISE}, which the {witness} confirms: it may be of another flight or time"
    if what is not None:
        yield Note(f"the reference {reference.name} {what}", doubt=True)


def _stuck(cells: Cells, witness: str) -> str | None:
    """Tell that the reference stands still where the gyroscope is confirmed to turn."""
    share, rest = compared.still(cells)
    at_times = share < WHOLLY
    if not witness or share < STUCK or (at_times and compared.explained(rest, np.eye(3)) < CLEAR):
        return None
    when = f"in {share:.0%} of the gyroscope's turns" if at_times else "while the gyroscope turns"
    return f"does not move {when}, which the {witness} confirms: it is stuck, or slow"


def _form(recording: Recording, reference: Reference, cells: Cells, known: bool) -> str | None:
    """Tell in which form the reference would turn as the gyroscope does, the best of all."""
    shares = {f"it seems to be {form}": share for form, share in _forms(recording, reference)}
    for axes in PROPER:
        shares[_of_axes(recording, reference, axes, known)] = compared.explained(cells, axes)
    best = max(shares.values())
    if best < CLEAR:
        return None
    alike = [text for text, share in shares.items() if share > best - NEARLY]
    if len(alike) > MOST_NAMED:
        return f"{OTHERWISE}: it is in another form, and the motion leaves open in which"
    return f"{OTHERWISE}: {', or '.join(alike)}"


def _forms(recording: Recording, reference: Reference) -> Iterator[tuple[str, float]]:
    """Yield other readings of the quaternions, and what the gyroscope explains of their turns."""
    foreign = reference.world not in {None, recording.world}
    q = frames.bring(reference.q) if foreign else reference.q
    first, last = (_columns(recording, reference, by) for by in (1, -1))
    for form, other in (
        ("world to body", quaternion.conjugate(q)),
        (f"in the order (x, y, z, w){first}", np.roll(q, 1, axis=1)),
        (f"in the order (w, x, y, z){last}", np.roll(q, -1, axis=1)),
    ):
        read = replace(reference, q=frames.bring(other) if foreign else other)
        cells = compared.cells(recording.signals["gyro"], read)
        yield form, 0.0 if cells is None else compared.explained(cells, np.eye(3))


def _columns(recording: Recording, reference: Reference, by: int) -> str:
    """Name the option that takes the columns of a log's own reference so many places later."""
    columns = recording.details.get("reference_columns")
    if reference.world is not None or not isinstance(columns, Sequence) or len(columns) != 4:
        return ""
    told = json.dumps([*columns[-by:], *columns[:-by]], ensure_ascii=False)
    return f": --set {shlex.quote(f'input.csv.reference.columns={told}')}"


def _of_axes(recording: Recording, reference: Reference, axes: Array, known: bool) -> str:
    """Say that the body of the reference has other axes, or body and world have."""
    written = turning.written(axes)
    said = f"its axes and the gyroscope's differ, and would fit as {written}"
    if known:
        said = f"it seems to be of a body with other axes, of which {written} would fit"
        names = [name for name in mounting.SENSORS if name in recording.signals]
        options = (mounting.option(recording, name, axes.T) for name in names)
        said += f": {' '.join(options)}"
    if not np.array_equal(axes, FLU):
        return said
    turned = replace(reference, q=quaternion.multiply(reference.q, frames.BODY))
    up = worlds.verticals(recording)
    cosine = None if up is None else worlds.cosine(recording, turned, up)
    if cosine is not None and cosine > -worlds.OPPOSITE:
        return said
    if cosine is not None:
        declared = reference.world or recording.world
        said = f"it seems to be {worlds.SAID[worlds.OTHER[declared]]}, taken for {declared}"
    return said + worlds.try_reference(recording, reference)


def _late(recording: Recording, reference: Reference, share: float) -> str | None:
    """Tell at which other time the reference turns as the gyroscope does, and not as it stands."""
    gyro = recording.signals["gyro"]
    shift = compared.shift(gyro, reference)
    cells = None if shift is None else compared.cells(gyro, reference, shift)
    if shift is None or cells is None or abs(shift) < SHORTEST_SHIFT:
        return None
    shifted = compared.explained(cells, np.eye(3))
    if shifted < CLEAR or 1.0 - shifted > 0.5 * (1.0 - share):
        return None
    is_so, taken = ("early", "later") if shift > 0.0 else ("late", "earlier")
    text = f"is {is_so}: it turns as the gyroscope does when taken {abs(shift):.1f} s {taken}"
    if abs(shift) < LONGEST_OFFSET:
        return f"{text}: try --set evaluation.apply_time_offset=true"
    told = recording.details.get("reference_shift_s")
    whole = shift + (told if isinstance(told, float) else 0.0)
    return f"{text}: --set evaluation.reference_shift_s={whole:.2f}"
