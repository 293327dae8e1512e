"""Set-up of the tests of the panel's buttons: the add-on registered, a small scene, a file."""

from __future__ import annotations

import time
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import synthroads_addon
from synthroads_addon.ui.work.job import PanelJob

SMALL = {
    "road.length": 120.0,
    "seed": 3,
    "road.half_width": 20.0,
    "scan.own_lines_per_second": True,
    "scan.lines_per_second": 50.0,
    "scan.platform.lateral_offsets": "0",
    "scan.platform.speed": 40.0,
    "colour.source": "material",
}
SAME = ["fidelity=draft", "road.length=120", "scan.platform.speed=40", "seed=3", "road.half_width=20"]
SAME += ["scan.lines_per_second=50", "scan.platform.lateral_offsets=[0]", "colour.source=material"]
"""The panel's settings with `SMALL` chosen, for the library."""


@pytest.fixture(autouse=True)
def settings() -> Iterator[Any]:
    """Register the add-on for one test; return the panel's settings."""
    synthroads_addon.register()
    yield bpy.context.scene.synthroads
    synthroads_addon.unregister()


@pytest.fixture
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let previews be small: at full size they take longer than the scan of a small scene."""
    monkeypatch.setattr("synthroads_addon.cloud.tools.previews.WIDTH", 300)


@pytest.fixture
def cheap(settings: Any) -> Any:
    """The panel's settings of a small scene."""
    choose(settings, **SMALL)
    return settings


@pytest.fixture(scope="module")
def road_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with a small road, built from the panel and saved."""
    file = tmp_path_factory.mktemp("road") / "road.blend"
    synthroads_addon.register()
    choose(bpy.context.scene.synthroads, **SMALL)
    bpy.ops.synthroads.build()
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    synthroads_addon.unregister()
    return file


@pytest.fixture
def road(road_file: Path, cheap: Any, tmp_path: Path) -> Any:
    """Open that file; return its panel's settings, with a folder for the output."""
    bpy.ops.wm.open_mainfile(filepath=str(road_file))
    settings = bpy.context.scene.synthroads
    settings.output = str(tmp_path / "out")
    return settings


@pytest.fixture
def users_own() -> bpy.types.Object:
    """An object of the user's own, in a collection of its own, with a material and a modifier."""
    bpy.ops.mesh.primitive_cube_add(location=(500.0, 500.0, 0.0))
    item = bpy.context.object
    item.modifiers.new("Bevel", "BEVEL")
    item.data.materials.append(bpy.data.materials.new("Mine"))
    item["note"] = "keep"
    mine = bpy.data.collections.new("Mine")
    bpy.context.scene.collection.children.link(mine)
    mine.objects.link(item)
    return item


def choose(settings: Any, **values: Any) -> None:
    """Set several settings by their paths in the scenario."""
    for path, value in values.items():
        head, _, name = path.rpartition(".")
        setattr(attrgetter(head)(settings) if head else settings, name, value)


def wait_for_end(job: PanelJob[Any]) -> None:
    """Let a job that has begun go on to its end, with pauses as between the window's ticks."""
    while job.tick(0.0):
        time.sleep(0.002)


def fingerprint(item: bpy.types.Object) -> tuple:
    """Return all of a mesh object that a user would miss."""
    corners = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.vertices.foreach_get("co", corners)
    return (
        item.name,
        tuple(map(tuple, item.matrix_world)),
        item.data.name,
        corners.tobytes(),
        [slot.name for slot in item.material_slots],
        [modifier.type for modifier in item.modifiers],
        [collection.name for collection in item.users_collection],
        {name: value for name, value in item.items() if name != "cycles"},  # Cycles' own, whatever it holds
        (item.hide_get(), item.hide_viewport, item.select_get()),
    )


def block_counts() -> dict[str, int]:
    """Return how many data-blocks of each kind the file has."""
    kinds = [prop.identifier for prop in bpy.data.bl_rna.properties if prop.type == "COLLECTION"]
    return {kind: len(getattr(bpy.data, kind)) for kind in kinds}
