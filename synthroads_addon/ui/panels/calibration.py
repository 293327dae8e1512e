"""The panel "Calibration": materials beside a real cloud, fitted to it, saved to a table.

The work is `calibration.job`'s, in a thread.

Annotations are not postponed here: Blender reads the properties from them.
"""

from typing import ClassVar, NamedTuple, cast

import bpy
import numpy as np

from ...base.errors import InputError
from ...base.progress import exhaust
from ...calibration.fit import FITTED
from ...calibration.job import Calibration, CalibrationJob, ClassComparison, calibration_steps, save_fitted
from ...calibration.plot import calibration_picture
from ..fields.room import NAMES_SHARE, buttons_row, draw_text, fits, value_row
from ..fields.wording import title_case
from ..translations.blender import said
from ..work.common import Sidebar, column, large_button, refusing
from ..work.job import PanelJob
from ..work.long_operator import LongOperator
from ..work.pictures import ShowPicture, keep_picture
from .calibration_settings import path_of, textured_materials, usual_classes

_BOX_SHARE = 0.9
"""Share of a row that is within a box."""
_BELOW = 0.25
"""Share of the medians' span that the shortest of bars below 0 has; chosen: it is still seen."""
PICTURE = "SynthRoads Calibration"
"""Name of the image that shows the result."""


def panel_job(job: CalibrationJob) -> PanelJob[Calibration]:
    """Return a `PanelJob` that runs a calibration in a thread, as it touches none of Blender's data."""
    return PanelJob.aside("Calibration", lambda report: exhaust(calibration_steps(job), report), "Calibrating")


latest: Calibration | None = None
"""The last result."""


def fitted_result() -> Calibration | None:
    """Return the latest calibration if it fitted materials to a real cloud, else None."""
    return latest if latest is not None and latest.job.fit and latest.job.real is not None else None


class _CalibrationOperator(LongOperator):
    """Base of the two operators that calibrate: compare, and fit."""

    option_labels: ClassVar = {
        "--real": "Real Cloud",
        "--incidence-deg": "Incidence",
        "--range": "Ranges",
        "--line": "Lines",
        "--device": "Beam",
    }
    fit = False

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether nothing else is at work and the panel has a material, and a cloud if it fits."""
        if not super().poll(context):
            return False
        settings = context.scene.synthroads_calibration
        if not settings.classes or (cls.fit and not settings.real):
            text = "Choose a real cloud first" if settings.classes else "Add a material first"
            cls.poll_message_set(said(text))  # type: ignore[attr-defined]
            return False
        return True

    def job(self, context: bpy.types.Context) -> PanelJob[Calibration]:
        """Return the calibration that the panel's settings describe, to be run in a thread."""
        return panel_job(context.scene.synthroads_calibration.job(self.fit))

    def succeed(self, context: bpy.types.Context, job: PanelJob[Calibration]) -> str:
        """Keep the result as the latest and draw its diagrams; return a sentence with the largest errors."""
        global latest
        assert job.result is not None
        latest = job.result
        keep_picture(PICTURE, calibration_picture(job.result))
        return _sentence(job.result)


class SYNTHROADS_OT_compare_intensities(_CalibrationOperator, bpy.types.Operator):
    """Show the expected intensities of the materials beside those of the real cloud"""

    bl_idname = "synthroads.compare_intensities"
    bl_label = "Compare"


class SYNTHROADS_OT_fit_materials(_CalibrationOperator, bpy.types.Operator):
    """Fit the materials to the real cloud, with one gain of the device for all of them"""

    bl_idname = "synthroads.fit_materials"
    bl_label = "Fit"
    fit = True


class SYNTHROADS_OT_save_materials(bpy.types.Operator):
    """Save the fitted materials to the table, which scenarios name as materials_table"""

    bl_idname = "synthroads.save_materials"
    bl_label = "Save to Table"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether materials have been fitted."""
        if fitted_result() is None:
            cls.poll_message_set(said("Fit materials first"))
            return False
        return True

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Write the fitted materials to the table's file; other materials in it stay."""
        result, path = fitted_result(), path_of(context.scene.synthroads_calibration.table)
        if path is None:
            raise InputError("Table", None, "choose the file of the material table")
        save_fitted(cast(Calibration, result), path, overwrite=True)
        self.report({"INFO"}, said(f"Saved to {path}"))


class SYNTHROADS_OT_add_calibration_class(bpy.types.Operator):
    """Add a material to the comparison"""

    bl_idname = "synthroads.add_calibration_class"
    bl_label = "Add Material"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add a row to the list of materials: asphalt as the first, white paint after it."""
        settings = context.scene.synthroads_calibration
        row = settings.classes.add()
        number = min(len(settings.classes), 2) - 1
        row.material, row.told = ("asphalt", "paint_white")[number], usual_classes(settings)[number]
        settings.active = len(settings.classes) - 1
        return {"FINISHED"}


class SYNTHROADS_OT_remove_calibration_class(bpy.types.Operator):
    """Remove a material from the comparison"""

    bl_idname = "synthroads.remove_calibration_class"
    bl_label = "Remove Material"

    index: bpy.props.IntProperty(name="Number", description="Place of the material in the list, from 0 on")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove the row `index` from the list of materials."""
        context.scene.synthroads_calibration.classes.remove(self.index)
        return {"FINISHED"}


class SYNTHROADS_OT_show_calibration(ShowPicture, bpy.types.Operator):
    """Show the diagrams of the last comparison or fit in an image editor"""

    bl_idname = "synthroads.show_calibration"
    bl_label = "Show Diagrams"
    picture = PICTURE
    no_picture = "Compare or fit materials first"


class SYNTHROADS_PT_calibration(Sidebar, bpy.types.Panel):
    """Panel of the calibration: materials' intensities against those of a real cloud."""

    bl_label = "Calibration"
    bl_parent_id = "SYNTHROADS_PT_main"
    bl_order = 70
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the materials, cloud and view settings, the buttons, and the latest result."""
        layout, settings = column(self), context.scene.synthroads_calibration
        _draw_classes(layout, settings)
        _draw_cloud(layout.column(), settings)
        _draw_view(layout.column(), settings)
        _draw_value(layout, settings, "table")
        row = buttons_row(large_button(layout), ("Compare", "Fit"), align=True)
        row.operator(SYNTHROADS_OT_compare_intensities.bl_idname, icon="SEQ_HISTOGRAM")
        row.operator(SYNTHROADS_OT_fit_materials.bl_idname, icon="MOD_DATA_TRANSFER")
        if latest is not None:
            _draw_result(layout, latest)


def _draw_classes(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    textured = textured_materials()
    for index, item in enumerate(settings.classes):
        box = layout.box()
        row = box.row(align=True)
        row.prop(item, "material", text="")
        if settings.real:
            row.prop(item, "told", text="")
        row.operator(SYNTHROADS_OT_remove_calibration_class.bl_idname, text="", icon="X").index = index
        if item.material in textured:
            box.prop(item, "texture")
            if item.texture:
                box.prop(item, "texture_width")
    layout.operator(SYNTHROADS_OT_add_calibration_class.bl_idname, icon="ADD")


def _draw_value(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, name: str) -> None:
    """Draw a value beside its name, or below it where the sidebar is narrow."""
    value_row(layout, settings.bl_rna.properties[name].name).prop(settings, name, text="")


def _draw_cloud(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    _draw_value(layout, settings, "real")
    if not settings.real:
        return
    _draw_value(layout, settings, "axis")
    for name in ("paved", "lines", "line_width") if settings.axis else ("class_field",):
        _draw_value(layout, settings, name)
    for name in ("range_corrected", "decibels", "gain"):
        layout.prop(settings, name)
    names = [item.name for item in settings.bl_rna.properties["parts"].enum_items]
    side_by_side = all(fits(name, (1.0 - NAMES_SHARE) / len(names)) for name in names)
    (layout.row() if side_by_side else layout.column()).prop(settings, "parts")


def _draw_view(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    _draw_value(layout, settings, "device")
    _draw_value(layout, settings, "reflection")
    if settings.real:
        layout.prop(settings, "use_scanner")
    for name in ("scanner",) if settings.real and settings.use_scanner else ("angles", "ranges"):
        _draw_value(layout, settings, name)


def _draw_result(layout: bpy.types.UILayout, result: Calibration) -> None:
    """Draw a calibration's gain and figures by material, and the buttons to show diagrams and save the table."""
    if result.job.real is not None:
        draw_text(layout, f"Gain: {result.gain:.5g} units of the cloud per unit of the device, for all materials")
    _draw_chart(layout, result)
    for entry in result.compared:
        box = layout.box()
        for number, line in enumerate(result_lines(entry)):
            draw_text(box, line, "MATERIAL" if number == 0 else "NONE", share=_BOX_SHARE)
    row = buttons_row(layout, ("Show Diagrams", "Save to Table"), align=True)
    row.operator(SYNTHROADS_OT_show_calibration.bl_idname, icon="IMAGE_DATA")
    if result.job.real is not None and result.job.fit:
        row.operator(SYNTHROADS_OT_save_materials.bl_idname, icon="FILE_TICK")


class Bar(NamedTuple):
    """A bar of the chart of median intensities.

    Attributes:
        material: whose.
        source: Real, of the cloud, or Expected.
        median: of the intensities, in the cloud's units, or the device's without one.
        share: of the longest bar's length.
    """

    material: str
    source: str
    median: float
    share: float


def chart_bars(result: Calibration) -> list[Bar]:
    """Return the bars of the materials' median intensities, real ones before expected ones, all to one scale.

    They begin at 0; where one is negative, as levels in decibels may be, `_BELOW` of their span below the least.
    """
    medians = []
    for entry in result.compared:
        name = material_name(entry.target.material)
        if entry.real is not None:
            medians.append((name, "Real", float(np.median(entry.real.intensity))))
        medians.append((name, "Expected", float(np.median(entry.expected))))
    least, largest = min(row[2] for row in medians), max(row[2] for row in medians)
    begin = 0.0 if least >= 0.0 else least - _BELOW * (largest - least)
    length = largest - begin
    return [Bar(*row, (row[2] - begin) / length if length > 0.0 else 0.0) for row in medians]


def _draw_chart(layout: bpy.types.UILayout, result: Calibration) -> None:
    """Draw the median intensities of all materials as bars with their numbers, under a heading with their unit."""
    box = layout.box().column(align=True)
    is_real = result.job.real is not None
    heading = said("Median intensity, units of the cloud") if is_real else said("Median intensity, units of the device")
    draw_text(box, heading, "SEQ_HISTOGRAM", share=_BOX_SHARE)
    sources, material = {"Real": said("Real"), "Expected": said("Expected")}, ""
    for bar in chart_bars(result):
        if bar.material != material:
            material = bar.material
            draw_text(box, material, share=_BOX_SHARE)
        box.progress(factor=bar.share, text=f"{sources[bar.source]} {bar.median:.3g}")


def result_lines(entry: ClassComparison) -> list[str]:
    """Return a material's reflectivity, percentiles and errors as the panel's lines of text."""
    before, after = entry.before.reflectivity, entry.after.reflectivity
    changed = f"{before:.3f} → {after:.3f}" if before != after else f"{after:.3f}"
    data = entry.to_dict()
    lines = [f"{material_name(entry.target.material)}: reflectivity (share of the light) {changed}"]
    names = [f"{100 * share:g}" for share in FITTED]
    if entry.real is not None:
        lines.append(f"{data['points']:,} points, {data['zeros_left_out']:,} of intensity 0 left out")
    unit = "of the cloud" if entry.real is not None else "of the device"
    lines.append(f"Intensity in units {unit}, by percentile:")
    errors = data["error_of_interquartile_range"] if entry.real is not None else {}
    for name in names:
        line = f"{name} %: "
        if entry.real is not None:
            line += f"real {data['real'][name]:.5g}, "
        line += f"expected {data['expected'][name]:.5g}"
        if entry.real is not None:
            line += f", error {errors[name]:+.0%} of the interquartile range"
        lines.append(line)
    return lines


def material_name(entry: str) -> str:
    """Return a material's name in the table as people say it: ``barrier_concrete`` becomes Barrier Concrete."""
    return title_case(entry)


def _sentence(result: Calibration) -> str:
    if result.job.real is None:
        return "Expected intensities computed"
    shown = (
        f"{material_name(entry.target.material)} {entry.to_dict()['largest_error']:.1%}" for entry in result.compared
    )
    return f"Largest error as a share of the interquartile range: {', '.join(shown)}"


def unregister() -> None:
    """Drop the latest calibration."""
    global latest
    latest = None
