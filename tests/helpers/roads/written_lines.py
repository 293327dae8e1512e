"""Small files of roads as other programs write them, and where their lines run by an integration of their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Shape = Callable[[float], float]
"""Curvature, 1/m, at a distance from an element's start, m."""


def linear(length: float, first: float, last: float) -> Shape:
    return lambda s: first + (last - first) * s / length


def bloss(length: float, first: float, last: float) -> Shape:
    return lambda s: first + (last - first) * (3.0 * (s / length) ** 2 - 2.0 * (s / length) ** 3)


def cosine(length: float, first: float, last: float) -> Shape:
    return lambda s: first + (last - first) * 0.5 * (1.0 - math.cos(math.pi * s / length))


def sine(length: float, first: float, last: float) -> Shape:
    return lambda s: first + (last - first) * (s / length - math.sin(2.0 * math.pi * s / length) / (2.0 * math.pi))


def helmert(length: float, first: float, last: float) -> Shape:
    def curvature(s: float) -> float:
        u = s / length
        return first + (last - first) * (2.0 * u * u if u < 0.5 else 1.0 - 2.0 * (1.0 - u) ** 2)

    return curvature


class Walk:
    """A line of elements, integrated step by step: x, y (m) and heading (rad) at the start of each, and anywhere."""

    def __init__(self, elements: Sequence[tuple[float, Shape]], x: float, y: float, heading: float) -> None:
        self.poses = [(x, y, heading)]
        self.starts = [0.0]
        self._pieces = []
        for length, shape in elements:
            found = solve_ivp(
                lambda s, pose, shape=shape: (math.cos(pose[2]), math.sin(pose[2]), shape(s)),
                (0.0, length), self.poses[-1], rtol=1e-12, atol=1e-10, dense_output=True, max_step=length / 8.0,
            )  # fmt: skip
            self._pieces.append(found.sol)
            self.poses.append(tuple(found.y[:, -1].tolist()))
            self.starts.append(self.starts[-1] + length)

    def at(self, station: float) -> tuple[float, float, float]:
        n = min(int(np.searchsorted(self.starts, station, "right")) - 1, len(self._pieces) - 1)
        x, y, heading = self._pieces[n](station - self.starts[n])
        return float(x), float(y), float(heading)

    def points(self, step: float = 0.5) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        station = np.arange(0.0, self.starts[-1], step)
        return station, np.array([self.at(s)[:2] for s in station.tolist()])


def opendrive(path: Path, roads: Sequence[str], header: str = "") -> Path:
    text = f'<?xml version="1.0"?>\n<OpenDRIVE><header revMajor="1" revMinor="8">{header}</header>{"".join(roads)}'
    path.write_text(f"{text}</OpenDRIVE>\n")
    return path


def xodr_road(
    geometries: Sequence[tuple[float, float, tuple[float, float, float], str]],
    rest: str = "", name: str = "main", number: int = 1, junction: int = -1,
) -> str:  # fmt: skip
    """Return a road of geometries (station, length, pose, shape's element)."""
    rows = "".join(
        f'<geometry s="{s!r}" x="{pose[0]!r}" y="{pose[1]!r}" hdg="{pose[2]!r}" length="{length!r}">{shape}</geometry>'
        for s, length, pose, shape in geometries
    )
    total = sum(length for _, length, _, _ in geometries)
    start = f'<road name="{name}" id="{number}" junction="{junction}" length="{total!r}">'
    return f"{start}<planView>{rows}</planView>{rest}</road>"


def landxml(path: Path, alignments: Sequence[str], units: str = "Metric", unit: str = "meter", rest: str = "") -> Path:
    body = f'<Units><{units} linearUnit="{unit}" angularUnit="grads" directionUnit="grads"/></Units>{rest}'
    space = "http://www.landxml.org/schema/LandXML-1.2"
    inner = "".join(alignments)
    path.write_text(f'<?xml version="1.0"?><LandXML xmlns="{space}">{body}<Alignments>{inner}</Alignments></LandXML>')
    return path


def xml_points(**points: tuple[float, ...]) -> str:
    """Return points of LandXML, which says north before east."""
    return "".join(f"<{name}>{point[1]!r} {point[0]!r}</{name}>" for name, point in points.items())


def xml_alignment(elements: str, profile: str = "", start: float = 0.0, length: float = 0.0, rest: str = "") -> str:
    heights = f'<Profile><ProfAlign name="design">{profile}</ProfAlign></Profile>' if profile else ""
    first = f'<Alignment name="main" staStart="{start!r}" length="{length!r}">'
    return f"{first}<CoordGeom>{elements}</CoordGeom>{heights}{rest}</Alignment>"
