"""One carriageway's cross-section at any station: its strips and how far from the centreline their boundaries lie."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Float, without_repeats
from .objects import nominal_width, width_at, width_kinks
from .section import Carriageway, Pavement, Turnout
from .streets.street_geometry import BEYOND_PLANE, STREET_STRIPS, StreetFields, StreetShape
from .streets.street_side import StreetSide
from .turnout_geometry import TURNOUT_STRIPS, RampSurface, TurnoutShape, ramp_width

_BESIDE = (*TURNOUT_STRIPS, *STREET_STRIPS, "verge")
"""Strips outside of the carriageway's own pavement."""
_ROUNDING = 1e-6
"""Length (m) by which a place is looked for beyond a damage's end, which rounding may have moved."""


@dataclass(frozen=True)
class RampFields:
    """By how much a ramp leaves the pavement's plane, by station (N,).

    Attributes:
        width: of the ramp, from where it leaves the plane to the pavement's edge, m.
        lift: height above the plane there, m.
        tilt: how much more it rises outwards than the plane, up to the pavement's edge, m/m.
    """

    width: Float
    lift: Float
    tilt: Float


class CarriagewaySection:
    """A carriageway with its turnouts or street sides, as strips whose widths follow the station.

    Distances are horizontal, from the centreline outwards, so that ``carriageway.sign * distance`` is the offset.

    Attributes:
        carriageway: the carriageway.
        turnouts: the shapes of its turnouts.
        streets: the shapes of its street sides; it has turnouts or street sides, never both.
        kinds: kinds of its strips, innermost first. Strips that are nowhere wider than 0 are left out.
    """

    def __init__(
        self,
        carriageway: Carriageway,
        turnouts: Iterable[Turnout] = (),
        streets: Iterable[StreetSide] = (),
        joined: Collection[int] = (),
    ) -> None:
        """Prepare the section; `joined` has the instance numbers of turnouts whose ramps go on as roads."""
        self.carriageway = carriageway
        self.streets = tuple(StreetShape(street, carriageway.verge_width) for street in streets)
        self.turnouts = tuple(TurnoutShape(turnout, carriageway, turnout.instance in joined) for turnout in turnouts)
        self._first_stations, self._last_stations = (
            np.array([shape.range() for shape in self.turnouts]).reshape(-1, 2).T
        )
        widths = [
            ("inner_edge_strip", carriageway.inner_edge_strip_width),
            *(("lane", lane.width) for lane in reversed(carriageway.lanes)),
            ("outer_edge_strip", carriageway.outer_edge_strip_width),
            ("hard_shoulder", carriageway.hard_shoulder_width),
            *((kind, 1.0 if self.turnouts else 0.0) for kind in TURNOUT_STRIPS),
            *((kind, 1.0 if self.streets else 0.0) for kind in STREET_STRIPS),
            ("verge", carriageway.verge_width),
        ]
        self._widths = [(kind, width) for kind, width in widths if nominal_width(width) > 0.0 or kind == "verge"]
        self.kinds = tuple(kind for kind, _ in self._widths)
        self._varies = bool(self.turnouts or self.streets or self.kinks())
        self._constant = None if self._varies else self._distances(np.zeros(1))

    @cached_property
    def damage_ranges(self) -> tuple[Float, Float]:
        """The first and the last stations (D,), m, of the pavement's ruts, then its potholes, a micrometre wider."""
        pavement = self.carriageway.pavement
        ranges = [(rut.start_station, rut.end_station) for rut in pavement.ruts]
        ranges += [(hole.station - hole.length / 2.0, hole.station + hole.length / 2.0) for hole in pavement.potholes]
        starts, ends = np.array(ranges, dtype=np.float64).reshape(-1, 2).T
        return starts - _ROUNDING, ends + _ROUNDING

    def with_pavement(self, pavement: Pavement) -> CarriagewaySection:
        """Return a copy with another pavement, on which the strips don't depend."""
        other = copy(self)
        other.__dict__.pop("damage_ranges", None)
        other.carriageway = self.carriageway.model_copy(update={"pavement": pavement})
        return other

    @property
    def constant_distances(self) -> Float | None:
        """Return the (B,) `distances` that hold at every station; None where they differ."""
        return None if self._constant is None else self._constant[0]

    def distances(self, station: ArrayLike) -> Float:
        """Return the (N, B) distances of the strips' boundaries from the centreline at N stations, inner first, m."""
        station = np.atleast_1d(np.asarray(station, dtype=np.float64))
        if self._constant is not None:
            return np.repeat(self._constant, len(station), axis=0)
        distinct_stations, index = without_repeats(station)  # the places of a grid have few stations
        distances = self._distances(distinct_stations)
        return distances if len(distinct_stations) == len(station) else distances[index]

    def paved_edge(self, station: ArrayLike) -> Float:
        """Return the (N,) distances from the centreline of the pavement's outer edge, m, footways included."""
        return self.distances(station)[:, -2]

    def road_edge(self, station: ArrayLike) -> Float:
        """Return the (N,) distances from the centreline of the verge's outer edge, m."""
        return self.distances(station)[:, -1]

    def main_edge(self, station: ArrayLike) -> Float:
        """Return the (N,) distances from the centreline of the pavement's outer edge, m, if nothing lay beside it."""
        station = np.atleast_1d(np.asarray(station, dtype=np.float64))
        inner_offset = width_at(self.carriageway.inner_offset, station)
        widths = [width for kind, width in self._widths if kind not in _BESIDE]
        return inner_offset + sum(width_at(width, station) for width in widths)

    def verge_beside(self, station: Float) -> Float:
        """Return the (N,) widths of the verge beside the road itself, m, whatever turnouts add."""
        return width_at(self.carriageway.verge_width, station)

    def pivot(self, station: ArrayLike) -> Float:
        """Return the (N,) distances from the centreline of the line about which the crossfall turns, m."""
        inner_offset = width_at(self.carriageway.inner_offset, np.atleast_1d(station))
        if self.carriageway.rotation_axis == "inner_edge":
            return inner_offset
        if self.carriageway.rotation_axis == "centreline":
            return np.zeros(inner_offset.shape)
        return (inner_offset + self.main_edge(station)) / 2.0

    def lane_boundaries(self, station: ArrayLike) -> Float:
        """Return the (N, lanes + 1) distances from the centreline of the lanes' boundaries, outermost first, m."""
        first_lane = self.kinds.index("lane")
        return self.distances(station)[:, first_lane : first_lane + len(self.carriageway.lanes) + 1][:, ::-1]

    def boundaries_of(self, kind: str, station: ArrayLike) -> tuple[Float, Float]:
        """Return the inner and the outer distances (N,) from the centreline of the one strip of a kind, m."""
        strip_index, distances = self.kinds.index(kind), self.distances(station)
        return distances[:, strip_index], distances[:, strip_index + 1]

    def elevations(self, station: Float, crossfall: Float, distances: Float | None = None) -> Float:
        """Return the (N, B) heights of the strips' boundaries above the profile, innermost first, m.

        Args:
            station: (N,) stations, m.
            crossfall: (N,) crossfall there, m/m, positive where the surface falls to the right.
            distances: (N, B) `distances` there, if they are known.
        """
        distances = self.distances(station) if distances is None else distances
        if self.streets:
            return self._street_elevations(station, crossfall, distances)
        plane_distances = np.minimum(distances, self._plane_edge(station, distances)[:, None])
        # A surface that falls to the right rises with the offset, and the offset is sign * distance outwards.
        outward_slope = self.carriageway.sign * crossfall
        verge_fall = (distances - plane_distances) * self.carriageway.verge_slope_percent / 100.0
        heights = outward_slope[:, None] * (plane_distances - self.pivot(station)[:, None]) - verge_fall
        for surface, tilt, lift_behind in self._ramps(station, outward_slope):
            ramp_start = self._beyond_island
            on_ramp = surface.lift[:, None] + tilt[:, None] * (
                plane_distances[:, ramp_start:] - distances[:, ramp_start, None]
            )
            heights[:, ramp_start:] += surface.presence[:, None] * on_ramp
            heights[:, -1] += lift_behind
        return heights

    def street_fields(self, station: Float) -> StreetFields:
        """Return what the street sides give the strips at stations (N,): widths, heights, the verge's change, m."""
        widths = {kind: np.zeros(station.shape) for kind in STREET_STRIPS}
        lifts = {kind: np.zeros(station.shape) for kind in BEYOND_PLANE}
        verge_extra = np.zeros(station.shape)
        for shape in self._streets_near(station):
            fields = shape.fields(station)
            widths = {kind: width + fields.widths[kind] for kind, width in widths.items()}
            lifts = {kind: lift + fields.lifts[kind] for kind, lift in lifts.items()}
            verge_extra = verge_extra + fields.verge_extra
        return StreetFields(widths, lifts, verge_extra)

    def _street_elevations(self, station: Float, crossfall: Float, distances: Float) -> Float:
        """Return `elevations` of a section with street sides: the plane up to the gutter, then their heights."""
        beyond = self.kinds.index("gutter") + 2
        plane_distances = np.minimum(distances, distances[:, beyond - 1, None])
        heights = self.carriageway.sign * crossfall[:, None] * (plane_distances - self.pivot(station)[:, None])
        lifts = self.street_fields(station).lifts
        heights[:, beyond:-1] += np.column_stack([lifts[kind] for kind in BEYOND_PLANE])
        verge_width = distances[:, -1] - distances[:, -2]
        heights[:, -1] = heights[:, -2] - verge_width * self.carriageway.verge_slope_percent / 100.0
        return heights

    def _streets_near(self, station: Float) -> list[StreetShape]:
        """Return the street sides that may change a width at any station (N,)."""
        return [shape for shape in self.streets if len(station) and shape.reaches(station)]

    def ramp_fields(self, station: Float, crossfall: Float) -> RampFields:
        """Return by how much `elevations` leave the pavement's plane at stations (N,), m, by the crossfall (N,) there.

        In the step at a ramp's end they are those of either end of it.
        """
        distances, outward_slope = self.distances(station), self.carriageway.sign * crossfall
        fields = RampFields(*(np.zeros(station.shape) for _ in range(3)))
        for surface, tilt, lift_behind in self._ramps(station, outward_slope):
            is_behind_ramp = surface.presence < 0.5
            width = np.where(
                is_behind_ramp, 0.0, self._plane_edge(station, distances) - distances[:, self._beyond_island]
            )
            lift = np.where(is_behind_ramp, lift_behind, surface.lift)
            is_of_ramp = np.where(
                is_behind_ramp, surface.verge_share > 0.0, (surface.lift != 0.0) | (surface.crossfall_share > 0.0)
            )
            fields = RampFields(
                np.where(is_of_ramp, width, fields.width),
                np.where(is_of_ramp, lift, fields.lift),
                np.where(is_of_ramp & ~is_behind_ramp, tilt, fields.tilt),
            )
        return fields

    def _ramps(self, station: Float, outward_slope: Float) -> Iterator[tuple[RampSurface, Float, Float]]:
        """Yield of each ramp near that leaves the pavement's plane how it lies, its tilt, and its verge's lift behind.

        Args:
            station: (N,) stations, m.
            outward_slope: (N,) how much the plane rises outwards there, m/m. The tilt (N,), m/m, is what the ramp rises
                more; the lift (N,), m, is that of the verge's outer edge behind the ramp's end.
        """
        for shape in self._turnouts_near(station):
            ramp, surface = shape.turnout.ramp, shape.ramp_surface(station)
            if ramp is not None and surface is not None:
                tilt = surface.crossfall_share * (
                    self.carriageway.sign * (ramp.crossfall_percent or 0.0) / 100.0 - outward_slope
                )
                lift_behind = surface.lift + tilt * ramp_width(ramp)
                if shape.joined:
                    # At the ramp's end the verge is a part of the island, which is even from shoulder to ramp.
                    slope = outward_slope + surface.lift / max(shape.gap_at_end(), 1e-9)
                    fall = self.carriageway.verge_slope_percent / 100.0
                    lift_behind = self.verge_beside(station) * (slope + fall)
                yield surface, tilt, surface.verge_share * lift_behind

    def _turnouts_near(self, station: Float) -> list[TurnoutShape]:
        """Return the turnouts that may change a width at any station (N,); of a long road's many only a few are."""
        if not self.turnouts or not len(station):
            return []
        # As a negation, so that a NaN among the stations, with which all comparisons are false, is near all turnouts.
        is_near = ~((self._first_stations > station.max()) | (self._last_stations < station.min()))
        return [self.turnouts[number] for number in np.flatnonzero(is_near) if self.turnouts[number].reaches(station)]

    @property
    def _beyond_island(self) -> int:
        """Return the index of the boundary at which ramps begin."""
        return self.kinds.index("island") + 1

    def _plane_edge(self, station: Float, distances: Float) -> Float:
        """Return the distances (N,), m, up to which the surface lies in the pavement's plane; beyond the verge falls.

        Only behind a ramp's end is it not the pavement's edge.
        """
        verge_extras = [shape.widths(station).verge_extra for shape in self._turnouts_near(station)]
        return np.asarray(sum(verge_extras, distances[:, -2]))

    def kinks(self) -> list[float]:
        """Return the stations (m, unsorted) at which the rate of change of a strip's width jumps."""
        kinks = [width_kinks(width) for width in (self.carriageway.inner_offset, *(w for _, w in self._widths))]
        kinks += [shape.kinks() for shape in self.turnouts]
        kinks += [shape.kinks() for shape in self.streets]
        return [station for stations in kinks for station in stations]

    def steps(self) -> list[tuple[float, float]]:
        """Return the (lowest, highest) stations, m, of the few centimetres over which the pavement's width jumps."""
        return [step for shape in self.turnouts for step in shape.steps()]

    def ramp_bend(self, station: Float) -> Float:
        """Return the second derivative (N,) by station of a ramp's height above the pavement's plane, 1/m."""
        return sum((shape.ramp_bend(station) for shape in self.turnouts), np.zeros(station.shape))

    def bend(self, station: Float) -> Float:
        """Return the largest second derivative (N,) of a boundary's distance by station, 1/m."""
        return sum((shape.bend(station) for shape in self.turnouts), np.zeros(station.shape))

    def _distances(self, station: Float) -> Float:
        """Return the (N, B) `distances` at stations (N,), m: the sums of the strips' widths from the inside out.

        Beside turnouts the hard shoulder gives way, and behind a ramp's end the verge is wider; beside a footway it has
        a width of its own.
        """
        shapes = [shape.widths(station) for shape in self._turnouts_near(station)]
        street = self.street_fields(station) if self.streets else None
        columns = [width_at(self.carriageway.inner_offset, station)]
        for kind, width in self._widths:
            if kind in TURNOUT_STRIPS:
                columns.append(sum((shape.strips[kind] for shape in shapes), np.zeros(station.shape)))
                continue
            if street and kind in STREET_STRIPS:
                columns.append(street.widths[kind])
                continue
            column = width_at(width, station)
            if kind == "hard_shoulder":
                column = np.minimum.reduce([column, *(shape.hard_shoulder for shape in shapes)])
                column = sum((shape.shoulder_extra for shape in shapes), column)
            elif kind == "verge":
                column = sum((shape.verge_extra for shape in shapes), column)
                column = column + street.verge_extra if street else column
            columns.append(column)
        return np.cumsum(np.column_stack(columns), axis=1)
