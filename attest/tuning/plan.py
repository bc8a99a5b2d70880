"""What is asked of tuning, and what comes out."""

from collections.abc import Mapping
from dataclasses import dataclass

from attest.config import Configuration
from attest.tuning.knobs import Knob, Values, configured
from attest.tuning.scoring import Log

WORTH = 0.01
"""Least share of the held-back error that must go for tuning to be worthwhile; less is chance."""
SHORT = 2
"""Generations of a search that is too short to tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How to tune."""

    key: tuple[str, ...] = ()
    """Keys to tune besides the observer's gains."""
    factor: float = 30.0
    """How far from its start a key may go, either way."""
    metric: str = "total"
    """Of the errors, the one that is made least."""
    folds: int = 4
    """Into how many the data are cut; of several logs, at the most one for each."""
    skip: float = 0.0
    """What of each log's beginning is not scored, s."""
    generations: int = 25
    """At the most, for each fold."""
    seed: int = 0
    jobs: int = 0
    """Candidates that run at the same time; 0: as many as there are processors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """RMSE in degrees, mean over logs; infinite where an estimate is no number."""

    start: float
    """With the values that tuning started from."""
    tuned: float
    """With those that it found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """What came out with a part of the data held back."""

    held_back: str
    values: tuple[Values, ...]
    """The keys' values, tuned without it."""
    training: Errors
    error: Errors
    """On what was held back."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tuned:
    """Gains, and what they are worth."""

    logs: tuple[Log, ...]
    failed: Mapping[str, str]
    """Logs that could not be used, and why."""
    plan: Plan
    knobs: tuple[Knob, ...]
    values: tuple[Values, ...]
    """The keys' values, tuned on all."""
    training: Errors
    """On all."""
    held_back: Errors
    """Each log or block scored with the values that were tuned without it."""
    folds: tuple[Fold, ...]
    candidates: int
    """How many were run."""

    @property
    def nearer(self) -> int:
        """In how many folds tuning made the held-back error less."""
        return sum(fold.error.tuned < fold.error.start for fold in self.folds)

    @property
    def worthwhile(self) -> bool:
        """Whether enough search made the held-back error less, together and in most folds."""
        less = self.held_back.tuned < (1.0 - WORTH) * self.held_back.start
        return less and 2 * self.nearer > len(self.folds) and self.plan.generations > SHORT

    def configuration(self, start: Configuration) -> Configuration:
        """Return a configuration with the tuned values, or as it is where they are not worth it."""
        return configured(start, self.knobs, self.values) if self.worthwhile else start
