"""Build a scene in Blender by Python, say what its objects are, and scan it from a tripod."""

from __future__ import annotations

import argparse
from pathlib import Path

import bpy
import numpy as np

from synthroads_addon import SceneScan, load_scenario, open_cloud, scan_scene
from synthroads_addon.base.errors import SynthRoadsError

SETTINGS = ["fidelity=draft", "scan.device=velodyne-vlp-16", "scan.lines_per_second=20", "scan.platform.turn_seconds=1"]
"""Changes to a scenario; its road isn't looked at."""


def block(name: str, size: tuple[float, float, float], place: tuple[float, float, float], of_class: str) -> None:
    """Add a box of a size (length, width, height), m, with its middle at a place, m, and a class."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=place)
    box = bpy.context.object
    box.name, box.scale = name, size
    box["synthroads_class"] = of_class


def yard() -> None:
    """Make the scene: a yard of 40 m x 30 m with a wall, three posts and a van."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    block("Yard", (40.0, 30.0, 0.2), (0.0, 0.0, -0.1), "road")
    block("Wall", (40.0, 0.3, 3.0), (0.0, 14.0, 1.5), "noise_barrier")
    for number in range(3):
        block(f"Post {number}", (0.15, 0.15, 4.0), (8.0 * number - 8.0, 6.0, 2.0), "pole")
    block("Van", (5.0, 2.0, 2.2), (4.0, -6.0, 1.1), "vehicle")
    bpy.context.view_layer.update()


def main(output: Path) -> None:
    """Scan the yard into a folder and print how many points each object has."""
    yard()
    scenario = load_scenario("tripod-200m", SETTINGS)
    report = scan_scene(SceneScan(scenario, output, tripods=((0.0, 0.0),)))
    with open_cloud(output / "cloud.laz") as cloud:
        numbers = np.concatenate([one.instance_id for one in cloud.blocks()])
    print(f"{report['counts']['points']:,} points of {len(np.unique(numbers))} objects")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder for the files")
    try:
        main(**vars(parser.parse_args()))
    except (SynthRoadsError, OSError) as error:
        parser.exit(2, f"error: {error}\n")
