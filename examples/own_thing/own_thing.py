"""Add a thing of one's own, a bench, to roads: their model, scan, parameters and CityJSON have it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

import synthroads_addon as roads
import synthroads_addon.blender.things
import synthroads_addon.road.things
import synthroads_addon.sampling.placing
from synthroads_addon.base.errors import SynthRoadsError

HERE = Path(__file__).resolve().parent
FOLDERS = {
    roads.road.things: "things",
    roads.blender.things: "groups",
    roads.sampling.placing: "placing",
}
SETTINGS = [
    *("fidelity=draft", "road.length=60", "road.half_width=20", "scan.platform.speed=10", 'twin=["cityjson"]'),
    *(f"road.furniture.benches_per_km.{end}=50" for end in ("minimum", "maximum")),
]


def main(output: Path) -> None:
    """Make a road with benches and print how many points each of them has."""
    for package, folder in FOLDERS.items():  # before the first use: packages find things by their files
        package.__path__.append(str(HERE / folder))
    roads.generate(roads.Job(roads.load_scenario("mobile-mapping-300m", SETTINGS), output))
    benches = {
        name: item.instance
        for name, item in roads.read_parameters(output / "parameters.json").objects.items()
        if item.type == "Bench"
    }
    with roads.open_cloud(output / "cloud.laz") as cloud:
        numbers = np.concatenate([block.instance_id for block in cloud.blocks()])
    city = json.loads((output / "twin.city.json").read_text(encoding="utf-8"))["CityObjects"]
    for name, number in benches.items():
        there = "in" if name in city else "not in"
        print(f"{name}: instance {number}, {int((numbers == number).sum()):,} points, {there} CityJSON")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder for the files")
    try:
        main(**vars(parser.parse_args()))
    except (SynthRoadsError, OSError) as error:
        parser.exit(2, f"error: {error}\n")
