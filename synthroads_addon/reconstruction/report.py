"""A reconstruction from a cloud's file to its report: how far both are apart, how sure each number is, and in words.

Command line and panel run it in this way; the report is the content of `reconstruction.json`.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.machine import linear_algebra_on_one_thread
from ..base.progress import Progress, part_of, silent
from ..checking.checker import check
from ..road.axes.centerline import read_axis
from ..road.geometry import RoadGeometry
from ..road.section import LineMarking
from .axis import Options, Predictor
from .cloud import PointKind, RoadCloud, read_road_cloud
from .layout import RoadKind
from .reconstruct import Reconstruction, reconstruct
from .section import MeasuredSection, Side, SideSection, standard_section
from .smoothing import difference_figures
from .widenings import Bay

FIT_TOLERANCE = 0.03
"""Root mean square, m, that the alignment may keep from the measured axis unless another is given. Chosen: above the
noise of a measured axis, below what a lane's width is known to."""
TOLERANCES = (0.005, 1.0)
"""Smallest and largest of those, m. Chosen: below the first only noise is followed, beyond the second no lane is
kept."""
_MOST_POINTS = 400_000
"""Points that the surface is compared with at most. Chosen: more don't move its figures."""
_FROM_EDGES = 0.1
"""Distance from an edge of the pavement within which a point may lie beside it, m. Chosen: a bin."""
_FAULT = 0.5
"""Distance from the surface beyond which a point is none of it, m. Chosen: cars and kerbs."""


@dataclass(frozen=True)
class ReconstructionJob:
    """Request for a reconstruction.

    Attributes:
        cloud: cloud file to read.
        road: dual or single carriageway; None if the cloud must tell.
        course: file with the road's rough course (CSV, GeoJSON) in the cloud's coordinates; None if the cloud must show
            it.
        tolerance: root mean square that the alignment may keep from the measured axis, m.
        snap: whether measured widths near a standard cross-section's are replaced by the standard ones.
        predictor: trained network that gives one more view of the axis; None for rule-based views alone.
    """

    cloud: Path
    road: RoadKind | None = None
    course: Path | None = None
    tolerance: float = FIT_TOLERANCE
    snap: bool = False
    predictor: Predictor | None = None

    def options(self, cloud: RoadCloud) -> Options:
        """Return the settings for the cloud that was read; InputError if the course can't be read."""
        return Options(
            road=self.road,
            tolerance=self.tolerance,
            path=None if self.course is None else read_axis(self.course, cloud.place)[:, :2] - cloud.origin[:2],
            predictor=self.predictor,
            snap=self.snap,
            title=f"Reconstructed from {self.cloud.name}",
        )


@dataclass(frozen=True)
class ReconstructedRoad:
    """Outcome of a reconstruction.

    Attributes:
        reconstruction: the road, with the measurements that it was made from.
        cloud: the points that it was made from.
        report: as JSON data, see `report`.
    """

    reconstruction: Reconstruction
    cloud: RoadCloud
    report: dict[str, Any]


@linear_algebra_on_one_thread(scipy=True)
def run_reconstruction(job: ReconstructionJob, progress: Progress = silent) -> ReconstructedRoad:
    """Read a cloud and reconstruct the road in it; return the road with the report of its deviations from the cloud.

    Raises:
        MissingFileError: the cloud's or the course's file isn't there.
        InputError: a file can't be read, or no road can be made out in the cloud.
    """
    cloud = read_road_cloud(job.cloud, part_of(progress, 0.0, 0.2))
    reconstruction = reconstruct(cloud, job.options(cloud), part_of(progress, 0.2, 0.95))
    progress("report", 0.95)
    return ReconstructedRoad(reconstruction, cloud, report(reconstruction, cloud))


def report(reconstruction: Reconstruction, cloud: RoadCloud) -> dict[str, Any]:
    """Return the reconstruction's report as JSON data: residuals, deviations, widths; m, crossfall in percent."""
    geometry = RoadGeometry(reconstruction.parameters)
    section = reconstruction.measured.section
    violations = check(reconstruction.parameters)
    return {
        "cloud": _cloud(cloud),
        "road": section.kind,
        "length": round(geometry.length, 3),
        "judgement": reconstruction.judgement.to_dict(),
        "centreline": _centreline(reconstruction),
        "section": section_report(section),
        "surface": _surface(reconstruction, cloud, geometry),
        "edges": {name: _edges(side, reconstruction, geometry) for name, side in section.sides.items()},
        "lines": _lines(reconstruction, geometry),
        "crossfall": {name: _figures(100.0 * _excess_fall(reconstruction, geometry, name)) for name in section.sides},
        "emergency_bays": [_bay(bay) for bay in reconstruction.measured.bays],
        "objects": _objects(reconstruction),
        "rules_broken": [asdict(violation) for violation in violations],
        "notes": reconstruction.notes,
    }


def _cloud(cloud: RoadCloud) -> dict[str, Any]:
    """Return the cloud's points and classes, and what told pavement and markings, as JSON data."""
    return {
        "points": cloud.read,
        "classes": cloud.classes,
        "pavement_by": "class" if cloud.labelled else "brightness",
        "markings_by": "class" if cloud.marked else "brightness",
    }


def _centreline(reconstruction: Reconstruction) -> dict[str, Any]:
    """Return the residuals of the measured axis from the alignment, and its standard deviations, m, as JSON data."""
    fit, axis = reconstruction.measured.fit, reconstruction.carriageways.course.road.axis
    seen_mask = np.isfinite(axis.raw)
    std = axis.std[seen_mask]
    return {
        "elements": len(fit.alignment.elements),
        "from_alignment": fit.horizontal.to_dict("largest", 1),
        "height_from_profile": fit.height.to_dict("largest", 1),
        "std": {"mean": round(float(std.mean()), 4), "largest": round(float(std.max()), 4)},
        "seen": round(float(seen_mask.mean()), 4),
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
    """Return one side's widths, m, with standard deviations, and whether its outer edge was seen, as JSON data."""
    widths = {
        "inner_offset": side.inner_offset,
        "inner_edge_strip": side.inner_strip,
        "outside_of_lanes": side.outer_width,
        "outer_edge_strip": side.strip,
        "hard_shoulder": side.shoulder,
        "paved_width": side.paved_width,
    }
    lanes = [lane.to_dict() for lane in reversed(side.lanes)]
    flags = {"outer_edge_seen": side.edge_seen, "outermost_line_is_edge": side.closed}
    return {"lanes": lanes, **{name: width.to_dict() for name, width in widths.items()}, **flags}


def _surface(reconstruction: Reconstruction, cloud: RoadCloud, geometry: RoadGeometry) -> dict[str, Any]:
    """Return figures of the pavement points' heights above the reconstructed surface, m, by side, as JSON data."""
    pavement_points = (
        np.flatnonzero(cloud.of(PointKind.PAVEMENT, PointKind.MARKING)) if cloud.labelled else cloud.surface
    )
    pavement_points = pavement_points[:: max(1, len(pavement_points) // _MOST_POINTS)]
    station, offset = geometry.alignment.project(cloud.xyz[pavement_points, :2])
    result: dict[str, Any] = {}
    for name, section in geometry.sections.items():
        on_side_mask = (station > 0.0) & (station < geometry.length) & (offset * section.carriageway.sign > 0.0)
        on_side = np.flatnonzero(on_side_mask)
        distance, bounds = np.abs(offset[on_side]), section.distances(station[on_side])
        on_side = on_side[(distance > bounds[:, 0] + _FROM_EDGES) & (distance < bounds[:, -2] - _FROM_EDGES)]
        height_error = cloud.xyz[pavement_points[on_side], 2] - geometry.elevation(station[on_side], offset[on_side])
        result[name] = {"points": len(on_side), **_figures(height_error[np.abs(height_error) < _FAULT])}
    return result


def _edges(side: SideSection, reconstruction: Reconstruction, geometry: RoadGeometry) -> dict[str, Any]:
    """Return figures of the measured edges' distances outside of the reconstructed ones, m, as JSON data."""
    stations = reconstruction.measured.stations
    section = geometry.sections[side.side]
    outer_difference = np.where(side.usual, side.outer_edge.offsets - section.main_edge(stations), np.nan)
    inner_difference = side.inner_edge.offsets - section.distances(stations)[:, 0]
    return {
        "outer": _figures(outer_difference),
        "inner": _figures(inner_difference) if reconstruction.measured.section.kind == "dual" else {},
    }


def _lines(reconstruction: Reconstruction, geometry: RoadGeometry) -> dict[str, Any]:
    """Return figures of each measured marking's offset from the reconstructed one, m, left positive, as JSON data."""
    stations = reconstruction.measured.stations
    result: dict[str, Any] = {}
    section = reconstruction.measured.section
    for name, marking in reconstruction.parameters.of_type(LineMarking).items():
        side = section.sides["left" if marking.carriageway.endswith("left") else "right"]
        line = section.middle if marking.kind == "free" else side.lines[len(side.lines) - 1 - marking.boundary]
        if line is None:
            continue
        left_edge, right_edge = geometry.marking_edges(marking, stations)
        result[name] = {
            **_figures(line.measured - 0.5 * (left_edge + right_edge)),
            "std": round(float(np.nanmean(line.std)), 4),
            "width": {"value": round(line.width, 3), "std": round(line.width_std, 4)},
            "painted": round(line.painted, 3),
        }
    return result


def _excess_fall(reconstruction: Reconstruction, geometry: RoadGeometry, side: Side) -> Float:
    """Return the measured minus the reconstructed crossfall (K,), m/m, in each stretch."""
    modelled = geometry.crossfall(geometry.sections[side].carriageway, reconstruction.measured.stations)
    return reconstruction.carriageways.surfaces[side].fall - modelled


def _bay(bay: Bay) -> dict[str, Any]:
    """Return an emergency bay's measures, m, rounded, as JSON data; without its covariance."""
    values = {name: value for name, value in asdict(bay).items() if name != "covariance"}
    return {name: round(value, 3) if isinstance(value, float) else value for name, value in values.items()}


def _objects(reconstruction: Reconstruction) -> dict[str, Any]:
    """Return the reconstructed barriers and delineators, lengths in m, as JSON data."""
    barriers = [
        {
            "kind": item.kind,
            "start_station": round(item.start, 2),
            "end_station": round(item.end, 2),
            "offset": {"value": round(item.offset, 3), "std": round(item.offset_std, 4)},
            "height": round(item.height, 2),
            "points": item.points,
        }
        for item in reconstruction.measured.barriers
    ]
    delineators = [
        {
            "station": round(item.station, 2),
            "offset": round(item.offset, 3),
            "std": round(item.std, 3),
            "points": item.points,
        }
        for item in reconstruction.measured.posts
    ]
    return {"barriers": barriers, "delineators": delineators}


def _figures(difference: Float) -> dict[str, float]:
    """Return mean, root mean square and 95th percentile of differences (NaN left out), rounded."""
    return difference_figures(difference, "mean", "rms", "p95")


def measure_lines(report: dict[str, Any]) -> Iterator[str]:
    """Yield a reconstruction's alignment, widths with their deviations, and number of objects, a line each."""
    section, line = report["section"], report["centreline"]
    elements = "1 element" if line["elements"] == 1 else f"{line['elements']} elements"
    rms_error, mean_std = 100.0 * line["from_alignment"]["rms"], 100.0 * line["std"]["mean"]
    yield f"{report['road']} carriageway of {report['length']:.0f} m, alignment of {elements}"
    yield f"{rms_error:.1f} cm rms from the measured axis (std {mean_std:.1f} cm)"
    for name, side in section["sides"].items():
        widths = " + ".join(f"{lane['value']:.2f}" for lane in side["lanes"])
        paved = side["paved_width"]
        spread = "not seen to its edge" if paved["std"] is None else f"std {paved['std']:.2f} m"
        yield f"{name}: lanes {widths} m, pavement {paved['value']:.2f} m ({spread})"
    standard = section["standard"]
    if standard and standard["within_tolerance"]:
        yield f"within {standard['largest_difference']:.2f} m of the standard cross-section {standard['name']}"
    objects = report["objects"]
    bays = f", {len(report['emergency_bays'])} emergency bays" if report["emergency_bays"] else ""
    yield f"{len(objects['barriers'])} barriers, {len(objects['delineators'])} delineators{bays}"


def doubt_lines(judgement: dict[str, Any]) -> Iterator[tuple[float, str]]:
    """Yield (station where it begins, m; text) of each stretch that isn't to be trusted, with the reasons."""
    for kind, kind_text in (("doubtful", "doubtful"), ("other_sections", "another section")):
        for doubt in judgement.get(kind, ()):
            stretch_text = f"{kind_text} from {doubt['start']:.0f} to {doubt['end']:.0f} m"
            yield doubt["start"], f"{stretch_text}: {'; '.join(doubt['why'])}"


def reservation_lines(report: dict[str, Any]) -> Iterator[str]:
    """Yield a report's notes, doubtful stretches, and the comparison with the truth, a line each."""
    yield from (f"note: {note}" for note in report["notes"])
    yield from (text for _, text in doubt_lines(report["judgement"]))
    if "comparison" in report:
        deviation = report["comparison"]["centreline"]
        difference = (
            f"{deviation['mae']:.3f} m on average, {deviation['largest']:.3f} m at most"
            if deviation
            else "nothing in common"
        )
        yield f"from the truth: centreline {difference}"
