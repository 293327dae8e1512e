"""Scan a plane of asphalt with painted lines of a table's materials, and compare the cloud with what is expected of it.

    python tools/check_calibration.py TABLE.json --output out/check

The plane is level, the scanner flies over its middle. Both classes are told apart as beside a real road's axis, and
`synthroads calibrate --no-fit` compares them with what it expects of the table: nothing but the gain is free.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from synthroads_addon.blender.files import empty_file  # noqa: E402
from synthroads_addon.blender.materials import material  # noqa: E402
from synthroads_addon.calibration.job import Calibration, CalibrationJob, MaterialTarget, calibrate  # noqa: E402
from synthroads_addon.calibration.plot import save_plot  # noqa: E402
from synthroads_addon.cloud.selection.pavement import RoadClasses  # noqa: E402
from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene  # noqa: E402
from synthroads_addon.scenario.scenario import Scenario  # noqa: E402

LINES = (-10.0, -6.0, 6.0, 10.0)
"""Offsets of the painted lines, m."""
WIDTH = 0.15
SHOWN = ("material", "points", "real", "expected", "error_of_interquartile_range")
LENGTH, HALF = 400.0, 15.0
ASKEW = 24.0
"""The scanner flies aslant by this much, m: along the lines every pulse of a line would meet it at the same place."""


def build() -> None:
    """Build the scene in a new file: a plane of asphalt, and 3 mm above it dashes of white paint, 6 m every 12 m."""
    empty_file()
    _rectangle("road", "asphalt", [(0.0, LENGTH, -HALF, HALF)], 0.0)
    dashes = [
        (start, start + 6.0, line - WIDTH / 2.0, line + WIDTH / 2.0)
        for line in LINES
        for start in np.arange(3.0, LENGTH - 6.0, 12.0)
    ]
    _rectangle("road_marking", "paint_white", dashes, 0.003)


def _rectangle(kind: str, name: str, spans: list[tuple[float, float, float, float]], height: float) -> None:
    """Add level rectangles at a height (m) to the scene, as one object of a class and a material."""
    mesh = bpy.data.meshes.new(kind)
    corners = [(x, y, height) for a, b, c, d in spans for x, y in ((a, c), (b, c), (b, d), (a, d))]
    mesh.from_pydata(corners, [], [tuple(range(4 * i, 4 * i + 4)) for i in range(len(spans))])
    mesh.materials.append(material(name))
    item = bpy.data.objects.new(kind, mesh)
    item["synthroads_class"] = kind
    bpy.context.scene.collection.objects.link(item)


def scan(table: Path, output: Path, rays: int, height: float) -> Path:
    """Scan the open scene from the air with a table's materials; return the cloud's path."""
    scenario = Scenario.from_dict(
        {
            "fidelity": "standard",
            "materials_table": str(table),
            "outputs": ["cloud"],
            "colour": {"source": "material", "rgb": False},
            "scan": {
                "device": "riegl-vq-780i",
                "rays_per_pulse": rays,
                "pulse_rate_khz": 1000.0,
                "field_of_view_deg": 40.0,
                "relief": 0.0,
                "attenuation": 0.0,
                "platform": {"kind": "airborne", "height": height, "lateral_offsets": [-100.0, 0.0, 100.0]},
            },
        }
    )
    path = output / "path.csv"
    path.write_text(f"x,y,z\n0,{-ASKEW},0\n{LENGTH},{ASKEW},0\n", encoding="utf-8")
    scan_scene(SceneScan(scenario, output, path=path, overwrite=True))
    return output / "cloud.laz"


def compare(table: Path, output: Path, cloud: Path) -> Calibration:
    """Return the calibration that compares a cloud with what a table's materials predict; only the gain is fitted."""
    axis = output / "axis.csv"
    axis.write_text("x,y,z\n" + "".join(f"{x},0,0\n" for x in range(int(LENGTH) + 1)), encoding="utf-8")
    return calibrate(
        CalibrationJob(
            targets=(MaterialTarget("asphalt", "paved"), MaterialTarget("paint_white", "line")),
            table=table,
            real=cloud,
            road=RoadClasses(axis, ((-14.0, 14.0),), LINES, WIDTH),
            device="riegl-vq-780i",
            fit=False,
        )
    )


def check_table(table: Path, output: Path, rays: int = 19, height: float = 700.0) -> Calibration:
    """Build the plane, scan it and compare the cloud with the table; return the calibration."""
    output.mkdir(parents=True, exist_ok=True)
    build()
    return compare(table, output, scan(table, output, rays, height))


def main() -> None:
    """Run the check of the command line's table, save its plot and print each class's errors as JSON lines."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, metavar="TABLE")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--rays", type=int, default=19)
    parser.add_argument("--height", type=float, default=700.0, metavar="M")
    arguments = parser.parse_args()
    result = check_table(arguments.table, arguments.output, arguments.rays, arguments.height)
    save_plot(result, arguments.output / "check.png", overwrite=True)
    rows: list[dict[str, Any]] = result.to_dict()["classes"]
    for row in rows:
        print(json.dumps({name: row[name] for name in SHOWN}))


if __name__ == "__main__":
    main()
