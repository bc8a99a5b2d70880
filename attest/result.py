"""One finished run: what every writer and report is given."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from attest.claims import Claim
from attest.estimates import Estimates
from attest.metrics import Metrics
from attest.recording import Note, Recording, Reference
from attest.samples import Samples


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A log, run through one observer."""

    recording: Recording
    samples: Samples
    estimates: Estimates
    reference: Reference | None
    """The reference compared with, or None."""
    metrics: Metrics | None
    """None without a reference."""
    configuration: Mapping[str, object]
    """The effective configuration, JSON-like."""
    notes: tuple[Note, ...]
    """Of reading, conditioning and observing together."""
    summary: Mapping[str, Any]
    """The JSON document of the run, ``schema: 1``."""
    claims: tuple[Claim, ...] = ()
    """What the theory promises, against what was seen."""


def ranked(results: Sequence[Result]) -> list[Result]:
    """Return the runs of several observers over one log, the best first.

    By total RMSE against the reference; then those that it cannot score, by Wahba's mean cost,
    which tells of consistency only.
    """

    def score(result: Result) -> tuple[bool, float]:
        metrics = result.metrics
        figure = float(result.estimates.cost.mean()) if metrics is None else metrics.total.rmse
        return metrics is None, figure if math.isfinite(figure) else math.inf

    return sorted(results, key=score)
