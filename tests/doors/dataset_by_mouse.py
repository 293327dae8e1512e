"""Make a data set in a Blender's window with the installed extension: begin, stop after a scene, and continue.

Blender runs it at its start, see `by_mouse`. The extension's zip lies alone in the home folder, with ``recipe.yaml``;
the set goes into its folder ``set``. OUT is the folder of what comes of it: pictures, and ``answers.json``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from by_mouse import OUT, Region, Steps, shoot, until, work
from scan_by_mouse import MODULE, answers, fail, install, write

FOLDER = Path.home() / "set"
RECIPE = Path.home() / "recipe.yaml"
_PATIENCE = 1800.0


def steps() -> Steps:
    """Install, begin, stop by Esc when a scene is done, and continue; picture each."""
    windows = bpy.context.window_manager.windows
    view = Region(windows[0], "VIEW_3D", "WINDOW")
    yield from view.click((view.region.width // 2, 40))  # what Blender greets with is gone
    yield from install(windows)
    side = yield from open_panel(view)
    settings = bpy.context.scene.synthroads_dataset
    settings.recipe, settings.file, settings.folder = "own", str(RECIPE), str(FOLDER)
    yield 1.0
    panel, job = sys.modules[f"{MODULE}.ui.panels.dataset"], sys.modules[f"{MODULE}.ui.work.job"]
    yield from side.press_button("synthroads.make_dataset")
    yield from until(lambda: panel.latest is not None, "the beginning", 60.0)
    yield from until(lambda: panel.latest.done or job.running_job() is None, "a scene", _PATIENCE)
    yield from shoot()
    yield from view.press("ESC", (300, 400))
    yield from until(lambda: job.running_job() is None, "the stop", _PATIENCE)
    answers["stopped"] = [panel.latest.done, panel.latest.failed, panel.latest.total]
    answers["kept"] = times()
    yield from side.press_button("synthroads.make_dataset")
    yield 3.0
    yield from until(lambda: job.running_job() is None, "the rest", _PATIENCE)
    answers["made"] = [panel.latest.done, panel.latest.failed, panel.latest.total]
    answers["pictures"] = sorted(panel.latest.pictures)
    answers["times"] = times()
    yield 1.0
    yield from shoot()


def open_panel(view: Region) -> Steps:
    """Show the panel Data Set alone in the sidebar's tab, whose other panels would be scrolled for long."""
    view.area.spaces.active.show_region_ui = True
    yield 1.5
    side = Region(view.window, "VIEW_3D", "UI")
    side.region.active_panel_category = "SynthRoads"
    yield 1.5
    panel = bpy.types.SYNTHROADS_PT_dataset
    bpy.utils.unregister_class(panel)
    panel.bl_parent_id, panel.bl_options = "", set()
    bpy.utils.register_class(panel)
    yield 1.5
    return side


def times() -> dict[str, int]:
    """Return when each scene's cloud was written, ns, by the scene's name."""
    return {path.parent.name: path.stat().st_mtime_ns for path in FOLDER.glob("scenes/*/cloud.laz")}


if __name__ == "__main__":
    assert OUT.is_dir()
    work(steps(), fail, write)
