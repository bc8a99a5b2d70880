"""What every group of keys has in common."""

from typing import ClassVar

from pydantic import BaseModel, ConfigDict


class Section(BaseModel):
    """A group of keys: unknown keys and infinities are refused, values never change."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    theorem: ClassVar[str] = ""
    """Where the ranges of the keys come from."""
