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
    """Errors of one width of one side in K stretches along the reconstructed ("found") road.

    Attributes:
        side: side of the reconstructed road.
        name: median (half of it), inner strip, lanes from inside ("lane 1"), outside (all pavement beyond the lanes).
        error: (K,) found minus true width, m; infinite where the numbers of lanes differ, NaN beyond the true road's
            ends.
        std: (K,) standard deviation that the reconstruction states, m; infinite where the width is a guess.
        marked: (K,) mask of the stretches that the reconstruction calls doubtful.
    """

    side: Side
    name: str
    error: Float
    std: Float
    marked: Bool

    @property
    def off(self) -> Float:
        """Return the error over the stated standard deviation (K,); 0 for a guess, NaN beyond the true road.

        It is infinite where the numbers of lanes differ.
        """
        ratio = np.full(len(self.error), np.inf)
        has_error = ~np.isinf(self.error)
        ratio[has_error] = np.abs(self.error[has_error]) / self.std[has_error]
        return ratio


def compare_widths(reconstruction: Reconstruction, truth: RoadParameters) -> list[WidthErrors]:
    """Return the errors and stated standard deviations of all widths of a reconstruction's cross-section."""
    true_road, found_road = RoadGeometry(truth), RoadGeometry(reconstruction.parameters)
    found_stations = reconstruction.measured.stations
    shift = np.array(reconstruction.parameters.transform.translate[:2]) - np.array(truth.transform.translate[:2])
    position, heading, _ = found_road.alignment.frame(found_stations)
    true_stations, _ = true_road.alignment.project(position + shift)
    # Stations at which a foot lies on the end of either road have none across it.
    on_both_roads = (
        (found_stations > 0.0)
        & (found_stations < found_road.length)
        & (true_stations > 0.0)
        & (true_stations < true_road.length)
    )
    same_direction = bool(np.median(np.cos(heading - true_road.alignment.heading(true_stations))) > 0.0)
    doubtful = np.zeros(len(found_stations), dtype=bool)
    for doubt in reconstruction.judgement.doubts:
        doubtful |= (found_stations >= doubt.start) & (found_stations <= doubt.end)
    result = []
    for name, side_section in reconstruction.measured.section.sides.items():
        true_side: Side = name if same_direction else ("left" if name == "right" else "right")
        distrusted = doubtful | unlike_mask(
            [stretch for stretch in reconstruction.carriageways.unlike if stretch.side == name], found_stations
        )
        pairs = _pairs(
            side_section, found_road.sections[name], true_road.sections[true_side], found_stations, true_stations
        )
        bays = [bay for bay in reconstruction.measured.bays if bay.side == name]
        for width_name, error, std in pairs:
            if width_name in ("median", "inner strip") and reconstruction.measured.section.kind == "single":
                continue  # they have none
            deviation = (
                _with_bays(found_stations, std, bays) if width_name == "outside" else np.full(len(found_stations), std)
            )
            result.append(WidthErrors(name, width_name, np.where(on_both_roads, error, np.nan), deviation, distrusted))
    return result


def _pairs(
    side_section: SideSection,
    found_section: CarriagewaySection,
    true_section: CarriagewaySection,
    found_stations: Float,
    true_stations: Float,
) -> Iterator[tuple[str, Float, float]]:
    """Yield (name, found minus true width (K,), stated standard deviation), m, of each width of one side."""
    widths = [
        _widths(section, stations)
        for section, stations in ((found_section, found_stations), (true_section, true_stations))
    ]
    yield "median", widths[0][0] - widths[1][0], side_section.inner_offset.std
    yield "inner strip", widths[0][1] - widths[1][1], side_section.inner_strip.std
    true_lanes, lanes = widths[1][2], side_section.lanes
    number = (true_lanes >= _LANE_THERE).sum(axis=1)
    for nth, lane in enumerate(lanes):
        existing_lanes = np.take_along_axis(
            true_lanes, np.argsort(true_lanes < _LANE_THERE, axis=1, kind="stable"), axis=1
        )
        true_width = np.where(number > nth, existing_lanes[:, min(nth, true_lanes.shape[1] - 1)], np.nan)
        error = widths[0][2][:, nth] - true_width
        yield f"lane {nth + 1}", np.where(number == len(lanes), error, np.inf), lane.std
    yield "outside", widths[0][3] - widths[1][3], side_section.outer_width.std


def _widths(section: CarriagewaySection, station: Float) -> tuple[Float, Float, Float, Float]:
    """Return inner offset, inner strip, lanes from inside (K, lanes), and the pavement outside of these, m."""
    distances, lanes = section.distances(station), section.lane_boundaries(station)[:, ::-1]
    inner_edge, outer_edge = distances[:, 0], section.paved_edge(station)
    if "island" in section.kinds:  # beyond it lies a ramp, which is a road of its own
        island, island_end = section.boundaries_of("island", station)
        outer_edge = np.where(island_end - island > _ISLAND, island, outer_edge)
    return inner_edge, lanes[:, 0] - inner_edge, np.diff(lanes, axis=1), outer_edge - lanes[:, -1]


def _with_bays(stations: Float, std: float, bays: list[Bay]) -> Float:
    """Return the standard deviation (K,), m, of the width outside of the lanes, in bays with the bay's own."""
    result = np.full(len(stations), std)
    for bay in bays:
        result = np.hypot(result, bay.std_at(stations))
    return result
