"""Whether a magnetometer's hard and soft iron, as a log tells it, is to be believed.

It must be observed, help on parts of the log that it was not made from, come out alike from both
halves, and change the heading by what matters. Else it is not applied.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import iron
from attest.conditioning.iron import ALL, HARD, Field, Fit, Iron
from attest.conditioning.windows import Windows
from attest.recording import Note

Array = NDArray[np.float64]

FEWEST = 8
"""Windows of a log; and samples of a window, on average."""
BLOCK = 2
"""Windows that belong to one half; the next ones to the other."""
OBSERVED = 0.02
"""Largest deviation of what is observed, as a share of the field's strength."""
HELPS = 0.9
"""Of the misfit of before, what may be left on held-back parts."""
HARMS = 1.05
"""More than this share of the misfit of before is worse."""
ALIKE = 0.5
"""By which share of what is changed the halves may differ."""
MATTERS = np.deg2rad(0.3)
"""Least change of heading that is worth it, rad."""
PARTS = 4
"""Of the log in its order, none of which may get worse."""
RUN, SPOILS = 4, 1.5
"""Windows in a row, and the share of the misfit of before that may be left in none of them."""
LARGE = 0.1
"""Share of the field from which hard iron is large."""
NIL = 1e-6
"""Misfit that is none, as a share of the strength."""
MICRO = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What a log tells of hard and soft iron, and whether it is worth applying."""

    iron: Iron
    deviation: Array
    """Of hard iron, tesla, shape (3,); infinite where the motion tells nothing."""
    left: Array
    """Share of the misfit that is left on the held-back halves, shape (2, 3) or (2, 2)."""
    heading: float
    """By which the heading changes, RMS, rad."""
    against: str
    """Why it is not to be applied; empty where it is."""


def judge(field: Field | None) -> Verdict | str:
    """Return what the samples tell, or why they tell nothing."""
    if field is None or len(field.spans) < FEWEST or len(field.c) < FEWEST**2:
        return f"the log has too little of it: {FEWEST} x {iron.WINDOW:g} s are needed"
    hard = iron.fit(field, HARD)
    variance, axes = np.linalg.eigh(hard.covariance)
    seen = axes[:, variance < OBSERVED**2]
    if not seen.shape[1]:
        return "the log's motion does not tell it"
    basis = HARD
    if seen.shape[1] < 3:
        basis = HARD @ seen
        hard = iron.fit(field, basis, hard.weight)
    verdicts = [_verdict(field, basis, hard)]
    whole = iron.fit(field, ALL, hard.weight)
    if np.linalg.eigvalsh(whole.covariance)[-1] < OBSERVED**2:
        verdicts.append(_verdict(field, ALL, whole))
    # both may pass, or none: then what leaves less is told
    return min(
        verdicts, key=lambda each: (each.against != "", float(np.log(each.left[:, :2]).sum()))
    )


def large(field: Field | None, verdict: Verdict | str) -> bool:
    """Tell whether a body's own field is a large share of what the samples show."""
    if field is None or isinstance(verdict, str):
        return False
    return float(np.linalg.norm(verdict.iron.hard)) > LARGE * field.strength


def _verdict(field: Field, basis: Array, fit: Fit) -> Verdict:
    """Judge a calibration, found in a basis of the unknowns."""
    found = iron.iron(fit.x, field.strength)
    of_hard = basis[iron.OF_HARD]
    told = np.linalg.norm(of_hard, axis=1) > 0.5  # share of an axis in what is observed
    variance = np.diag(of_hard @ fit.covariance @ of_hard.T)
    deviation = np.where(told, field.strength * np.sqrt(variance), np.inf)
    y = iron.taken_off(field, fit.x)
    changed = iron.heading(field, field.before, y)
    if changed < MATTERS:
        against = f"it would change the heading by {np.rad2deg(changed):.1f}° only"
        return Verdict(found, deviation, np.ones((2, 3)), changed, against)
    first = (np.arange(len(field.spans)) // BLOCK) % 2 == 0
    halves = [field.part(chosen) for chosen in (first, ~first)]
    fits = [iron.fit(half, basis, fit.weight) for half in halves]
    made = [iron.taken_off(field, each.x) for each in fits]
    left = np.vstack([_left(half, other) for half, other in zip(halves, made[::-1], strict=True)])
    against = _against(field, y, left, changed, iron.heading(field, *made))
    return Verdict(found, deviation, left, changed, against)


def _against(field: Field, y: Array, left: Array, changed: float, differs: float) -> str:
    """Say what speaks against a calibration that makes y (n, 3) of the field."""
    if not (left[:, :2] <= HELPS).all() or not (left <= HARMS).all():
        return f"held-back parts of the log are not clearly better by it ({_told(left)})"
    n, part = len(field.spans), np.arange(PARTS + 1)
    # the first parts are longer by one where n cannot be divided
    edges = part * (n // PARTS) + np.minimum(part, n % PARTS)
    worst = _left(field, y, edges)[:, 0].max()
    if worst > HARMS:
        return f"it makes a part of the log worse, by {worst - 1.0:.0%}"
    worst = _left(field, y, np.append(np.arange(0, n, RUN), n))[:, 0].max()
    if worst > SPOILS:
        return f"it makes {RUN * iron.WINDOW:g} s of the log worse, by {worst - 1.0:.0%}"
    if differs > ALIKE * changed:
        return f"the log's halves differ by {np.rad2deg(differs):.1f}° of heading over it"
    return ""


def described(iron: Iron) -> str:
    """Say hard and soft iron in numbers."""
    x, y, z = np.round(MICRO * iron.hard, 1) + 0.0  # without a negative zero
    text = f"hard iron {x:+.1f}, {y:+.1f}, {z:+.1f} µT"
    soft = 100.0 * float(np.abs(iron.soft - np.eye(3)).max())
    return text if soft < 1e-6 else f"{text} and soft iron up to {soft:.1f} %"


def note(verdict: Verdict | str) -> Note:
    """Say what was found, and what was done with it."""
    if isinstance(verdict, str):
        return Note(f"magnetometer used as it is: {verdict}")
    found = described(verdict.iron)
    if verdict.against:
        return Note(f"magnetometer used as it is: {found} found, but {verdict.against}")
    return Note(
        f"magnetometer: {found} found in the whole log and taken off, {_told(verdict.left)} on "
        f"held-back parts; heading changes by {np.rad2deg(verdict.heading):.1f}°"
    )


def given(field: Field | None, told: Iron) -> Note:
    """Say what a given calibration makes of the log."""
    text = f"magnetometer: {described(told)} taken off as configured"
    if field is None:
        return Note(text)
    y = iron.taken_off(field, iron.unknowns(told, field.strength))
    left = _left(field, y)
    scaled = np.median(np.linalg.norm(y, axis=1))
    # only shares of the strength that it makes compare
    left = left / max(float(scaled), 1e-12)
    worse = bool((left[:, :2] > 1.0 / HELPS).any())
    text += f", {_told(left)}"
    return Note(text + (": worse than without it" if worse else ""), doubt=worse)


def _left(field: Field, y: Array, edges: Windows | None = None) -> Array:
    """Return the share of the misfit that y (n, 3) leaves in all or in groups, (g, 3) or (g, 2)."""
    edges = np.array([0, len(field.spans)]) if edges is None else edges
    before = iron.misfits(field, field.before, edges)
    left: Array = (iron.misfits(field, y, edges) + NIL) / (before + NIL)
    return left


def _told(left: Array) -> str:
    """Say what is left of each misfit, in the worst case."""
    change = 100.0 * (left.max(axis=0) - 1.0)
    names = ("against the gyroscope", "in strength", "in dip")[: len(change)]
    return "misfit " + ", ".join(
        f"{c:+.0f} % {name}" for c, name in zip(change, names, strict=True)
    )
