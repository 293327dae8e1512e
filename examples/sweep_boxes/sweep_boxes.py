"""Scan traffic with a rotating scanner on a vehicle, read a sweep with its boxes as detectors do, and draw it."""

import argparse
import json
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from synthroads_addon import Job, generate, load_scenario
from synthroads_addon.base.errors import SynthRoadsError

SETTINGS = ["fidelity=draft", "road.length=120", "road.half_width=30", "seed=4", 'outputs=["cloud"]']
SETTINGS += ['road.vehicles.per_km={"minimum":80,"maximum":80}', "colour.source=material", "colour.rgb=false"]
SETTINGS += ["scan.device=velodyne-vlp-32c", 'sweeps.formats=["semantickitti","openlabel"]', "sweeps.box_range=60"]
SCALE, HALF = 12, np.array([45.0, 25.0])  # pixels of a metre; half of what is drawn, m


def corners(cuboid: list[float]) -> np.ndarray:
    """Return the corners (4, 2) of a cuboid in plan, m."""
    x, y, _, _, _, qz, qw, length, width, _ = cuboid
    turn = 2.0 * np.arctan2(qz, qw)
    shape = np.array([(length, width), (length, -width), (-length, -width), (-length, width)]) / 2.0
    return shape @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + [x, y]


def main(output: Path) -> None:
    """Scan a short road with traffic, print the boxes of the sweep with most points in them, and draw it."""
    generate(Job(load_scenario("mobile-mapping-300m", SETTINGS), output))
    content = json.loads((output / "openlabel.json").read_text())["openlabel"]
    sweeps: dict[int, list[dict]] = {}
    for number, frame in content["frames"].items():
        for key, item in frame.get("objects", {}).items():
            data = item["object_data"]
            box = {"type": content["objects"][key]["type"], "cuboid": data["cuboid"][0]["val"]}
            box["speed"] = float(np.linalg.norm(data["vec"][0]["val"]))
            sweeps.setdefault(int(number), []).append(box | {entry["name"]: entry["val"] for entry in data["num"]})
    best = max(sweeps, key=lambda number: sum(box["points"] for box in sweeps[number] if box["speed"]))
    print(f"{len(content['frames'])} sweeps, {len(content['objects'])} things; sweep {best}:")
    points = np.fromfile(output / "semantickitti/sequences/00/velodyne" / f"{best:06d}.bin", "<f4").reshape(-1, 4)
    image = Image.new("RGB", tuple((2 * HALF * SCALE).astype(int).tolist()), (250, 250, 248))
    pen = ImageDraw.Draw(image)
    pen.point(((points[:, :2] * [1, -1] + HALF) * SCALE).ravel().tolist(), fill=(90, 90, 98))
    for box in sorted(sweeps[best], key=lambda box: -box["points"]):
        (x, y), hidden = box["cuboid"][:2], f"{100 * box.get('occlusion', 0.0):3.0f} % hidden"
        print(f"{box['type']:14} at {x:6.1f} {y:6.1f} m, {box['points']:5} points, {hidden}, {box['speed']:4.1f} m/s")
        outline = [tuple(corner) for corner in ((corners(box["cuboid"]) * [1, -1] + HALF) * SCALE).tolist()]
        pen.line([*outline, outline[0]], fill=(200, 30, 40) if box["speed"] else (120, 60, 180), width=2)
        pen.text(outline[0], f"{3.6 * box['speed']:.0f} km/h" if box["speed"] else "", fill=(0, 0, 0))
    image.save(output / "sweep.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder for the files")
    try:
        main(**vars(parser.parse_args()))
    except (SynthRoadsError, OSError) as error:
        parser.exit(2, f"error: {error}\n")
