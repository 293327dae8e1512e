"""Drag files of roads from Blender's own file browser into a 3D view, and note what is built of each.

Blender runs it at its start, see `by_mouse`. The extension's zip lies alone in the home folder, that of SynthRoads IFC
in its folder ``ifc``, and the files in its folder ``roads``. OUT is the folder of what comes of it: pictures,
``answers.json``, and a parameter set for each file, as the road in the scene is read back.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from by_mouse import OUT, Region, Steps, shoot, until, work
from scan_by_mouse import MODULE, answers, fail, install, write

ROADS = Path.home() / "roads"
_PATIENCE = 900.0
_STEPS = 40
"""Moves of the mouse on the way from a file to the view."""
_ICON = 16
"""Distance of the middle of a file's icon, which is dragged, from the list's left edge, pixels."""


def steps() -> Steps:
    """Install, and drop each file; picture each road."""
    windows = bpy.context.window_manager.windows
    view = Region(windows[0], "VIEW_3D", "WINDOW")
    yield from view.click((view.region.width // 2, 40))  # what Blender greets with is gone
    yield from install(windows)
    for archive in (Path.home() / "ifc").glob("*.zip"):
        bpy.ops.extensions.package_install_files(filepath=str(archive), repo="user_default", enable_on_install=True)
    files = yield from browser(windows[0])
    answers["roads"] = {}
    for path in sorted(ROADS.iterdir()):
        yield from drop(files, path.name, view)
        yield from until(lambda path=path: is_built(path), path.name, _PATIENCE)  # type: ignore[misc]
        answers["roads"][path.name] = read_back(path)
        yield from shoot()


def browser(window: bpy.types.Window) -> Any:
    """Turn the window's properties into a file browser that shows the roads; return its region."""
    area = next(item for item in window.screen.areas if item.type == "PROPERTIES")
    area.type = "FILE_BROWSER"
    yield 1.0
    yield from until(lambda: area.spaces.active.params is not None, "the file browser", _PATIENCE)
    space = area.spaces.active
    space.params.directory = f"{ROADS}/".encode()
    space.show_region_toolbar = False
    yield 3.0
    return Region(window, "FILE_BROWSER", "WINDOW")


def drop(files: Region, name: str, view: Region) -> Steps:
    """Drag a file from a file browser to the middle of a view.

    Raises:
        LookupError: the file browser doesn't show it.
    """
    chosen = files.area.spaces.active.params
    for y in files.rows():
        yield from files.click((files.region.x + 80, y))
        if chosen.filename == name:
            break
    else:
        raise LookupError(f"no {name} in the file browser")
    start = (files.region.x + _ICON, y)
    end = (view.region.x + view.region.width // 2, view.region.y + view.region.height // 2)
    yield from files.move(start)
    yield 0.3
    files.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=start[0], y=start[1])
    yield 0.5
    for n in range(1, _STEPS + 1):
        place = tuple(round(a + (b - a) * n / _STEPS) for a, b in zip(start, end, strict=True))
        yield from files.move((place[0], place[1]))
        yield 0.05
    yield 0.5
    files.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=end[0], y=end[1])
    yield 1.0


def is_built(path: Path) -> bool:
    """Return whether the scene's road is that of a file, and no job is at work."""
    root = sys.modules[f"{MODULE}.blender.model.store"].find_road(bpy.context.scene)
    named = root and sys.modules[f"{MODULE}.ui.panels.road_files"].source_file_name(root)
    return named == path.name and sys.modules[f"{MODULE}.ui.work.job"].running_job() is None


def read_back(path: Path) -> dict[str, Any]:
    """Write the set of the road in the scene; return whether it is that of the file, and the panel's scenario."""
    rules = sys.modules[f"{MODULE}.ui.panels.rules"]
    loader = sys.modules[f"{MODULE}.ui.panels.road_files"]
    scene = bpy.context.scene
    parameters, scenario = rules.edited_parameters(scene), scene.synthroads.scenario()
    (OUT / f"{path.name}.json").write_text(parameters.to_json(), encoding="utf-8")
    scenario.road.model_fields_set.discard("epsg")
    wanted, _ = loader.RoadSource(scenario, road=path).read()
    return {"same": parameters == wanted, "objects": len(parameters.objects)}


if __name__ == "__main__":
    work(steps(), fail, write)
