"""Scan traffic with a rotating scanner on a vehicle, read a sweep with its boxes as detectors do, and draw it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from synthroads_addon import Job, generate, load_scenario
from synthroads_addon.base.errors import SynthRoadsError

SMALL = [
    "fidelity=draft",
    "road.length=120",
    "road.half_width=30",
    'road.vehicles.per_km={"minimum":80,"maximum":80}',
    "seed=4",
]
SCAN = ["scan.device=velodyne-vlp-32c", "colour.source=material", "colour.rgb=false", 'outputs=["cloud"]']
SWEEPS = ['sweeps.formats=["semantickitti","kitti","openlabel"]', "sweeps.box_range=60"]
COLORS = {"vehicle": (30, 170, 170), "road": (110, 110, 118), "road_marking": (20, 20, 20), "vegetation": (96, 165, 84)}
SCALE = 12
"""Pixels of a metre."""
HALF = (45, 25)
"""Half the length and width that are drawn, m."""


def read_points(folder: Path, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates (N, 3) in the scanner's frame, m, and classes (N,) of a sweep, from SemanticKITTI's files."""
    sequence = folder / "semantickitti" / "sequences" / "00"
    points = np.fromfile(sequence / "velodyne" / f"{number:06d}.bin", "<f4").reshape(-1, 4)
    labels = np.fromfile(sequence / "labels" / f"{number:06d}.label", "<u4")
    return points[:, :3], labels & 0xFFFF


def read_boxes(folder: Path, number: int) -> list[dict]:
    """Return the boxes of a sweep from the OpenLABEL file: type, cuboid of ten numbers, points, occlusion, speed."""
    content = json.loads((folder / "openlabel.json").read_text())["openlabel"]
    boxes = []
    for key, item in content["frames"][str(number)].get("objects", {}).items():
        data = item["object_data"]
        figures = {entry["name"]: entry["val"] for entry in data["num"]}
        speed = float(np.linalg.norm(data["vec"][0]["val"]))
        boxes.append(
            {"type": content["objects"][key]["type"], "cuboid": data["cuboid"][0]["val"], "speed": speed} | figures
        )
    return boxes


def footprint(cuboid: list[float]) -> np.ndarray:
    """Return the corners (4, 2) of a cuboid in plan, the front ones first."""
    x, y, _, _, _, qz, qw, length, width, _ = cuboid
    yaw = 2.0 * np.arctan2(qz, qw)
    shape = np.array([(length, width), (length, -width), (-length, -width), (-length, width)]) / 2.0
    return shape @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) + [x, y]


def draw(folder: Path, number: int, file: Path) -> None:
    """Draw a sweep from above: points by class, boxes of vehicles in red (hollow where nothing of them was hit)."""
    points, classes = read_points(folder, number)
    names = json.loads(_labels(folder))
    image = Image.new("RGB", (2 * HALF[0] * SCALE, 2 * HALF[1] * SCALE), (250, 250, 248))
    pen = ImageDraw.Draw(image)

    def pixel(place: np.ndarray) -> tuple[float, float]:
        return (place[0] + HALF[0]) * SCALE, (HALF[1] - place[1]) * SCALE

    for place, number_of_class in zip(points, classes, strict=True):
        color = COLORS.get(names[str(number_of_class)], (190, 170, 130))
        x, y = pixel(place)
        pen.rectangle((x - 0.5, y - 0.5, x + 0.5, y + 0.5), fill=color)
    for box in read_boxes(folder, number):
        corners = [pixel(corner) for corner in footprint(box["cuboid"])]
        is_vehicle = box["speed"] > 0.0
        color = (200, 30, 40) if is_vehicle else (120, 60, 180)
        pen.line([*corners, corners[0]], fill=color, width=3 if box["points"] else 1)
        if is_vehicle:
            front = ((corners[0][0] + corners[1][0]) / 2, (corners[0][1] + corners[1][1]) / 2)
            middle = pixel(np.array(box["cuboid"][:2]))
            pen.line([middle, front], fill=color, width=2)
            top = max(min(corner[1] for corner in corners) - 28, 2)
            if 0 <= middle[1] <= image.height and 20 <= middle[0] <= image.width:
                text = f"{box['type']}, {3.6 * box['speed']:.0f} km/h\n{box['points']} points"
                pen.multiline_text((min(corner[0] for corner in corners), top), text, fill=(0, 0, 0), spacing=1)
    x, y = pixel(np.zeros(2))
    pen.ellipse((x - 5, y - 5, x + 5, y + 5), fill=(0, 0, 0))
    image.save(file)


def _labels(folder: Path) -> str:
    """Return the names of the classes as JSON, from the lines of SemanticKITTI's YAML file below "labels"."""
    lines = (folder / "semantickitti" / "classes.yaml").read_text().split("labels:\n")[1].split("color_map:")[0]
    entries = [line.strip().split(": ") for line in lines.splitlines()]
    return "{" + ", ".join(f'"{number}": {name}' for number, name in entries) + "}"


def main(output: Path) -> None:
    """Scan a short road with traffic, print the boxes of the sweep with most points on vehicles, and draw it."""
    generate(Job(load_scenario("mobile-mapping-300m", [*SMALL, *SCAN, *SWEEPS]), output))
    content = json.loads((output / "openlabel.json").read_text())["openlabel"]

    def points_on_vehicles(number: str) -> int:
        return sum(box["points"] for box in read_boxes(output, int(number)) if box["speed"])

    best = int(max(content["frames"], key=points_on_vehicles))
    print(f"{len(content['frames'])} sweeps, {len(content['objects'])} things; sweep {best}:")
    for box in sorted(read_boxes(output, best), key=lambda box: -box["points"]):
        x, y = box["cuboid"][:2]
        hidden = f"{100 * box['occlusion']:3.0f} % hidden" if "occlusion" in box else "turned away"
        print(f"{box['type']:14} at {x:6.1f} {y:6.1f} m, {box['points']:5} points, {hidden}, {box['speed']:4.1f} m/s")
    draw(output, best, output / "sweep.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder for the files")
    try:
        main(**vars(parser.parse_args()))
    except (SynthRoadsError, OSError) as error:
        parser.exit(2, f"error: {error}\n")
