"""Draw a CityJSON file's surfaces by what they are, from above and in perspective: docs/pictures/twin-cityjson.png.

    synthroads parameters --seed 13 --length 1200 --set road.turnouts.exits=1 --set road.furniture.overpass=1 \\
        --set road.furniture.gantries=1 > out/parameters.json
    synthroads twin out/parameters.json --output out/twin --twin cityjson
    python studies/twins/cityjson.py out/twin/twin.city.json docs/pictures/twin-cityjson.png --station 760

Reads the file itself: nothing of what wrote it is between it and the picture.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from synthroads_addon.base.figure import new_figure, save_figure

Float = NDArray[np.float64]

COLOURS = {
    "driving lane": "#6b6f76",
    "deceleration lane": "#8a7fb0",
    "acceleration lane": "#8a7fb0",
    "hard shoulder": "#a3a08f",
    "emergency bay": "#b98f5a",
    "edge strip": "#8d9096",
    "gore": "#b0a6c8",
    "median": "#9cc37a",
    "soft shoulder": "#b7d19a",
    "traffic island": "#cfe0b4",
    "line": "#ffffff",
    "arrow": "#ffffff",
    "hatching": "#ffffff",
    "pothole": "#c0392b",
    "furniture": "#2c6fb7",
    "bridge": "#d99058",
}
SPAN = 45.0
"""Distance (m) across the road to either side of the middle of the picture that is drawn."""


def surfaces(data: dict[str, Any]) -> Iterator[tuple[str, Float]]:
    """Yield (kind, corners (K, 3), m from the file's origin) of every polygon of a CityJSON file's data."""
    vertices = np.array(data["vertices"]) * np.array(data["transform"]["scale"])
    for item in data["CityObjects"].values():
        kind = {"CityFurniture": "furniture", "BridgeConstructiveElement": "bridge"}.get(item["type"], "")
        for shape in item.get("geometry", ()):
            boundaries = shape["boundaries"]
            if "semantics" in shape:
                semantics = shape["semantics"]
                for (ring,), value in zip(boundaries, semantics["values"], strict=True):
                    yield semantics["surfaces"][value]["function"], vertices[ring]
            elif "Solid" in shape["type"]:
                for solid in [boundaries] if shape["type"] == "Solid" else boundaries:
                    yield from ((kind, vertices[ring]) for (ring,) in solid[0])


def axis_of(data: dict[str, Any]) -> Float:
    """Return the first line string of a CityJSON file, the centreline (N, 3), m from the file's origin."""
    for item in data["CityObjects"].values():
        for shape in item.get("geometry", ()):
            if shape["type"] == "MultiLineString":
                line: Float = np.array(data["vertices"])[shape["boundaries"][0]] * data["transform"]["scale"]
                return line
    raise SystemExit("the file has no centreline")


def along_road(points: Float, middle: Float, heading: float) -> Float:
    """Return points (..., 3) in a frame at a point of the road: x along `heading` (rad), y to the left, m."""
    shifted = points - middle
    c, s = np.cos(heading), np.sin(heading)
    plan = np.stack([shifted[..., 0] * c + shifted[..., 1] * s, shifted[..., 1] * c - shifted[..., 0] * s], axis=-1)
    return np.concatenate([plan, shifted[..., 2:]], axis=-1)


def draw(data: dict[str, Any], station: float, target: Path) -> None:
    """Write a picture of 220 m of the road about a station from above, and of the view ahead."""
    axis = axis_of(data)
    stations = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(axis[:, :2], axis=0), axis=1))])
    axis_row = int(np.searchsorted(stations, station))
    step = axis[min(axis_row + 1, len(axis) - 1)] - axis[max(axis_row - 1, 0)]
    placed_polygons = [
        (k, along_road(r, axis[axis_row], float(np.arctan2(step[1], step[0])))) for k, r in surfaces(data)
    ]
    figure = new_figure(14, 11, layout=None)
    top_axes, front_axes = figure.subplots(2, 1, height_ratios=(1, 1.25))
    _from_above(
        top_axes, [(k, r) for k, r in placed_polygons if np.abs(r[:, 0]).max() < 115 and np.abs(r[:, 1]).max() < SPAN]
    )
    _ahead(front_axes, placed_polygons)
    kinds_drawn = {kind for kind, _ in placed_polygons}
    patches = [Patch(facecolor=c, edgecolor="#999999", label=k) for k, c in COLOURS.items() if k in kinds_drawn]
    figure.legend(handles=patches, loc="lower center", ncols=8, frameon=False, fontsize=9)
    figure.subplots_adjust(left=0.05, right=0.99, top=0.99, bottom=0.09, hspace=0.06)
    save_figure(figure, target, dpi=100)


def _from_above(axes: Any, placed_polygons: list[tuple[str, Float]]) -> None:
    """Draw the polygons from above, the lowest first, things on top."""
    placed_polygons.sort(key=lambda pair: pair[1][:, 2].mean() + 50.0 * (pair[0] in ("furniture", "bridge")))
    axes.add_collection(
        PolyCollection(
            [r[:, :2] for _, r in placed_polygons],
            facecolors=[COLOURS[k] for k, _ in placed_polygons],
            edgecolors="none",
        )
    )
    axes.set(xlim=(-110, 110), ylim=(-32, 32), aspect="equal", facecolor="#e9efe0", ylabel="left of the centreline, m")


def _ahead(axes: Any, placed_polygons: list[tuple[str, Float]]) -> None:
    """Draw the polygons before a camera 9 m above the road, the farthest first; markings after what they lie on."""
    eye = np.array([-110.0, -8.0, 9.0])
    drawn_polygons = []
    for kind, ring in placed_polygons:
        from_eye = ring - eye
        if from_eye[:, 0].min() > 3.0 and from_eye[:, 0].max() < 520.0:
            depth = np.linalg.norm(from_eye, axis=1).mean() - 3.0 * (kind in ("line", "arrow", "hatching", "pothole"))
            is_upright = kind in ("furniture", "bridge")
            drawn_polygons.append(
                (is_upright, -depth, kind, np.stack([-from_eye[:, 1], from_eye[:, 2]], axis=1) / from_eye[:, :1])
            )
    drawn_polygons.sort(key=lambda entry: entry[:2])
    colours, edges = [COLOURS[e[2]] for e in drawn_polygons], ["#00000044" if e[0] else "none" for e in drawn_polygons]
    axes.add_collection(
        PolyCollection([e[3] for e in drawn_polygons], facecolors=colours, edgecolors=edges, linewidths=0.4)
    )
    axes.set(xlim=(-0.62, 0.62), ylim=(-0.32, 0.14), aspect="equal", facecolor="#dfe9f3", xticks=[], yticks=[])


def main() -> None:
    """Draw the CityJSON file that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("file", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--station", type=float, default=600.0, help="middle of the view from above, m")
    arguments = parser.parse_args()
    draw(json.loads(arguments.file.read_text(encoding="utf-8")), arguments.station, arguments.picture)


if __name__ == "__main__":
    main()
