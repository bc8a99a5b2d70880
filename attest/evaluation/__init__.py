"""How far an estimate is from a reference, and what the reference is worth."""

from attest.evaluation.evaluate import choose, evaluate

__all__ = ["choose", "evaluate"]
