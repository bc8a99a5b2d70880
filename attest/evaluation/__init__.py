"""How far an estimate is from a reference, what that is worth, and what theory promised."""

from attest.evaluation.attestation import attest
from attest.evaluation.evaluate import choose, errors_deg, evaluate, in_time, interpolated, unshared

__all__ = ["attest", "choose", "errors_deg", "evaluate", "in_time", "interpolated", "unshared"]
