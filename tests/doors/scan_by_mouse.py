"""Do in a Blender's window what a user does from Preferences > Install from Disk to a scanned cloud that is shown.

Blender runs it at its start, see `by_mouse`. The extension's zip lies alone in the home folder, and OUT is the folder
of what comes of it: pictures, and ``answers.json``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from by_mouse import OUT, Found, Panels, Region, Steps, shoot, until, work

MODULE = "bl_ext.user_default.synthroads"
LENGTH = "60"
FOLDER = str(Path.home() / "scan")
_PATIENCE = 600.0

answers: dict[str, Any] = {}


def steps() -> Steps:
    """Install, enable, build, scan and show; picture each."""
    windows = bpy.context.window_manager.windows
    view = Region(windows[0], "VIEW_3D", "WINDOW")
    yield from view.click((view.region.width // 2, 40))  # what Blender greets with is gone
    yield from install(windows)
    side = yield from sidebar(view)
    yield from side.fill("synthroads.road.length", LENGTH)
    yield from side.press_button("synthroads.random_road")
    yield from finished("road")
    road = sys.modules[f"{MODULE}.blender.model.store"].find_road(bpy.context.scene)
    answers["road"] = len(road.children_recursive) if road else None
    yield from shoot()
    yield from side.fill("synthroads.output", FOLDER)
    yield from side.press_button("synthroads.scan")
    yield from finished("scan")
    yield from shoot()
    yield from Panels(side, "SYNTHROADS_PT_").open("SYNTHROADS_PT_cloud_view")
    yield from side.press_button("synthroads.show_cloud")
    yield from finished("cloud")
    shown = sys.modules[f"{MODULE}.ui.panels.cloud_view"].view.cloud
    answers["shown"] = [len(shown), shown.total] if shown else None
    yield from shoot()


def install(windows: Any) -> Steps:
    """Install the zip by Edit > Preferences > Get Extensions > Install from Disk, and close the preferences."""
    top = windows[0]
    menus = Region(top, "VIEW_3D", "HEADER")
    yield from menus.click((79, top.height - 14))  # Edit
    yield from menus.press("P", (79, top.height - 14), "p")
    yield from until(lambda: len(windows) > 1, "the preferences", _PATIENCE)
    yield 1.0
    tabs, page = Region(windows[1], "PREFERENCES", "UI"), Region(windows[1], "PREFERENCES", "WINDOW")
    for y in tabs.rows():
        if bpy.context.preferences.active_section == "EXTENSIONS":
            break
        yield from tabs.click((tabs.region.x + tabs.region.width // 2, y))
    corner = (windows[1].width - 22, windows[1].height - 17)
    yield from page.click(corner)
    yield from page.click((yield from _below(page, corner, "extensions.package_install_files")))
    yield from until(lambda: len(windows) > 2, "the file browser", _PATIENCE)
    yield 1.0
    files, buttons = Region(windows[2], "FILE_BROWSER", "WINDOW"), Region(windows[2], "FILE_BROWSER", "EXECUTE")
    chosen = files.area.spaces.active.params
    for y in files.rows():
        if chosen.filename.endswith(".zip"):
            break
        yield from files.click((files.region.x + 80, y))
    yield from shoot()
    yield from buttons.press_button("file.execute")
    yield from until(lambda: MODULE in bpy.context.preferences.addons, "the extension", _PATIENCE)
    answers["enabled"] = sorted(bpy.context.preferences.addons.keys())
    yield from shoot()
    with bpy.context.temp_override(window=windows[1]):  # there is no window manager whose cross could be clicked
        bpy.ops.wm.window_close()
    yield 0.5


def _below(page: Region, place: tuple[int, int], operator: str) -> Found:
    """Return the place of an operator's row in the menu that has opened below a place."""
    x, y = place
    while page.under() != operator:
        y -= 10
        if y < 0:
            raise LookupError(f"no {operator} in the menu")
        yield from page.move((x, y))
        yield 0.1
    return x, y


def sidebar(view: Region) -> Found:
    """Open the 3D view's sidebar, and our tab in it, which has to be clicked; return its region."""
    side, middle = Region(view.window, "VIEW_3D", "UI"), (view.region.width // 2, view.region.height // 2)
    yield from view.move(middle)
    yield from view.press("N", middle, "n")
    yield from until(lambda: side.region.width > 100, "the sidebar", _PATIENCE)
    yield 1.0
    for y in side.rows():
        if side.region.active_panel_category == "SynthRoads":
            return side
        yield from side.click((side.region.x + side.region.width - 9, y))
    raise LookupError("no tab SynthRoads in the sidebar")


def finished(what: str) -> Steps:
    """Wait until work in the background has begun and ended."""
    job = sys.modules[f"{MODULE}.ui.work.job"]
    yield 1.0
    yield from until(lambda: job.running_job() is None, what, _PATIENCE)
    yield 1.0


def write() -> None:
    """Write down what came of it."""
    (OUT / "answers.json").write_text(json.dumps(answers, indent=1), encoding="utf-8")


def fail(trace: str) -> None:
    """Write the same with the error."""
    answers["failed"] = trace
    write()


if __name__ == "__main__":
    work(steps(), fail, write)
