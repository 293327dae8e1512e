"""`CloudScenario`: which files the cloud is written to, and what they hold of each point."""

from typing import Literal, Self, get_args

from pydantic import Field, field_validator, model_validator

from ..base.classes import ClassScheme, class_scheme
from ..base.schema import ClosedModel, first_repeated, notes, quantity
from ..base.text.gps_time import ADJUSTMENT, gps_seconds
from ..cloud.layers import DEFAULT_ATTRIBUTES, LAYERS, Attribute
from ..scanning.scene.classify import check_selectors

CloudFormat = Literal["laz", "las", "copc.laz", "ply", "pcd", "e57", "npz"]
_COPC = "copc.laz"
STRIPS = "strips"
"""Folder of the strips' files."""
Intensity = Literal["received", "range_corrected"]


class CloudScenario(ClosedModel):
    """The cloud's files and their content."""

    formats: tuple[CloudFormat, ...] = Field(
        ("laz",),
        min_length=1,
        description="Kinds of files.",
        json_schema_extra=notes(labels={name: name.upper() for name in get_args(CloudFormat)} | {_COPC: "COPC"}),
    )
    strip_files: bool = Field(
        False,
        title="File per Strip",
        description="Whether each strip (flight line, pass, position) gets files of its own too, in the folder strips.",
    )
    start_time: str | None = Field(
        None,
        title="Start (UTC)",
        description="Time in UTC at which the scan starts, such as 2026-05-04T09:30:00Z, by which points have GPS "
        "standard time less 1e9 s; if not given, their times count from the start.",
        json_schema_extra=notes(unset="Count from 0"),
    )
    attributes: tuple[Attribute, ...] = Field(
        DEFAULT_ATTRIBUTES,
        description="Attributes of each point beside those that every cloud has.",
        json_schema_extra=notes(labels={name: layer.label for name, layer in LAYERS.items()}),
    )
    classes: str = Field("17", min_length=1, description="17, 5, 19, or a JSON file of your own classes.")
    point_spacing: float | None = quantity(
        None,
        "m",
        "Edge of the grid cells, each of which keeps one point; all points if not given.",
        (0.001, 10),
        title="Thin Out to",
        unset="All points",
    )
    intensity: Intensity = Field(
        "received", description="As received, or multiplied by the squared range, often called reflectance."
    )
    intensity_scale: float | None = quantity(
        None, "1", "16-bit steps per unit of intensity; by the usual range if not given.", gt=0, unset="By the range"
    )

    @model_validator(mode="after")
    def _refuse_repetitions(self) -> Self:
        """Refuse a format or an attribute that is named twice."""
        for name in ("formats", "attributes"):
            if (repeated_name := first_repeated(getattr(self, name))) is not None:
                raise ValueError(f"{name} names {repeated_name} twice")
        return self

    @field_validator("start_time")
    @classmethod
    def _check_time(cls, value: str | None) -> str | None:
        """Return a time as it is; ValueError if it is none, or lies before the present leap seconds."""
        if value is not None:
            gps_seconds(value)
        return value

    @property
    def time_shift(self) -> float:
        """Return what is added to the points' times, s: 0 where they count from the scan's start."""
        return 0.0 if self.start_time is None else gps_seconds(self.start_time) - ADJUSTMENT

    def file_names(self) -> tuple[str, ...]:
        """Return the names of the cloud's files, ``cloud.laz`` and the like."""
        return tuple(f"cloud.{kind}" for kind in self.formats)

    def strip_file_names(self, strip: int) -> tuple[str, ...]:
        """Return the names of a strip's files, ``strips/strip-001.laz`` and the like; strips count from 0."""
        return tuple(f"{STRIPS}/strip-{strip + 1:03d}.{kind}" for kind in self.formats)

    def arrays(self) -> frozenset[str]:
        """Return the names of the `PointBlock` arrays that the attributes need: no other need be computed."""
        return frozenset[str]().union(*(LAYERS[name].types for name in self.attributes))

    def scheme(self) -> ClassScheme:
        """Return the cloud's class scheme; InputError if there is none, or no thing that it names."""
        scheme = class_scheme(self.classes)
        check_selectors(scheme, self.classes)
        return scheme
