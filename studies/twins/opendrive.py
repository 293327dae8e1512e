"""Draw docs/pictures/twin-opendrive.png: a road as it is read back from its OpenDRIVE file.

Usage: python studies/twins/opendrive.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree  # nosec B405 # the file was written just before

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from synthroads_addon.base.figure import new_figure, save_figure
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.files.opendrive_reader import OpenDrive, corners_local, corners_road, number

COLOURS = {
    "driving": "#6f7782",
    "border": "#a9b0b8",
    "stop": "#8d9fb8",
    "median": "#a9c58a",
    "shoulder": "#c9b98a",
    "none": "#cfe0b4",
    "restricted": "#d9a066",
    "exit": "#4f8fc0",
    "entry": "#4f8fc0",
    "offRamp": "#2f6a9e",
    "onRamp": "#2f6a9e",
}
STRETCHES = ((255.0, 375.0), (800.0, 920.0))
"""Stretches of the road that are drawn, one above the other, m."""
SCENARIO = {
    "design_class": "EKA1A",
    "cross_section": "RQ36",
    "length": 1600.0,
    "turnouts": {"exits": 1, "entries": 1, "emergency_bays": 1},
    "furniture": {"gantries": 1, "overpass": 1},
    "lane_changes": {"share": 1},
}
SEED = 2


class Turned:
    """An OpenDRIVE road in a frame at the middle of a stretch, x along it: the stretch runs to the right."""

    def __init__(self, road: OpenDrive, stretch: tuple[float, float]) -> None:
        self.road = road
        middle = np.array([sum(stretch) / 2.0])
        heading = float(road.reference(middle)[1][0])
        self.turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        self.heading = heading
        self.origin = road.point(middle, np.zeros(1))[0, :2]

    def at(self, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Return the points (N, 2), m, at stations s and offsets t (N,) in the turned frame."""
        return (self.road.point(s, t)[:, :2] - self.origin) @ self.turn.T

    def place(self, item: ElementTree.Element) -> tuple[np.ndarray, float]:
        """Return an object's place (2,), m, and the road's heading there, rad, in the turned frame."""
        s = np.array([number(item, "s")])
        return self.at(s, np.array([number(item, "t")]))[0], float(self.road.reference(s)[1][0]) - self.heading


def lanes(axes: Axes, map_: Turned, span: tuple[float, float]) -> set[str]:
    """Draw the lanes between two stations by type into the axes; return their types."""
    types, road = set(), map_.road
    for section in road.sections:
        start, end = max(section.start, span[0]), min(section.end, span[1])
        if end <= start:
            continue
        s = np.linspace(start, end - 1e-7, max(2, int(end - start) + 1))
        s = np.unique(np.clip(np.append(s, [start + 0.05, end - 0.05]), start, end - 1e-7))  # what changes at once
        borders = section.borders(s, road.lane_offset(s))
        for i, lane in section.lanes.items():
            inner, outer = (map_.at(s, borders[n]) for n in (i - int(np.sign(i)), i))
            face = np.concatenate([inner, outer[::-1]])
            axes.add_collection(PolyCollection([face], facecolor=COLOURS[lane.type], edgecolor="white", lw=0.15))
            types.add(lane.type)
    return types


def paint(axes: Axes, map_: Turned, span: tuple[float, float]) -> None:
    """Draw the road marks and painted areas between two stations in true width into the axes."""
    faces, colours, road = [], [], map_.road
    for mark in road.marks():
        if mark.end < span[0] or mark.start > span[1]:
            continue
        s = np.linspace(max(mark.start, span[0]), min(mark.end, span[1]), 40)
        section = next(item for item in road.sections if item.start - 1e-6 <= s.mean() <= item.end + 1e-6)
        t = section.borders(s, road.lane_offset(s))[mark.lane] + mark.aside
        left_edge, right_edge = (map_.at(s, t + side * mark.width / 2.0) for side in (1, -1))
        faces.append(np.concatenate([left_edge, right_edge[::-1]]))
        colours.append({"white": "white", "yellow": "#ffd21f"}[mark.color])
    for item in road.objects().values():
        if item.get("type") == "roadMark" and span[0] < number(item, "s") < span[1]:
            faces += [map_.at(corners[:, 0], corners[:, 1]) for corners in corners_road(item)]
            colours += ["white"] * (len(faces) - len(colours))
    axes.add_collection(PolyCollection(faces, facecolor=colours, edgecolor="none", zorder=3))


def furniture(axes: Axes, map_: Turned, span: tuple[float, float]) -> None:
    """Draw barriers as lines, other objects as outlines or dots, and signals as arrows into the axes."""
    walls, road = [], map_.road
    for item in road.objects().values():
        for repeat in item.findall("repeat"):
            start, length = number(repeat, "s"), number(repeat, "length")
            s = np.linspace(start, start + length, max(2, int(length) + 1))
            if s[-1] > span[0] and s[0] < span[1]:
                s = s[(s >= span[0]) & (s <= span[1])]
                t = np.interp(s, [start, start + length], [number(repeat, "tStart"), number(repeat, "tEnd")])
                walls.append(map_.at(s, t))
        s = np.array([number(item, "s")])
        if item.get("type") in ("barrier", "roadMark") or not span[0] <= s[0] <= span[1]:
            continue
        place, heading = map_.place(item)
        heading += number(item, "hdg")
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        outlines = [corners[:, :2] @ turn.T + place for corners in corners_local(item)]
        axes.add_collection(PolyCollection(outlines, facecolor="#b0303040", edgecolor="#8c1c1c", lw=0.8, zorder=5))
        if not outlines:
            axes.plot(*place, "o", ms=2.4, color="#8c1c1c", zorder=5)
    axes.add_collection(LineCollection(walls, color="#3a2a20", lw=1.3, zorder=4))
    for item in road.signals().values():
        if span[0] <= number(item, "s") <= span[1]:
            place, heading = map_.place(item)
            heading += number(item, "hOffset") + (np.pi if item.get("orientation") == "+" else 0.0)
            direction = 2.6 * np.array([np.cos(heading), np.sin(heading)])
            arrow = {"arrowstyle": "-|>", "color": "#c2185b"}
            axes.annotate("", tuple(place + direction), tuple(place), arrowprops=arrow, zorder=6)
            text = item.get("type", "") + ("" if item.get("subtype") == "-1" else f"-{item.get('subtype')}")
            side = 1.0 if direction[0] > 0.0 else -1.0
            style: dict[str, Any] = {"fontsize": 7, "color": "#c2185b", "va": "center", "zorder": 6}
            axes.text(place[0] + 3.4 * side, place[1], text, ha="left" if side > 0.0 else "right", **style)


def main() -> None:
    """Write docs/pictures/twin-opendrive.png."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "road.xodr"
        write_opendrive(sample_road(RoadScenario.from_dict(SCENARIO), SEED), path, 0.005)
        roads = OpenDrive.read(path)
    figure = new_figure(14.0, 11.5, layout=None)
    panels = figure.subplots(len(STRETCHES), 1)
    types: set[str] = set()
    for axes, stretch in zip(panels, STRETCHES, strict=True):
        for road in roads:
            view = Turned(road, stretch)
            types |= lanes(axes, view, stretch)
            paint(axes, view, stretch)
            furniture(axes, view, stretch)
        axes.set_aspect("equal")
        axes.autoscale_view()
        axes.set(xlabel="along, m", ylabel="across, m", title=f"Station {stretch[0]:g} m to {stretch[1]:g} m")
        axes.set_facecolor("#eef3e6")
    handles: list[Patch | Line2D] = [Patch(color=COLOURS[name], label=name) for name in COLOURS if name in types]
    handles.append(Line2D([], [], color="#3a2a20", label="barrier"))
    handles.append(Line2D([], [], color="#8c1c1c", marker="o", ms=3, ls="", label="object"))
    handles.append(Line2D([], [], color="#c2185b", marker=">", ms=4, label="signal, facing its traffic"))
    figure.legend(handles=handles, loc="lower center", ncols=7, fontsize=8, frameon=False)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    save_figure(figure, Path(__file__).parents[2] / "docs" / "pictures" / "twin-opendrive.png", dpi=100)


if __name__ == "__main__":
    main()
