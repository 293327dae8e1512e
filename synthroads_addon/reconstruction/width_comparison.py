"""Each width of a reconstructed cross-section against the true one, stretch by stretch, beside its own deviation.

For figures and tests, never for the reconstruction itself.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Bool, Float
from ..road.geometry import RoadGeometry
from ..road.objects import Side
from ..road.parameters import RoadParameters
from ..road.section_geometry import CarriagewaySection
from .reconstruct import Reconstruction
from .section import SideSection
from .widenings import Bay, unlike_mask

_ISLAND = 0.05
"""Width from which on an island is there, m. Chosen: rounding leaves less."""
_LANE_THERE = 1.0
"""Width from which on a lane is there, m. Chosen: a narrower one begins or ends."""


@dataclass(frozen=True)
class WidthErrors:
    """How far one width of one side is from the true one in K stretches along the reconstructed road.

    Attributes:
        side: of the reconstructed road.
        name: median (half of it), inner strip, lanes from inside ("lane 1"), outside (all pavement beyond the lanes).
        error: (K,) found less true, m; infinite where the numbers of lanes differ, NaN beyond the true road's ends.
        std: (K,) its own standard deviation, m; infinite where the width is said to be a guess.
        marked: (K,) whether the reconstruction says that it isn't to be trusted there.
    """

    side: Side
    name: str
    error: Float
    std: Float
    marked: Bool

    @property
    def off(self) -> Float:
        """Return by how many of its deviations (K,) the width is off; 0 for a guess, NaN beyond the true road.

        Where the numbers of lanes differ it is infinite.
        """
        off = np.full(len(self.error), np.inf)
        finite = ~np.isinf(self.error)
        off[finite] = np.abs(self.error[finite]) / self.std[finite]
        return off


def compare_widths(reconstruction: Reconstruction, truth: RoadParameters) -> list[WidthErrors]:
    """Return the errors of all widths of a reconstruction's cross-section, beside its deviations."""
    there, here = RoadGeometry(truth), RoadGeometry(reconstruction.parameters)
    at = reconstruction.measured.stations
    shift = np.array(reconstruction.parameters.transform.translate[:2]) - np.array(truth.transform.translate[:2])
    position, heading, _ = here.alignment.frame(at)
    station, _ = there.alignment.project(position + shift)
    inside = (at > 0.0) & (at < here.length) & (station > 0.0) & (station < there.length)
    same = bool(np.median(np.cos(heading - there.alignment.heading(station))) > 0.0)
    doubted = np.zeros(len(at), dtype=bool)
    for doubt in reconstruction.judgement.doubts:
        doubted |= (at >= doubt.start) & (at <= doubt.end)
    result = []
    for name, measured in reconstruction.measured.section.sides.items():
        other: Side = name if same else ("left" if name == "right" else "right")
        marked = doubted | unlike_mask([one for one in reconstruction.carriageways.unlike if one.side == name], at)
        pairs = _pairs(measured, here.sections[name], there.sections[other], at, station)
        bays = [bay for bay in reconstruction.measured.bays if bay.side == name]
        for what, error, std in pairs:
            if what in ("median", "inner strip") and reconstruction.measured.section.kind == "single":
                continue  # they have none
            deviation = _with_bays(at, std, bays) if what == "outside" else np.full(len(at), std)
            result.append(WidthErrors(name, what, np.where(inside, error, np.nan), deviation, marked))
    return result


def _pairs(
    measured: SideSection, reconstructed: CarriagewaySection, true: CarriagewaySection, at: Float, station: Float
) -> Iterator[tuple[str, Float, float]]:
    """Yield (name, found less true (K,), deviation), m, of the widths of one side."""
    widths = [_widths(section, where) for section, where in ((reconstructed, at), (true, station))]
    yield "median", widths[0][0] - widths[1][0], measured.inner_offset.std
    yield "inner strip", widths[0][1] - widths[1][1], measured.inner_strip.std
    there, lanes = widths[1][2], measured.lanes
    number = (there >= _LANE_THERE).sum(axis=1)
    for nth, lane in enumerate(lanes):
        beside = np.take_along_axis(there, np.argsort(there < _LANE_THERE, axis=1, kind="stable"), axis=1)
        known = np.where(number > nth, beside[:, min(nth, there.shape[1] - 1)], np.nan)
        error = widths[0][2][:, nth] - known
        yield f"lane {nth + 1}", np.where(number == len(lanes), error, np.inf), lane.std
    yield "outside", widths[0][3] - widths[1][3], measured.outer_width.std


def _widths(section: CarriagewaySection, station: Float) -> tuple[Float, Float, Float, Float]:
    """Return half of the median, inner strip, lanes from inside (K, lanes), and all pavement outside of these, m."""
    distances, lanes = section.distances(station), section.lane_boundaries(station)[:, ::-1]
    inner, outer = distances[:, 0], section.paved_edge(station)
    if "island" in section.kinds:  # beyond it lies a ramp, which is a road of its own
        island, behind = section.boundaries_of("island", station)
        outer = np.where(behind - island > _ISLAND, island, outer)
    return inner, lanes[:, 0] - inner, np.diff(lanes, axis=1), outer - lanes[:, -1]


def _with_bays(at: Float, std: float, bays: list[Bay]) -> Float:
    """Return the deviation (K,), m, of the width outside of the lanes, within bays that of the bay's shape as well."""
    result = np.full(len(at), std)
    for bay in bays:
        result = np.hypot(result, bay.std_at(at))
    return result
