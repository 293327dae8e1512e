"""Settings of the panel "Calibration": materials with their classes, a real cloud, how it was seen, what is fitted.

It is no part of a job's description, but kept in the file with the scene.

Annotations are not postponed here: Blender reads the properties from them.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import bpy

from ...base.errors import InputError
from ...blender.materials import constants, scene_name
from ...blender.materials.image import base_color_image, color_image_node
from ...calibration.expected import texture_of
from ...calibration.job import CalibrationJob, MaterialTarget, Part, check_job
from ...cloud.selection.pavement import RoadClasses
from ...materials.surfaces import Reflection
from ...materials.table import Material, materials
from ...scanning.devices.device import device_names, load_device
from ..fields.numbers import LENGTH_DIGITS

_RAY = "RAY"


def _materials(self: Any, context: bpy.types.Context, typed: str) -> Iterator[str]:
    """Yield the names of materials in table and scene that contain the typed text, for a search field."""
    names = {*materials(), *(scene_name(item) for item in bpy.data.materials)}
    yield from sorted(name for name in names if typed.lower() in name.lower())


def _devices() -> Iterator[tuple[str, str, str]]:
    yield _RAY, "A Ray", "Infinitely thin beam: no footprint"
    for name in device_names():
        wide, high = load_device(name).divergence_mrad
        yield name, load_device(name).title, f"Divergence {wide:g} × {high:g} mrad"


class SYNTHROADS_PG_calibration_class(bpy.types.PropertyGroup):
    """A material to be calibrated and the class of the cloud that it is compared with."""

    material: bpy.props.StringProperty(name="Material", default="asphalt", search=_materials)
    told: bpy.props.StringProperty(
        name="Class", description="Number or name of a class of the cloud; with an axis: paved or line"
    )
    texture: bpy.props.BoolProperty(
        name="From Its Texture", description="Take the colours from the image texture of the scene's material"
    )
    texture_width: bpy.props.FloatProperty(
        name="Texture Width",
        description="Width of the surface that the image shows",
        default=1.0,
        min=1e-3,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )


_USUAL = (("road", "road_marking"), ("paved", "line"))
"""Classes of asphalt and paint in a cloud with classes, and beside an axis."""


def usual_classes(settings: Any) -> tuple[str, str]:
    """Return the usual classes of asphalt and paint in the settings' real cloud."""
    return _USUAL[bool(settings.axis)]


def _follow_axis(settings: Any, context: bpy.types.Context) -> None:
    """Give materials that have a usual class the one that is meant with the axis, or without; others stay."""
    before, now = _USUAL[not settings.axis], usual_classes(settings)
    for row in settings.classes:
        if row.told in before:
            row.told = now[before.index(row.told)]


class SYNTHROADS_PG_calibration(bpy.types.PropertyGroup):
    """Settings of the calibration panel."""

    classes: bpy.props.CollectionProperty(type=SYNTHROADS_PG_calibration_class, name="Materials")
    active: bpy.props.IntProperty(name="Active Material")
    real: bpy.props.StringProperty(
        name="Real Cloud",
        subtype="FILE_PATH",
        description="Cloud to compare with; if empty, only expected values are computed",
    )
    class_field: bpy.props.StringProperty(
        name="Class Field", description="Extra attribute of the cloud that holds the classes, if not the usual one"
    )
    axis: bpy.props.StringProperty(
        name="Axis",
        subtype="FILE_PATH",
        description="Axis of the road, which locates pavement and markings in a cloud without classes",
        update=_follow_axis,
    )
    paved: bpy.props.StringProperty(
        name="Paved", default="-7 -1; 1 7", description="Ranges of offsets from the axis that are pavement, m"
    )
    lines: bpy.props.StringProperty(name="Lines", default="-4 4", description="Offsets of markings from the axis, m")
    line_width: bpy.props.FloatProperty(
        name="Line Width", default=0.15, min=0.02, max=2.0, precision=LENGTH_DIGITS, unit="LENGTH"
    )
    device: bpy.props.EnumProperty(
        name="Beam", items=list(_devices()), description="Device whose beam footprint is used"
    )
    angles: bpy.props.StringProperty(name="Incidence", default="0 20 40 60", description="Incidence angles, degrees")
    ranges: bpy.props.StringProperty(name="Ranges", default="60", description="Ranges, m")
    use_scanner: bpy.props.BoolProperty(
        name="From One Place", description="Compute angles and ranges from the position of one scanner"
    )
    scanner: bpy.props.FloatVectorProperty(
        name="Scanner", description="Map coordinates of the scanner", subtype="TRANSLATION"
    )
    reflection: bpy.props.EnumProperty(
        name="Reflection",
        items=[("lambert", "Lambert", "Matt"), ("oren_nayar", "Oren-Nayar", "Rough, with facets of a given slope")],
    )
    range_corrected: bpy.props.BoolProperty(
        name="Range Corrected", description="The device has corrected its intensities for range"
    )
    decibels: bpy.props.FloatProperty(
        name="Decibels",
        description="Span of the file's 16-bit values, dB; 0: intensities are linear",
        min=0.0,
        max=200.0,
    )
    parts: bpy.props.EnumProperty(
        name="Fit",
        description="Properties to fit besides the brightness",
        items=[
            ("spread", "Spread", "How much the brightness varies from place to place"),
            ("wavelength", "Wavelength", "Distance over which the brightness varies"),
            ("slope", "Facet Slope", "Fall-off with the incidence angle, for Oren-Nayar reflection"),
        ],
        options={"ENUM_FLAG"},
        default={"spread", "wavelength"},
    )
    gain: bpy.props.FloatProperty(name="Gain", description="Gain of the device, if known; 0: fitted", min=0.0)
    table: bpy.props.StringProperty(
        name="Table", subtype="FILE_PATH", description="Material table to start from, and to save to (.json)"
    )

    def job(self, fit: bool) -> CalibrationJob:
        """Return the settings as a checked `CalibrationJob`, as the command line makes it.

        Raises:
            InputError: a field isn't what it should be, in the words of the command line's options.
        """
        table = path_of(self.table)
        road = None
        if self.axis and self.real:
            spans = tuple(_pair(text) for text in self.paved.split(";") if text.strip())
            road = RoadClasses(Path(path_of(self.axis) or ""), spans, _numbers("Lines", self.lines), self.line_width)
        names = [row.material for row in self.classes]
        scene = _scene_materials(names)
        job = CalibrationJob(
            targets=tuple(_material_target(row, scene, bool(self.real)) for row in self.classes),
            table=table if table is not None and table.exists() else None,
            real=path_of(self.real),
            class_field=self.class_field or None,
            road=road,
            device=None if self.device == _RAY else self.device,
            incidence_deg=_numbers("Incidence", self.angles),
            ranges=_numbers("Ranges", self.ranges),
            scanner=cast("tuple[float, float, float]", tuple(self.scanner)) if self.use_scanner else None,
            reflection=cast(Reflection, self.reflection),
            range_corrected=self.range_corrected,
            decibels=self.decibels or None,
            fit=fit,
            parts=cast("frozenset[Part]", frozenset(self.parts)),
            gain=self.gain or None,
            scene=scene,
        )
        check_job(job)
        return job


def textured_materials() -> set[str]:
    """Return the names of the scene's materials whose base colour is an image."""
    return {scene_name(item) for item in bpy.data.materials if color_image_node(item) is not None}


def _scene_materials(names: list[str]) -> dict[str, Material]:
    """Return the constant properties of those scene materials whose names are given, by name."""
    there = {scene_name(item) for item in bpy.data.materials}
    return dict(constants(name for name in names if name in there))


def _material_target(row: Any, scene: dict[str, Material], compared: bool) -> MaterialTarget:
    real_class = row.told if compared else None
    if not row.texture:
        return MaterialTarget(row.material, real_class)
    item = next((item for item in bpy.data.materials if scene_name(item) == row.material), None)
    pixels = None if item is None else base_color_image(item)
    if pixels is None:
        raise InputError("Texture", row.material, "the scene's material has no image as its base colour")
    texture = texture_of(pixels, row.texture_width, scene[row.material])
    return MaterialTarget(row.material, real_class, texture, row.texture_width)


def path_of(text: str) -> Path | None:
    """Return a property's path with Blender's ``//`` resolved; None if the property is empty."""
    return Path(bpy.path.abspath(text)) if text else None


def _numbers(field: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.replace(",", " ").split())
    except ValueError:
        raise InputError(field, text, "must be numbers with spaces between them") from None


def _pair(text: str) -> tuple[float, float]:
    values = _numbers("Paved", text)
    if len(values) != 2:
        raise InputError("Paved", text, "must be pairs FROM TO with semicolons between them")
    return values[0], values[1]


ATTACHED = (bpy.types.Scene, "synthroads_calibration", SYNTHROADS_PG_calibration)
