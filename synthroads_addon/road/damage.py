"""Damage of a pavement as exact geometry: how deep the surface lies below the undamaged one."""

from collections.abc import Iterator

import numpy as np

from ..base.arrays import Float, Int
from .section import Overlay, Pavement, Pothole, Rut, Settlement, SurfaceShape
from .section_geometry import CarriagewaySection

_SLIVER = 2e-4
"""Columns of a mesh are at least this share of a strip's width apart: below a millimetre."""


_WORTH_SORTING = 20
"""Ruts and potholes from which on the places near each are looked up among sorted ones."""
_SHALLOW = 1e-6
"""Depth (m) up to which a place is undamaged: a cosine is never quite 0."""


DAMAGES = (
    "none",
    "rut",
    "pothole",
    "patch",
    "longitudinal crack",
    "transverse crack",
    "alligator cracks",
    "sealed longitudinal crack",
    "sealed transverse crack",
    "sealed alligator cracks",
    "removed marking",
)
"""Kinds of damage by their number in the per-point layer ``damage``."""


def damage_numbers(pavement: Pavement) -> list[int]:
    """Return the index in `DAMAGES` of each of a pavement's damages: ruts, potholes, patches, cracks, old markings."""
    numbers = [1] * len(pavement.ruts) + [2] * len(pavement.potholes) + [3] * len(pavement.patches)
    first_crack = DAMAGES.index("longitudinal crack")
    kinds = ("longitudinal", "transverse", "alligator")
    numbers += [first_crack + kinds.index(crack.kind) + len(kinds) * crack.sealed for crack in pavement.cracks]
    return numbers + [DAMAGES.index("removed marking")] * len(pavement.removed_markings)


def damage_depth(section: CarriagewaySection, station: Float, offset: Float) -> Float:
    """Return the depth (N,) of the surface below the pavement as it was built, at stations and offsets (N,), m.

    Of ruts and potholes the deepest counts where several are. Settlements add to them; new courses lie on all of it,
    so that the depth is negative where there is nothing but one.
    """
    depth = np.zeros(station.shape)
    for _, places, depths in _damage_depths(section, station, offset):
        depth[places] = np.maximum(depth[places], depths)
    for basin in section.carriageway.pavement.settlements or ():
        depth += settlement_depth(basin, station, offset)
    for course in section.carriageway.pavement.overlays or ():
        depth -= overlay_height(course, section.carriageway.sign, station, offset)
    return depth


def settlement_depth(basin: Settlement, station: Float, offset: Float) -> Float:
    """Return a settlement's depth (N,), m, at stations and offsets (N,): see `Settlement`; 0 outside."""
    along = np.minimum(np.abs(station - basin.station) / basin.length, 0.5)
    across = np.minimum(np.abs(offset - basin.offset) / basin.width, 0.5)
    return np.asarray(basin.depth * np.cos(np.pi * along) ** 2 * np.cos(np.pi * across) ** 2)


def overlay_height(course: Overlay, sign: int, station: Float, offset: Float) -> Float:
    """Return how much higher (N,), m, a new course makes the surface at stations and offsets (N,).

    Args:
        course: on the pavement.
        sign: of its carriageway's offsets.
        station, offset: m.
    """
    ramp = max(min(course.ramp_length, (course.end_station - course.start_station) / 2.0), _SHALLOW)
    along = np.minimum(station - course.start_station, course.end_station - station) / ramp
    distance = sign * offset
    across = np.minimum(distance - course.inner, course.outer - distance) / course.taper
    return np.asarray(course.thickness * np.clip(along, 0.0, 1.0) * np.clip(across, 0.0, 1.0))


def deepest_damage(section: CarriagewaySection, station: Float, offset: Float) -> Int:
    """Return the index (N,) of the deepest rut or pothole, ruts counted first, at stations and offsets (N,); -1: none.

    Of two that are as deep the first counts.
    """
    depth_so_far, result = np.full(station.shape, _SHALLOW), np.full(station.shape, -1, dtype=np.int64)
    for number, places, depths in _damage_depths(section, station, offset):
        deeper_places = places[depths > depth_so_far[places]]
        result[deeper_places] = number
        depth_so_far[places] = np.maximum(depth_so_far[places], depths)
    return result


def _damage_depths(section: CarriagewaySection, station: Float, offset: Float) -> Iterator[tuple[int, Int, Float]]:
    """Yield of each rut and pothole that places lie along its number, ruts first, their indices (K,) and depths, m.

    Only damages between the first and the last place (N,) are looked at: a road may have thousands.
    """
    pavement = section.carriageway.pavement
    if not len(station) or not (pavement.ruts or pavement.potholes):
        return
    starts, ends = section.damage_ranges
    candidates = np.flatnonzero((starts <= np.nanmax(station)) & (ends >= np.nanmin(station))).tolist()
    places = _Along(station, len(candidates))
    for number in candidates:
        indices = places.between(starts[number], ends[number])
        if number < len(pavement.ruts):
            rut = pavement.ruts[number]
            indices = indices[(station[indices] > rut.start_station) & (station[indices] < rut.end_station)]
            yield (
                number,
                indices,
                _rut_depth(section, rut, station[indices], offset[indices]) if len(indices) else np.empty(0),
            )
        else:
            pothole = pavement.potholes[number - len(pavement.ruts)]
            indices = indices[np.abs(station[indices] - pothole.station) < pothole.length / 2.0]
            yield number, indices, _pothole_depth(pothole, station[indices], offset[indices])


class _Along:
    """Places by their stations (N,): those of a stretch are found without a look at the others.

    Args:
        station: (N,) of the places, m, in any order.
        times: how many stretches will be asked for; for a few it isn't worth the sorting.
    """

    def __init__(self, station: Float, times: int) -> None:
        self._station = station
        self._order: Int | None = None
        self._sorted: Float | None = None
        if times and (station[1:] >= station[:-1]).all():
            self._sorted = station
        elif times > _WORTH_SORTING:
            self._order = np.argsort(station, kind="stable")
            self._sorted = station[self._order]

    def between(self, start: float, end: float) -> Int:
        """Return the indices (K,) of the places from a start to an end, m, both included."""
        if self._sorted is None:
            return np.flatnonzero((self._station >= start) & (self._station <= end))
        begin, stop = np.searchsorted(self._sorted, start), np.searchsorted(self._sorted, end, "right")
        return np.arange(begin, stop) if self._order is None else self._order[begin:stop]


def _rut_depth(section: CarriagewaySection, rut: Rut, station: Float, offset: Float) -> Float:
    """Return a rut's depth (N,), m: cosine squared across each wheel track, eased in and out along the ramps."""
    if not _has_lane(section, rut):
        return np.zeros(station.shape)
    boundaries = section.lane_boundaries(station)
    middle = (boundaries[:, rut.lane] + boundaries[:, rut.lane + 1]) / 2.0
    distance_from_middle = np.abs(section.carriageway.sign * offset - middle)
    distance_from_track = np.minimum(np.abs(distance_from_middle - rut.track / 2.0), rut.width / 2.0)
    ramp_share = np.minimum(station - rut.start_station, rut.end_station - station) / rut.ramp_length
    depth_share = 0.5 - 0.5 * np.cos(np.pi * np.clip(ramp_share, 0.0, 1.0))
    return rut.depth * depth_share * np.cos(np.pi * distance_from_track / rut.width) ** 2


def _pothole_depth(pothole: Pothole, station: Float, offset: Float) -> Float:
    """Return a pothole's depth (N,), m: an elliptic paraboloid, depth (1 - x^2 - y^2) in units of its half axes."""
    relative_station = (station - pothole.station) / (pothole.length / 2.0)
    relative_offset = (offset - pothole.offset) / (pothole.width / 2.0)
    return pothole.depth * np.maximum(1.0 - relative_station**2 - relative_offset**2, 0.0)


def shape_height(section: CarriagewaySection, item: SurfaceShape, station: Float, offset: Float) -> Float:
    """Return how much (N,), m, one thing alone raises the surface at stations and offsets (N,); lowered: negative."""
    if isinstance(item, Settlement):
        return -settlement_depth(item, station, offset)
    if isinstance(item, Overlay):
        return overlay_height(item, section.carriageway.sign, station, offset)
    if isinstance(item, Pothole):
        return -_pothole_depth(item, station, offset)
    within = np.flatnonzero((station > item.start_station) & (station < item.end_station))
    result = np.zeros(station.shape)
    if len(within):
        result[within] = -_rut_depth(section, item, station[within], offset[within])
    return result


def damaged_strips(section: CarriagewaySection) -> list[int]:
    """Return the sorted indices into ``section.kinds`` of the strips whose surface isn't straight across."""
    first_lane, lanes = section.kinds.index("lane"), len(section.carriageway.lanes)
    pavement = section.carriageway.pavement
    strips = {first_lane + lanes - 1 - rut.lane for rut in pavement.ruts if rut.lane < lanes}
    holes: list[Pothole | Settlement] = [*pavement.potholes, *(pavement.settlements or ())]
    for hole in holes:
        strips |= _strips_between(section, hole.station, _pothole_edges(section, hole))
    for course in pavement.overlays or ():
        for station in (course.start_station, course.end_station):
            strips |= _strips_between(section, station, (course.inner, course.outer))
    return sorted(strips)


def _strips_between(section: CarriagewaySection, station: float, edges: tuple[float, float]) -> set[int]:
    """Return the indices of the strips that lie between two distances (m) from the centreline at a station (m)."""
    distances = section.distances(station)[0]
    return set(np.flatnonzero((distances[:-1] < edges[1]) & (distances[1:] > edges[0])).tolist())


def damage_rows(section: CarriagewaySection, tolerance: float) -> list[float]:
    """Return stations (m, unsorted) where a mesh needs rows to follow the surface's form within the tolerance (m)."""
    rows: list[float] = []
    for rut in section.carriageway.pavement.ruts:
        ramp = min(rut.ramp_length, (rut.end_station - rut.start_station) / 2.0)
        steps = np.linspace(0.0, ramp, 2 + _cells_of_cosine(rut.depth, tolerance))
        rows += [*(rut.start_station + steps), *(rut.end_station - steps)]
    for pothole in section.carriageway.pavement.potholes:
        half_length = pothole.length / 2.0
        rows += list(
            pothole.station + np.linspace(-half_length, half_length, 1 + _cells_of_bowl(pothole.depth, tolerance))
        )
    for basin in section.carriageway.pavement.settlements or ():
        steps = np.linspace(-0.5, 0.5, 1 + 2 * _cells_of_cosine(basin.depth, tolerance))
        rows += list(basin.station + basin.length * steps)
    for course in section.carriageway.pavement.overlays or ():
        ramp = min(course.ramp_length, (course.end_station - course.start_station) / 2.0)
        rows += [course.start_station, course.start_station + ramp, course.end_station - ramp, course.end_station]
    return rows


def damage_columns(
    section: CarriagewaySection, strip: int, tolerance: float, start: float = -np.inf, end: float = np.inf
) -> Float:
    """Return the sorted (K,) shares of a strip's width, 0 its inner and 1 its outer edge, that a mesh needs for damage.

    Args:
        section: of a carriageway.
        strip: index into ``section.kinds``.
        tolerance: largest distance from the surface, m.
        start, end: stations (m) between which damage counts.
    """
    shares = [np.array([0.0, 1.0])]
    for rut in section.carriageway.pavement.ruts:
        if rut.start_station > end or rut.end_station < start:
            continue
        middle_station = (rut.start_station + rut.end_station) / 2.0
        middle = (
            section.lane_boundaries(middle_station)[0, rut.lane : rut.lane + 2].mean()
            if _has_lane(section, rut)
            else 0.0
        )
        distances_from_track = np.linspace(-0.5, 0.5, 1 + 2 * _cells_of_cosine(rut.depth, tolerance)) * rut.width
        for track in (-rut.track / 2.0, rut.track / 2.0):
            shares.append(_shares(section, strip, middle_station, middle + track + distances_from_track))
    for pothole in section.carriageway.pavement.potholes:
        if not start <= pothole.station <= end:
            continue
        inner_edge, outer_edge = _pothole_edges(section, pothole)
        cells = _cells_of_bowl(pothole.depth, tolerance)
        shares.append(_shares(section, strip, pothole.station, np.linspace(inner_edge, outer_edge, cells + 1)))
    shares += _shares_of_epochs(section, strip, tolerance, (start, end))
    all_shares = np.unique(np.concatenate(shares))
    inside = all_shares[(all_shares >= 0.0) & (all_shares <= 1.0)]
    return space_shares(inside)


def _shares_of_epochs(
    section: CarriagewaySection, strip: int, tolerance: float, stretch: tuple[float, float]
) -> list[Float]:
    """Return the shares of a strip's width that settlements and new courses on a stretch (m) need; see the above."""
    start, end = stretch
    shares = []
    for basin in section.carriageway.pavement.settlements or ():
        if basin.station + basin.length / 2.0 >= start and basin.station - basin.length / 2.0 <= end:
            inner_edge, outer_edge = _pothole_edges(section, basin)
            columns = np.linspace(inner_edge, outer_edge, 1 + 2 * _cells_of_cosine(basin.depth, tolerance))
            shares.append(_shares(section, strip, basin.station, columns))
    for course in section.carriageway.pavement.overlays or ():
        if course.end_station >= start and course.start_station <= end:
            edges = (course.inner, course.inner + course.taper, course.outer - course.taper, course.outer)
            middle = (course.start_station + course.end_station) / 2.0
            shares.append(_shares(section, strip, middle, np.array(edges)))
    return shares


def space_shares(shares: Float) -> Float:
    """Return sorted shares (K,) of a strip's width without those that make slivers; both ends are kept."""
    spaced_shares = [shares[0]]
    for share in shares[1:-1].tolist():
        if min(share - spaced_shares[-1], shares[-1] - share) > _SLIVER:
            spaced_shares.append(share)
    return np.array([*spaced_shares, shares[-1]])


def _shares(section: CarriagewaySection, strip: int, station: float, distance: Float) -> Float:
    """Return distances (K,) from the centreline, m, as shares of a strip's width at a station, from its inner edge."""
    inner, outer = section.distances(station)[0, strip : strip + 2]
    return (distance - inner) / max(outer - inner, 1e-9)


def _pothole_edges(section: CarriagewaySection, pothole: Pothole | Settlement) -> tuple[float, float]:
    """Return the distances of a bowl's inner and outer edge from the centreline, m, positive outwards."""
    middle = section.carriageway.sign * pothole.offset
    return middle - pothole.width / 2.0, middle + pothole.width / 2.0


def _has_lane(section: CarriagewaySection, rut: Rut) -> bool:
    """Return whether a rut's lane exists on the carriageway."""
    return rut.lane < len(section.carriageway.lanes)


def _cells_of_cosine(depth: float, tolerance: float) -> int:
    """Return how many chords follow half a cosine wave of a depth (m); n are off by depth pi^2 / (16 n^2) at most."""
    return int(np.ceil(np.pi / 4.0 * np.sqrt(depth / (0.5 * tolerance)))) + 1


def _cells_of_bowl(depth: float, tolerance: float) -> int:
    """Return the number of cells across a pothole's bowl that follow it within half the tolerance (m).

    Its slope jumps at the rim by 4 depth / diameter, and cells of a side h across the rim are h / 4 times that off.
    """
    return int(np.ceil(depth / (0.5 * tolerance))) + 2
