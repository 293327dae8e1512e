"""Draw docs/pictures/scan-paths.png: the forms of a path and a tripod's positions along a road, seen from above.

Usage: python studies/scanner/paths.py
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.figure import new_figure, save_figure  # noqa: E402
from synthroads_addon.road.geometry import RoadGeometry  # noqa: E402
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint  # noqa: E402
from synthroads_addon.road.parameters import AlignmentObject  # noqa: E402
from synthroads_addon.sampling.road import sample_road  # noqa: E402
from synthroads_addon.scanning.platforms.guides import RoadGuide  # noqa: E402
from synthroads_addon.scanning.platforms.platform import Platform  # noqa: E402
from synthroads_addon.scanning.platforms.registry import make_platform  # noqa: E402
from synthroads_addon.scenario.road import RoadScenario  # noqa: E402

TARGET = ROOT / "docs" / "pictures" / "scan-paths.png"
PANELS: list[tuple[str, dict[str, Any]]] = [
    ("direct: the offset lines of the centreline", {"lateral_offsets": (25.0, -25.0)}),
    (
        "smoothed: polynomials of degree 3 fitted to the centreline",
        {"path": "smoothed", "polynomial_degree": 3, "lateral_offsets": (25.0, -25.0)},
    ),
    (
        "zigzag: swaying 30 m to either side, once in 120 m",
        {"path": "zigzag", "zigzag_amplitude": 30.0, "zigzag_wavelength": 120.0, "lateral_offsets": (0.0,)},
    ),
    ("vehicle: with the traffic of its carriageway, and tripod: every 80 m", {"kind": "vehicle"}),
]
COLORS = ("#d1495b", "#00798c")


def curved_road() -> RoadGuide:
    """Return the guide of a sampled motorway of 850 m with two curves."""
    rows = (
        (60.0, 0.0, 0.0),
        (90.0, 0.0, 1 / 300),
        (200.0, 1 / 300, 1 / 300),
        (90.0, 1 / 300, 0.0),
        (90.0, 0.0, -1 / 350),
        (230.0, -1 / 350, -1 / 350),
        (90.0, -1 / 350, 0.0),
    )
    axis = AlignmentObject(
        instance=1,
        start_x=-300.0,
        start_y=-30.0,
        start_heading_deg=-28.0,
        horizontal=tuple(HorizontalElement.between(*row) for row in rows),
        vertical=(VerticalPoint(station=0.0, elevation=0.0, radius=0.0),),
    )
    road = RoadScenario.from_dict(
        {"length": sum(row[0] for row in rows), "turnouts": {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0}}
    )
    return RoadGuide(RoadGeometry(sample_road(road, 1, "", axis)))


def draw_road(axes: Axes, guide: RoadGuide) -> None:
    """Draw the paved carriageways and the centreline into the axes."""
    station = np.linspace(0.0, guide.length, 800)
    plan, heading, _, _ = guide.frame(station)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    for section in guide.geometry.sections.values():
        distances = section.distances(station)
        edges = [plan + section.carriageway.sign * distances[:, [i]] * left for i in (0, -2)]
        axes.fill(*np.concatenate([edges[0], edges[1][::-1]]).T, color="#c9c9c9", lw=0)
    axes.plot(*plan.T, color="#555555", lw=0.7, ls=(0, (6, 4)))


def draw_path(axes: Axes, guide: RoadGuide, platform: Platform) -> None:
    """Draw a platform's strips with arrows in the direction of travel into the axes."""
    path = platform.make_path(guide)
    for strip in path.strips:
        position, _ = path.pose(strip, strip.start_time + np.linspace(0.0, strip.duration, 1200))
        color = COLORS[strip.index % 2]
        axes.plot(*position[:, :2].T, color=color, lw=1.4)
        for share in (0.22, 0.5, 0.78):
            arrow_row = int(share * 1200)
            (x0, y0, _), (x1, y1, _) = position[[arrow_row, arrow_row + 6]].tolist()
            axes.annotate("", (x1, y1), (x0, y0), arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.4})


def draw_tripods(axes: Axes, guide: RoadGuide) -> None:
    """Draw the default positions of a tripod, numbered, into the axes."""
    path = make_platform("tripod").make_path(guide)
    place = np.array([path.pose(strip, np.array([strip.start_time]))[0][0] for strip in path.strips])
    axes.plot(*place[:, :2].T, ls="", marker="^", color="#222222", ms=6)
    for number, (x, y) in enumerate(place[:, :2]):
        label_shift = 7 if number % 2 else -14
        axes.annotate(str(number), (x, y), (0, label_shift), textcoords="offset points", ha="center", size=8)


def main() -> None:
    """Write the picture docs/pictures/scan-paths.png."""
    guide = curved_road()
    figure = new_figure(13.0, 4.1)
    grid = figure.subplots(2, 2, sharex=True, sharey=True)
    for axes, (title, options) in zip(grid.ravel(), PANELS, strict=True):
        draw_road(axes, guide)
        draw_path(axes, guide, make_platform(**options))
        if options.get("kind") == "vehicle":
            draw_tripods(axes, guide)
        axes.set_title(title, size=10, loc="left")
        axes.margins(0.05, 0.12)
        axes.set_aspect("equal")
        axes.spines[["top", "right"]].set_visible(False)
    for axes in grid[1]:
        axes.set_xlabel("east, m")
    for axes in grid[:, 0]:
        axes.set_ylabel("north, m")
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, TARGET, dpi=110)
    print(TARGET.relative_to(ROOT))


if __name__ == "__main__":
    main()
