"""How a street side changes the strips beside its carriageway along the road, in plan and in height."""

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Float
from ..objects import AnyWidth, width_at
from .street_side import KERB_END, StreetSide

STREET_STRIPS = ("gutter", "parking_bay", "kerb_face", "kerb", "footway")
"""Strips between pavement and verge that street sides make, from the pavement outwards."""
BEYOND_PLANE = STREET_STRIPS[1:]
"""Those that leave the pavement's plane; the gutter lies in it."""
END_RAMP = 1.0
"""Length over which the kerb comes to its height at either end of a stretch, m. Chosen."""

_TAPER_ROWS = np.linspace(0.0, 1.0, 4)
"""Rows of a mesh along a bay's taper, as shares of its length."""


@dataclass(frozen=True)
class StreetFields:
    """Values that a street side gives the strips at N stations.

    Attributes:
        widths: (N,) by kind, of `STREET_STRIPS`, m.
        lifts: (N,) heights of the outer boundaries of `BEYOND_PLANE` above the plane at the gutter's outer edge, m.
        verge_extra: (N,) what the verge is wider, or less wide, than the carriageway's, m.
    """

    widths: dict[str, Float]
    lifts: dict[str, Float]
    verge_extra: Float


class StreetShape:
    """The strips of one street side, by station.

    Attributes:
        side: the street side.
        materials: of its strips, by kind.
    """

    def __init__(self, side: StreetSide, verge_width: AnyWidth) -> None:
        self.side = side
        self._verge_width = verge_width
        self.materials = {
            "gutter": side.gutter_material,
            "parking_bay": side.bay_material,
            "kerb_face": side.kerb_material,
            "kerb": side.kerb_material,
            "footway": side.footway_material,
        }

    def reaches(self, station: Float) -> bool:
        """Say whether any station (N,) may lie on the stretch."""
        return not np.all((station > self.side.end_station) | (station < self.side.start_station))

    def kinks(self) -> list[float]:
        """Return the stations (m, unsorted) at which the rate of change of a width or a height jumps.

        Tapers of bays have some in between: in curves their slanting edges bend more than the road.
        """
        side = self.side
        from_ends = (0.0, KERB_END, KERB_END + self._end_ramp, side.transition_length)
        marks = [s for d in from_ends for s in (side.start_station + d, side.end_station - d)]
        for bay in side.bays:
            for station, sign in ((bay.start_station, 1.0), (bay.end_station, -1.0)):
                marks += (station + sign * bay.taper_length * _TAPER_ROWS).tolist()
        for level in side.kerb_levels:
            for station, sign in ((level.start_station, 1.0), (level.end_station, -1.0)):
                marks += [station, station + sign * level.ramp_length]
        return marks

    def fields(self, station: Float) -> StreetFields:
        """Return widths and heights at stations (N,), m."""
        side = self.side
        to_end = np.maximum(np.minimum(station - side.start_station, side.end_station - station), 0.0)
        kerb_share, footway_share = (np.minimum(to_end / length, 1.0) for length in (KERB_END, side.transition_length))
        usual_height = side.kerb_height * np.clip((to_end - KERB_END) / self._end_ramp, 0.0, 1.0)
        height = usual_height
        for level in side.kerb_levels:
            to_level_end = np.minimum(station - level.start_station, level.end_station - station)
            share = np.clip(to_level_end / level.ramp_length, 0.0, 1.0)
            height = height + share * (level.height - side.kerb_height)
        bay_width = np.zeros(station.shape)
        for bay in side.bays:
            to_bay_end = np.minimum(station - bay.start_station, bay.end_station - station)
            bay_width = bay_width + bay.width * np.clip(to_bay_end / bay.taper_length, 0.0, 1.0)
        face = side.kerb_batter * height
        widths = {
            "gutter": side.gutter_width * kerb_share,
            "parking_bay": bay_width,
            "kerb_face": face,
            "kerb": side.kerb_width * kerb_share - face,
            "footway": side.footway_width * footway_share - bay_width,
        }
        rises = side.crossfall_percent / 100.0 * np.cumsum([widths[kind] for kind in BEYOND_PLANE], axis=0)
        above_kerb = (np.zeros(station.shape), height, height, np.maximum(height, usual_height))
        lifts = {kind: rise + added for kind, rise, added in zip(BEYOND_PLANE, rises, above_kerb, strict=True)}
        verge_extra = footway_share * (side.verge_width - width_at(self._verge_width, station))
        return StreetFields(widths, lifts, verge_extra)

    @property
    def _end_ramp(self) -> float:
        """Return the length over which the kerb comes to its height at an end, m: no longer than the transition."""
        return min(END_RAMP, self.side.transition_length - KERB_END)
