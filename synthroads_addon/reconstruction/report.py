"""Content of `reconstruction.json`: where the cloud is from the reconstructed road, and how sure each number is."""

from dataclasses import asdict
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..checking.checker import check
from ..road.geometry import RoadGeometry
from ..road.section import LineMarking
from .cloud import PointKind, RoadCloud
from .reconstruct import Reconstruction
from .section import MeasuredSection, Side, SideSection, standard_section
from .smoothing import difference_figures
from .widenings import Bay

_MOST_POINTS = 400_000
_FROM_EDGES = 0.1  # m: nearer to an edge of the pavement than this a point may lie beside it
_FAULT = 0.5  # m: a point farther from the surface is none of it


def report(found: Reconstruction, cloud: RoadCloud) -> dict[str, Any]:
    """Return the reconstruction's report as JSON data: residuals, deviations, widths; m, crossfall in percent."""
    geometry = RoadGeometry(found.parameters)
    section = found.measured.section
    violations = check(found.parameters)
    return {
        "cloud": _cloud(cloud),
        "road": section.kind,
        "length": round(geometry.length, 3),
        "judgement": found.judgement.to_dict(),
        "centreline": _centreline(found),
        "section": section_report(section),
        "surface": _surface(found, cloud, geometry),
        "edges": {name: _edges(side, found, geometry) for name, side in section.sides.items()},
        "lines": _lines(found, geometry),
        "crossfall": {name: _figures(100.0 * _excess_fall(found, geometry, name)) for name in section.sides},
        "emergency_bays": [_bay(bay) for bay in found.measured.bays],
        "objects": _objects(found),
        "rules_broken": [asdict(violation) for violation in violations],
        "notes": found.notes,
    }


def _cloud(cloud: RoadCloud) -> dict[str, Any]:
    return {
        "points": cloud.read,
        "classes": cloud.classes,
        "pavement_by": "class" if cloud.labelled else "brightness",
        "markings_by": "class" if cloud.marked else "brightness",
    }


def _centreline(found: Reconstruction) -> dict[str, Any]:
    """Return as JSON data the residuals, m, of the measured axis from the alignment, and its deviations."""
    fit, std = found.measured.fit, found.centre.std[np.isfinite(found.centre.raw)]
    return {
        "elements": len(fit.alignment.elements),
        "from_alignment": fit.horizontal.to_dict("largest", 1),
        "height_from_profile": fit.height.to_dict("largest", 1),
        "std": {"mean": round(float(std.mean()), 4), "largest": round(float(std.max()), 4)},
        "seen": round(float(np.isfinite(found.centre.raw).mean()), 4),
    }


def section_report(section: MeasuredSection) -> dict[str, Any]:
    """Return the cross-section's widths, m, with standard deviations, as JSON data."""
    median = section.median
    return {
        "standard": standard_section(section),
        "median": median.to_dict() if median else None,
        "sides": {name: _side(side) for name, side in section.sides.items()},
    }


def _side(side: SideSection) -> dict[str, Any]:
    widths = {
        "inner_offset": side.inner_offset,
        "inner_edge_strip": side.inner_strip,
        "outside_of_lanes": side.outer_width,
        "outer_edge_strip": side.strip,
        "hard_shoulder": side.shoulder,
        "paved_width": side.paved_width,
    }
    lanes = [lane.to_dict() for lane in reversed(side.lanes)]
    seen = {"outer_edge_seen": side.edge_seen, "outermost_line_is_edge": side.closed}
    return {"lanes": lanes, **{name: width.to_dict() for name, width in widths.items()}, **seen}


def _surface(found: Reconstruction, cloud: RoadCloud, geometry: RoadGeometry) -> dict[str, Any]:
    """Return by side, as JSON data, how far, m, the pavement's points lie above the reconstructed surface."""
    chosen = np.flatnonzero(cloud.of(PointKind.PAVEMENT, PointKind.MARKING)) if cloud.labelled else cloud.surface
    chosen = chosen[:: max(1, len(chosen) // _MOST_POINTS)]
    station, offset = geometry.alignment.project(cloud.xyz[chosen, :2])
    result: dict[str, Any] = {}
    for name, section in geometry.sections.items():
        inside = (station > 0.0) & (station < geometry.length) & (offset * section.carriageway.sign > 0.0)
        on_side = np.flatnonzero(inside)
        distance, bounds = np.abs(offset[on_side]), section.distances(station[on_side])
        on_side = on_side[(distance > bounds[:, 0] + _FROM_EDGES) & (distance < bounds[:, -2] - _FROM_EDGES)]
        above = cloud.xyz[chosen[on_side], 2] - geometry.elevation(station[on_side], offset[on_side])
        result[name] = {"points": len(on_side), **_figures(above[np.abs(above) < _FAULT])}
    return result


def _edges(side: SideSection, found: Reconstruction, geometry: RoadGeometry) -> dict[str, Any]:
    """Return as JSON data how far, m, the edges seen in the stretches lie outside of the reconstructed ones."""
    stations = found.measured.stations
    section = geometry.sections[side.side]
    outer = np.where(side.usual, side.outer_edge.offsets - section.main_edge(stations), np.nan)
    inner = side.inner_edge.offsets - section.distances(stations)[:, 0]
    return {"outer": _figures(outer), "inner": _figures(inner) if found.measured.section.kind == "dual" else {}}


def _lines(found: Reconstruction, geometry: RoadGeometry) -> dict[str, Any]:
    """Return by marking, as JSON data, how far, m, it lies to the left of the reconstructed one, and its deviations."""
    stations = found.measured.stations
    result: dict[str, Any] = {}
    section = found.measured.section
    for name, marking in found.parameters.of_type(LineMarking).items():
        side = section.sides["left" if marking.carriageway.endswith("left") else "right"]
        line = section.middle if marking.kind == "free" else side.lines[len(side.lines) - 1 - marking.boundary]
        if line is None:
            continue
        left, right = geometry.marking_edges(marking, stations)
        result[name] = {
            **_figures(line.measured - 0.5 * (left + right)),
            "std": round(float(np.nanmean(line.std)), 4),
            "width": {"value": round(line.width, 3), "std": round(line.width_std, 4)},
            "painted": round(line.painted, 3),
        }
    return result


def _excess_fall(found: Reconstruction, geometry: RoadGeometry, side: Side) -> Float:
    """Return the measured less the reconstructed crossfall (K,), m/m, in each stretch."""
    modelled = geometry.crossfall(geometry.sections[side].carriageway, found.measured.stations)
    return found.surfaces[side].fall - modelled


def _bay(bay: Bay) -> dict[str, Any]:
    values = {name: value for name, value in asdict(bay).items() if name != "covariance"}
    return {name: round(value, 3) if isinstance(value, float) else value for name, value in values.items()}


def _objects(found: Reconstruction) -> dict[str, Any]:
    barriers = [
        {
            "kind": item.kind,
            "start_station": round(item.start, 2),
            "end_station": round(item.end, 2),
            "offset": {"value": round(item.offset, 3), "std": round(item.offset_std, 4)},
            "height": round(item.height, 2),
            "points": item.points,
        }
        for item in found.measured.barriers
    ]
    delineators = [
        {
            "station": round(item.station, 2),
            "offset": round(item.offset, 3),
            "std": round(item.std, 3),
            "points": item.points,
        }
        for item in found.measured.posts
    ]
    return {"barriers": barriers, "delineators": delineators}


def _figures(difference: Float) -> dict[str, float]:
    return difference_figures(difference, "mean", "rms", "p95")
