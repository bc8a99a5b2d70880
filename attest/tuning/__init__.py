"""Gains tuned against references, and what they are worth on data that was held back."""

from attest.tuning.crossvalidation import tune
from attest.tuning.plan import Errors, Fold, Plan, Tuned
from attest.tuning.scoring import METRICS
from attest.tuning.text import describe, text_of_tuning, yaml_of_tuning

__all__ = [
    "METRICS",
    "Errors",
    "Fold",
    "Plan",
    "Tuned",
    "describe",
    "text_of_tuning",
    "tune",
    "yaml_of_tuning",
]
