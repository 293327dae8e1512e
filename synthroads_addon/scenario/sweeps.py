"""`SweepScenario`: the sweeps that a scan is cut into, and the boxes and labels of each."""

from typing import Self, get_args

from pydantic import Field, model_validator

from ..base.schema import ClosedModel, first_repeated, notes, quantity
from ..cloud.sweeps.registry import ENTRIES, SweepFormat

SURFACES = frozenset(
    {"ground", "road", "road_marking", "vegetation", "guardrail", "barrier", "noise_barrier", "roadside", "bridge"}
)
"""Classes of the full table that have no bounded things: they get no boxes unless they are named."""


class SweepScenario(ClosedModel):
    """Sweeps of a scan with boxes, tracks and labels, in the files that detectors and trackers are trained on."""

    formats: tuple[SweepFormat, ...] = Field(
        (),
        title="Formats of Sweeps",
        description="Formats of sweeps with boxes and labels to write.",
        json_schema_extra=notes(labels={name: ENTRIES[name].label for name in get_args(SweepFormat)}),
    )
    duration: float = quantity(0.1, "s", "Time that a sweep takes.", (0.001, 60), title="Time of a Sweep")
    box_range: float = quantity(
        100.0, "m", "Distance from the scanner up to which things get boxes.", gt=0, le=1e4, title="Boxes up to"
    )
    box_classes: str | None = Field(
        None,
        title="Classes of Boxes",
        description="Classes of the things that get boxes, separated by commas; if not given, all but road, ground, "
        "plants and barriers.",
        json_schema_extra=notes(unset="Vehicles and things"),
    )

    @model_validator(mode="after")
    def _refuse_repetitions(self) -> Self:
        """Refuse a format that is named twice."""
        if (repeated_name := first_repeated(self.formats)) is not None:
            raise ValueError(f"formats names {repeated_name} twice")
        return self
