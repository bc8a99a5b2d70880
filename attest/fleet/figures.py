"""What is followed from flight to flight."""

from dataclasses import dataclass
from math import degrees


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure of a row, as it is shown."""

    title: str
    column: str
    """Of the summary."""
    unit: str
    scale: float = 1.0
    """From the summary's unit to the one shown."""
    digits: int = 2
    """Behind the point; what these do not show is no news."""
    error: bool = False
    """Whether it is against a reference: figures against different ones do not compare."""
    positive: bool = False
    """Whether it is a size: then large flights are odd, small ones are not."""
    turn: bool = False
    """Whether it is an angle, that begins anew after a full turn."""
    level: bool = True
    """Whether single flights far from the level are odd."""


def _axes(title: str, column: str, unit: str, scale: float, digits: int) -> tuple[Figure, ...]:
    return tuple(Figure(f"{title} {a}", column.format(a), unit, scale, digits) for a in AXES)


AXES = ("x", "y", "z")
FIELD, FIELD_SHARE, MODEL = "field_ut_median", "field_share", "field_ut_model"
"""The field's strength where there is no model of it, its share of the model's, and the model's."""
FIGURES = (
    *_axes("gyro bias", "gyro_bias_{}", "°/s", degrees(1.0), 3),
    *_axes("gyro scale", "gyro_scale_{}", "%", 100.0, 2),
    *_axes("hard iron", "hard_iron_{}_ut", "µT", 1.0, 1),
    Figure("soft iron", "soft_iron", "%", 100.0, 1, positive=True),
    Figure("field/model", FIELD_SHARE, "%", 100.0, 1),
    Figure("field", FIELD, "µT", 1.0, 1),
    Figure("mag latency", "mag_latency_s", "ms", 1e3, 0, level=False),  # zero may be untold
    Figure("total RMSE", "total_rmse_deg", "°", error=True, positive=True),
    Figure("heading RMSE", "heading_rmse_deg", "°", error=True, positive=True),
    Figure("inclination RMSE", "inclination_rmse_deg", "°", error=True, positive=True),
    Figure("heading offset", "heading_offset_deg", "°", error=True, turn=True),
    Figure("mounting", "misalignment_deg", "°", error=True, positive=True),
)
"""In the order in which they are listed."""
IRON = ("hard_iron_x_ut", "hard_iron_y_ut", "hard_iron_z_ut", "soft_iron")
"""Columns that are no finding where the iron was given."""
COLUMNS = tuple(dict.fromkeys([*(f.column for f in FIGURES if f.column != FIELD_SHARE), MODEL]))
"""Of the summary, that figures are made of."""
