"""What a theory or a paper promises, and what came out."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One promise against what was seen."""

    statement: str
    """What is promised, in words."""
    source: str
    """Who promises it: paper, theorem or equation."""
    seen: str
    """What came out, in words and figures."""
    holds: bool | None
    """None where it cannot be told, such as for want of truth."""
    value: float | None = None
    """The figure that came out, in the unit that ``seen`` names."""
    bound: float | None = None
    """What it must not exceed."""
