"""The panel "Data Set": many scenes from a recipe, made in the background, with a strip of small pictures.

The work is `jobs.dataset.make`'s, as the command ``synthroads dataset`` does it, in a thread.

Annotations are not postponed here: Blender reads the properties from them.
"""

from pathlib import Path
from typing import Any, ClassVar

import bpy
import bpy.utils.previews

from ...base.errors import InputError
from ...dataset.changes import MOST_SCENES, resize_recipe
from ...dataset.manifest import MANIFEST, Manifest
from ...dataset.recipe import Recipe, load_recipe, recipe_names
from ..fields.room import draw_flag, draw_text, sidebar_width, value_row
from ..work.common import Sidebar, column, large_button
from ..work.dataset import MOST_PICTURES, DatasetWork, use_this_blender
from ..work.job import PanelJob
from ..work.long_operator import LongOperator, draw_job

OWN = "own"
"""Choice of a recipe from a file of the user's."""
_PICTURE_WIDTH = 75.0
"""Width of a picture in the strip, in pixels at a resolution scale of 1: two beside each other at 200, four at 350."""
_PICTURE_SCALE = 3.4
"""Size of a picture in the strip, in Blender's units of a button's height; chosen to fit that width."""
_items: list[tuple[str, str, str]] = []
"""Texts that Blender shows at present: it doesn't keep them itself."""
latest: DatasetWork | None = None
"""The data set that is or was made last."""
_icons: dict[str, bpy.utils.previews.ImagePreviewCollection] = {}
"""The collection of small pictures that Blender shows, under one name."""


def _recipe_items(settings: Any, context: Any) -> list[tuple[str, str, str]]:
    shipped = [(name, name.replace("-", " ").title(), "Shipped recipe") for name in recipe_names()]
    _items[:] = [*shipped, (OWN, "From a File", "Recipe of your own, a YAML or JSON file")]
    return _items


class SYNTHROADS_PG_dataset(bpy.types.PropertyGroup):
    """Settings of the data set that the panel makes."""

    recipe: bpy.props.EnumProperty(name="Recipe", items=_recipe_items, description="What the scenes are made from")
    file: bpy.props.StringProperty(
        name="Recipe File",
        subtype="FILE_PATH",
        description="Recipe of your own, a YAML or JSON file: roads, scanners and what varies among the scenes",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    scenes: bpy.props.IntProperty(
        name="Scenes",
        description="Number of scenes in all, divided among the recipe's groups and splits; "
        "0: as many as the recipe says",
        default=0,
        min=0,
        max=MOST_SCENES,
    )
    jobs: bpy.props.IntProperty(
        name="At Once",
        description="Scenes made at the same time; each needs a core and some gigabytes of memory",
        default=1,
        min=1,
        max=64,
    )
    folder: bpy.props.StringProperty(
        name="Folder",
        subtype="DIR_PATH",
        description="Empty folder for the data set, or that of one that was begun: what is done stays",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    overwrite: bpy.props.BoolProperty(
        name="Begin Anew", description="Replace the data set that is in the folder instead of continuing it"
    )

    def chosen_recipe(self) -> Recipe:
        """Return the chosen recipe with the chosen number of scenes; InputError if it can't be read."""
        name = self.recipe
        if name == OWN:
            if not self.file.strip():
                raise InputError("Recipe File", None, "choose the recipe's file")
            name = str(Path(bpy.path.abspath(self.file)))
        recipe = load_recipe(name)
        return resize_recipe(recipe, self.scenes) if self.scenes else recipe

    def work(self) -> DatasetWork:
        """Return the data set that the panel describes, to be made; a set that is there is continued."""
        if not self.folder.strip():
            raise InputError("Folder", None, "choose a folder for the data set")
        folder = Path(bpy.path.abspath(self.folder))
        resume = not self.overwrite and (folder / MANIFEST).exists()
        return DatasetWork(self.chosen_recipe(), folder, resume, self.overwrite, self.jobs)


class SYNTHROADS_OT_make_dataset(LongOperator, bpy.types.Operator):
    """Make the recipe's scenes in the background; a data set that was begun in the folder is continued"""

    bl_idname = "synthroads.make_dataset"
    bl_label = "Make Data Set"
    nothing_done = "scenes that are done stay; press Make Data Set to continue"
    option_labels: ClassVar = {"--output": "Folder", "--jobs": "At Once"}

    def job(self, context: bpy.types.Context) -> PanelJob[Manifest]:
        """Return the data set that the panel describes as a job, to be run in a thread."""
        global latest
        work = context.scene.synthroads_dataset.work()
        use_this_blender()
        latest = work
        return PanelJob.aside("Data Set", work.make, "Making scenes")

    def succeed(self, context: bpy.types.Context, job: PanelJob[Manifest]) -> str:
        """Return a sentence on the scenes that were made."""
        assert latest is not None
        failed = f", {latest.failed} failed: the folder logs says why" if latest.failed else ""
        return f"{latest.done} of {latest.total} scenes are in {latest.folder}{failed}"


class SYNTHROADS_PT_dataset(Sidebar, bpy.types.Panel):
    """Panel of data sets: recipe, number of scenes and folder; progress; pictures of the scenes."""

    bl_label = "Data Set"
    bl_parent_id = "SYNTHROADS_PT_main"
    bl_order = 65
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings, the button or the progress, and the pictures."""
        layout, settings = column(self), context.scene.synthroads_dataset
        names = ["recipe", *(["file"] if settings.recipe == OWN else []), "scenes", "jobs", "folder"]
        for name in names:
            value_row(layout, settings.bl_rna.properties[name].name).prop(settings, name, text="")
        draw_flag(layout, settings, "overwrite", "Begin Anew")
        if not draw_job(layout):
            large_button(layout).operator(SYNTHROADS_OT_make_dataset.bl_idname, icon="FILE_FOLDER")
        if latest is not None:
            _draw_result(layout, latest)


def _draw_result(layout: bpy.types.UILayout, work: DatasetWork) -> None:
    """Draw how many scenes are done, and the strip of their pictures."""
    row = layout.row(align=True)
    icon = "CHECKMARK" if work.done == work.total else "INFO"
    draw_text(row.column(), f"{work.done} of {work.total} scenes done", icon, beside=1)
    row.operator("wm.path_open", text="", icon="FILE_FOLDER").filepath = str(work.folder)
    if work.failed:
        draw_text(layout, f"{work.failed} failed: the folder logs says why", "ERROR")
    pictures = list(work.pictures.items())[-MOST_PICTURES:]
    if not pictures:
        return
    columns = max(1, int(sidebar_width() // _PICTURE_WIDTH) - 1)
    for number, (name, path) in enumerate(pictures):
        if number % columns == 0:
            row = layout.row(align=True)
        cell = row.column(align=True)
        cell.template_icon(_icon(path), scale=_PICTURE_SCALE)
        draw_text(cell, name, share=1.0 / columns)


def _icon(path: Path) -> int:
    """Return the number of Blender's icon of a picture, read once."""
    icons = _icons.setdefault("pictures", bpy.utils.previews.new()) if not _icons else _icons["pictures"]
    if str(path) not in icons:
        icons.load(str(path), str(path), "IMAGE")
    return int(icons[str(path)].icon_id)


def unregister() -> None:
    """Free the pictures."""
    while _icons:
        bpy.utils.previews.remove(_icons.popitem()[1])


ATTACHED = (bpy.types.Scene, "synthroads_dataset", SYNTHROADS_PG_dataset)
