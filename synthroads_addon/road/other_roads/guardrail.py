"""Steel guardrails along ramps and crossing roads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from ..things.body import Body, Course
from ..things.guardrail import Guardrail
from ..things.thing import Block, Thing, TwinTypes


class RampGuardrail(Thing):
    """A steel guardrail along a ramp or a crossing road, as a `Guardrail` is along the main road.

    Its stations and its offset are those of that road's own axis.
    """

    points_class: ClassVar = "guardrail"
    type: Literal["RampGuardrail"] = "RampGuardrail"
    road: str = Field(description="Id of the ramp or crossing road that it runs along.")
    start_station: float = quantity(ge=0, unit="m", description="Beginning along that road, terminal included.")
    end_station: float = quantity(ge=0, unit="m", description="End along that road, terminal included.")
    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its posts' axis from that road's axis.")
    faces: Literal["left", "right"] = Field(description="Side that the beam is mounted on.")
    height: float = quantity(0.75, ge=0.3, le=1.5, unit="m", description="Top of the beam above the surface.")
    post_spacing: float = quantity(4.0, ge=0.5, le=10, unit="m", description="Distance between posts.")
    terminal_length: float = quantity(
        12.0, ge=0, le=50, unit="m", description="Length over which either end is ramped into the ground."
    )

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a guardrail."""
        return TwinTypes("IfcRailing.GUARDRAIL", "barrier.guardRail", kind="Guardrail")

    def footprint(self) -> Iterator[Block]:
        """Yield nothing: it has no place in the main road's stations and offsets."""
        yield from ()

    def rail(self) -> Guardrail:
        """Return the guardrail that it is along its own road's axis."""
        names = (
            "instance",
            "start_station",
            "end_station",
            "offset",
            "faces",
            "height",
            "post_spacing",
            "terminal_length",
        )
        values = {name: getattr(self, name) for name in names}
        return Guardrail(**values)

    def bodies(self, course: Course) -> list[Body]:
        """Return its closed solids along its road's course, in local coordinates."""
        return self.rail().bodies(course)
