"""Limits that the things of a sampled road are drawn within, as a scenario has them."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from ...base.schema import ClosedModel, Finite, notes, quantity


class Interval(ClosedModel):
    """Limits that a sampled value lies within."""

    minimum: Finite = Field(description="Smallest value.")
    maximum: Finite = Field(description="Largest value.")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        """Return the limits unchanged; ValueError if the maximum is less than the minimum."""
        if self.maximum < self.minimum:
            raise ValueError(f"maximum {self.maximum} must not be less than minimum {self.minimum}")
        return self


def interval(
    minimum: float, maximum: float, unit: str, description: str, title: str | None = None, **further_notes: Any
) -> Any:
    """Return a pydantic field for an `Interval` with its default limits, and optionally more of `notes`."""
    limits = Interval(minimum=minimum, maximum=maximum)
    return Field(limits, title=title, description=description, json_schema_extra=notes(unit=unit, **further_notes))


def share(default: float, description: str, title: str | None = None) -> Any:
    """Return a pydantic field, 0 to 1, for the probability that a road (or a carriageway) has something."""
    return quantity(default, "1", description, (0, 1), title=title)


class Limits(ClosedModel):
    """Base of the limits of a thing: its fields are among those of a part of the scenario.

    Attributes:
        group: part of the scenario.
        place: place of the fields among those of others in the group; those without one come last.
        allowed: interval -> the field of the thing whose limits it must keep to, or limits of its own.
    """

    group: ClassVar[Literal["barriers", "furniture", "roadside"]] = "furniture"
    place: ClassVar[int] = 1000
    allowed: ClassVar[Mapping[str, str | tuple[float, float]]] = {}
