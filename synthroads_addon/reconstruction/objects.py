"""Objects along the road, and the ground beside it, from what stands and lies outside of the pavement.

Barriers are linear clusters, delineators small ones. Their classes say what; if the class only says that something
stands there, its shape does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..base.arrays import Bool, Float, Index
from ..road.things import guardrail as sizes
from .cloud import STANDING, PointKind, RoadCloud
from .path import SPACING, CloudPath
from .profiles import STRETCH, Profiles
from .section import MeasuredSection
from .smoothing import mean_with_std

BarrierKind = Literal["guardrail", "concrete", "noise"]

CELL_ALONG, CELL_ACROSS = 1.0, 0.1
"""Cells in which barriers are looked for, m. Chosen: a metre holds points of most scanners; across as of the
profiles."""
SHORTEST_BARRIER = 8.0
"""Shorter linear clusters, m, are no barriers. Chosen: cars are shorter."""
_HOLE = 8
"""Cells along a barrier that may be empty. Chosen: as hidden behind a lorry."""
_JOIN = 0.15
"""Distance across that the cells of one barrier may lie apart, m. Chosen: beam and post."""
_STEP = 0.25
"""Change of a barrier's offset from which on it goes on as another one, m. Chosen: more than single stretches
scatter."""
_STRETCH = 5.0
"""Length of the stretches whose median is a barrier's offset, m. Chosen: as of the profiles."""
_FEWEST_OF_BARRIER = 10
"""Points of a barrier at least. Chosen: one on each metre."""
_POST_APART = 0.4
"""Distance of points that belong to one post at most, m. Chosen: posts have more to the next thing."""
_FEWEST_OF_POST = 2
"""Points of a post at least. Chosen: single points are stray ones."""
_POST_WIDEST = 0.7
"""Width of a post's points from side to side at most, m. Chosen: a post, and position errors of strips."""
_POST_HEIGHTS = {PointKind.POST: (0.1, 2.0), PointKind.FURNITURE: (0.45, 1.3)}
"""Least and largest height of a post's highest point by class, m. Chosen: classes are believed; what has none must be
as high as a delineator."""
USUAL_POST = 1.0
"""Height of a delineator, m: the highest of a few points on it lies lower. Chosen: about a metre, as usual."""
_BARRIER_HEIGHTS = (0.25, 1.6)
"""Least and largest height of a guardrail of unknown class, m. Chosen: kerbs are lower, walls higher."""
_NOISE_FROM = 1.6
"""Height from which on a wall is a noise barrier where the class doesn't tell, m. Chosen: no guardrail is as high."""
_ALONE = 0.8
"""Distance around a post of unknown class in which nothing else may stand, m. Chosen: bushes and signs have
neighbours."""
_BEAM = sizes.POST[0] / 2.0 + 0.5 * max(point[0] for point in sizes.BEAM)
"""Distance of a beam's seen face from a guardrail's axis, m, by the guardrail's own sizes."""
USUAL_VERGE = 1.5
"""Width of the verge where classes don't tell, m. As in the standard cross-sections."""
_FARTHEST, _FARTHEST_UNKNOWN = 12.0, 4.0
"""Distances outside of the pavement at most, m, of what has a class and what hasn't. Chosen: noise barriers stand
within the first; beyond the second what has no class is mostly vegetation."""
_IN_THE_MIDDLE = 0.4
"""Distance from the axis at which a guardrail has a beam on either side, m. Chosen: half of a double guardrail's
width."""
_BEYOND = 4.0
"""Distance outside of the verge from which on the ground no longer is the road's, m. Chosen: a ditch's width."""


@dataclass(frozen=True)
class StandingPoints:
    """N points on what stands beside the road, in the road's frame.

    Attributes:
        station, offset: (N,) m.
        height: (N,) above the road's surface or the ground, m.
        kind: (N,) of `PointKind`.
    """

    station: Float
    offset: Float
    height: Float
    kind: NDArray[np.uint8]

    def select(self, mask: Bool | Index) -> StandingPoints:
        """Return the points that a mask (N,) or indices choose."""
        return StandingPoints(self.station[mask], self.offset[mask], self.height[mask], self.kind[mask])


@dataclass(frozen=True)
class FoundBarrier:
    """A barrier found in the cloud.

    Attributes:
        kind: guardrail, concrete barrier or noise barrier.
        start, end: stations of its ends, m.
        offset: of its axis, m.
        height: m.
        faces: side on which a guardrail has its beam.
        offset_std: standard deviation of the offset, m.
        points: number of points on it.
    """

    kind: BarrierKind
    start: float
    end: float
    offset: float
    height: float
    faces: Literal["left", "right", "both"]
    offset_std: float
    points: int


@dataclass(frozen=True)
class FoundPost:
    """A delineator found in the cloud: station, offset, height and standard deviation of its place, m; point count."""

    station: float
    offset: float
    height: float
    std: float
    points: int


@dataclass(frozen=True)
class GroundShape:
    """Shape of the ground beside the road.

    Attributes:
        half_width: distance from the axis to which ground is seen, m.
        embankment_height: height of the axis above the ground beyond the verges, m.
        undulation: standard deviation of that ground's height, m.
        verge_width: m.
        verge_seen: whether the verge's width was measured; if not, it is the usual one.
    """

    half_width: float
    embankment_height: float
    undulation: float
    verge_width: float
    verge_seen: bool


def find_barriers(points: StandingPoints) -> tuple[list[FoundBarrier], Bool]:
    """Return the barriers along the road, and a mask (N,) of the points that lie on barriers."""
    barriers: list[FoundBarrier] = []
    barrier_mask = np.zeros(len(points.station), dtype=bool)
    for kind in (PointKind.GUARDRAIL, PointKind.BARRIER, PointKind.NOISE_BARRIER, PointKind.FURNITURE):
        of_kind = np.flatnonzero(points.kind == kind)
        for members in _linear_clusters(points.station[of_kind], points.offset[of_kind]):
            part = points.select(of_kind[members])
            for piece in _split_at_jumps(part):
                barrier = _barrier(part.select(piece), kind)
                if barrier is not None:
                    barriers.append(barrier)
                    barrier_mask[of_kind[members][piece]] = True
    return sorted(barriers, key=lambda item: (item.start, item.offset)), barrier_mask


def _linear_clusters(station: Float, offset: Float) -> list[Index]:
    """Return the point indices of each cluster of connected cells as long as a barrier; small holes are bridged."""
    if len(station) < _FEWEST_OF_BARRIER:
        return []
    row = np.floor((station - station.min()) / CELL_ALONG).astype(np.int64)
    column = np.floor((offset - offset.min()) / CELL_ACROSS).astype(np.int64)
    reach = round(_JOIN / CELL_ACROSS)
    occupied = np.zeros((row.max() + 2 * _HOLE + 1, column.max() + 2 * reach + 1), dtype=bool)
    occupied[row + _HOLE, column + reach] = True
    # Across first, so that the two faces of a barrier are one; along only holes are closed, as a gap is a gap.
    occupied = ndimage.binary_dilation(occupied, np.ones((1, 2 * reach + 1)))
    occupied = ndimage.binary_closing(occupied, np.ones((_HOLE, 1)))
    label, count = ndimage.label(occupied, np.ones((3, 3)))
    cluster = label[row + _HOLE, column + reach]
    groups = [np.flatnonzero(cluster == number) for number in range(1, count + 1)]
    return [g for g in groups if len(g) >= _FEWEST_OF_BARRIER and np.ptp(station[g]) >= SHORTEST_BARRIER]


def _split_at_jumps(part: StandingPoints) -> list[Bool]:
    """Return masks (N,) of the pieces of a linear cluster, split where its median offset jumps by more than `_STEP`."""
    index = np.floor((part.station - part.station.min()) / _STRETCH).astype(np.int64)
    order = np.argsort(index, kind="stable")
    begins = np.searchsorted(index[order], np.arange(index.max() + 1))
    middles = [np.median(part.offset[o]) if len(o) else np.nan for o in np.split(order, begins[1:])]
    owner = np.zeros(len(middles), dtype=np.int64)
    members: list[float] = []
    for number, middle in enumerate(middles):
        if members and np.isfinite(middle) and abs(middle - np.median(members)) > _STEP:
            members, owner[number:] = [], owner[number - 1] + 1
        if np.isfinite(middle):
            members.append(float(middle))
    return [owner[index] == piece for piece in range(int(owner.max()) + 1)]


def _barrier(part: StandingPoints, kind: PointKind) -> FoundBarrier | None:
    """Return the barrier that a cluster of points shows; None if it has too few, is too short or of another shape."""
    count = len(part.station)
    if count < _FEWEST_OF_BARRIER:
        return None
    # Of many points single ones may lie beyond the barrier's ends: percentiles leave those out.
    start, end = np.percentile(part.station, [0.2, 99.8]) if count > 1000 else (part.station.min(), part.station.max())
    height = float(np.percentile(part.height, 95))
    if end - start < SHORTEST_BARRIER or not 0.2 < height < 12.0:
        return None
    index = np.floor((part.station - start) / _STRETCH).astype(np.int64)
    # The upper part: the lower one is posts, grass and what is hidden behind.
    upper_part = part.height > 0.4 * height
    middles = np.array([np.median(part.offset[upper_part & (index == i)]) for i in np.unique(index[upper_part])])
    offset, std = mean_with_std(middles)
    barrier_kind: BarrierKind = {PointKind.BARRIER: "concrete", PointKind.NOISE_BARRIER: "noise"}.get(kind, "guardrail")  # type: ignore[assignment]
    if kind == PointKind.FURNITURE:
        # Chosen: the upper part of a rail or a wall keeps within 0.35 m across the road; bushes don't.
        if not _BARRIER_HEIGHTS[0] < height or np.std(part.offset[upper_part]) > 0.35:
            return None
        barrier_kind = "noise" if height > _NOISE_FROM else "guardrail"
    return FoundBarrier(barrier_kind, float(start), float(end), offset, height, "both", std, count)


def turn_beam(barrier: FoundBarrier, side: Literal["left", "right", "both"]) -> FoundBarrier:
    """Return a guardrail with its beam on a side, its axis shifted behind the beam, as only the beam is seen."""
    if barrier.kind != "guardrail" or side == "both":
        return barrier
    beam_direction = -1.0 if side == "left" else 1.0
    return replace(barrier, offset=barrier.offset + beam_direction * (_BEAM + sizes.SPACER[side]), faces=side)


def find_posts(points: StandingPoints, barrier_points: Bool) -> list[FoundPost]:
    """Return the delineators: small clusters of their class, or lone ones of their height where classes don't tell.

    Args:
        points: N points.
        barrier_points: (N,) mask of the points that lie on barriers.
    """
    posts: list[FoundPost] = []
    for kind in (PointKind.POST, PointKind.FURNITURE):
        part = points.select((points.kind == kind) & ~barrier_points)
        tree = cKDTree(np.column_stack([points.station, points.offset])) if kind == PointKind.FURNITURE else None
        for members in _clusters(part):
            post = _post(part.select(members), kind)
            if post is not None and (tree is None or _stands_alone(tree, post, len(members))):
                posts.append(post)
    return sorted(posts, key=lambda item: (item.station, item.offset))


def _clusters(part: StandingPoints) -> list[Index]:
    """Return the point indices of each cluster of points linked by distances of at most `_POST_APART`."""
    if not len(part.station):
        return []
    pairs = cKDTree(np.column_stack([part.station, part.offset])).query_pairs(_POST_APART, output_type="ndarray")
    count = len(part.station)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    number, label = connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    return np.split(order, np.searchsorted(label[order], np.arange(1, number)))


def _post(part: StandingPoints, kind: PointKind) -> FoundPost | None:
    """Return the delineator that a cluster of points shows; None if the cluster hasn't a post's size."""
    count = len(part.station)
    top = float(part.height.max())
    least_height, largest_height = _POST_HEIGHTS[kind]
    if count < _FEWEST_OF_POST or not least_height < top < largest_height:
        return None
    if max(np.ptp(part.station), np.ptp(part.offset)) > _POST_WIDEST:
        return None
    # Standard error of a mean of n points: the root mean square of both directions' deviations, over sqrt(n).
    spread = float(np.hypot(part.station.std(), part.offset.std())) / np.sqrt(2.0)
    std = float(np.hypot(spread / np.sqrt(count), 0.02))  # what is seen of a post is one side of it
    return FoundPost(float(np.median(part.station)), float(np.median(part.offset)), max(top, USUAL_POST), std, count)


def _stands_alone(tree: cKDTree, post: FoundPost, count: int) -> bool:
    """Return whether no more standing points lie within `_ALONE` of a post than the ``count`` of its own cluster."""
    around = tree.query_ball_point([post.station, post.offset], _ALONE, return_length=True)
    return bool(around <= count)


def standing_points(cloud: RoadCloud, profiles: Profiles, section: MeasuredSection) -> StandingPoints:
    """Return the standing points within reach of the road, with heights above the surface below them."""
    is_standing, path = cloud.of(*STANDING), profiles.path
    xyz, kind = cloud.xyz[is_standing], cloud.kind[is_standing]
    station, offset = path.project(xyz[:, :2])
    reach = max(_outer(section, 1), _outer(section, -1)) + _FARTHEST
    in_reach = (station > -5.0) & (station < path.length + 5.0) & (np.abs(offset) < reach)
    station, offset, kind, height = station[in_reach], offset[in_reach], kind[in_reach], xyz[in_reach, 2]
    edge_distance = np.where(offset > 0.0, offset - _outer(section, 1), -offset - _outer(section, -1))
    is_plausible = (edge_distance < _FARTHEST_UNKNOWN) | (kind != PointKind.FURNITURE)
    station = station[is_plausible]
    offset = offset[is_plausible]
    kind = kind[is_plausible]
    height = height[is_plausible]
    return StandingPoints(station, offset, height - profiles.surface_height(station, offset), kind)


def face_guardrails(barriers: list[FoundBarrier], section: MeasuredSection) -> list[FoundBarrier]:
    """Return the barriers, each guardrail with its beam towards the traffic, or on both sides near the axis."""
    return [turn_beam(barrier, _face(barrier.offset, section)) for barrier in barriers]


def _face(offset: float, section: MeasuredSection) -> Literal["left", "right", "both"]:
    """Return the side of a guardrail at an offset, m, that faces traffic: outwards in a median, else inwards."""
    side = section.sides["left" if offset > 0.0 else "right"]
    if abs(offset) <= side.inner_offset.value:
        if abs(offset) < _IN_THE_MIDDLE:
            return "both"
        return "left" if offset > 0.0 else "right"
    return "right" if offset > 0.0 else "left"


def measure_ground(cloud: RoadCloud, path: CloudPath, section: MeasuredSection, axis_height: Float) -> GroundShape:
    """Return the shape of the ground beside the road; usual values stand in where the cloud doesn't show it.

    Args:
        cloud: all points that were read, with or without ground beyond the verges.
        path: the alignment as a path.
        section: the road's measured cross-section.
        axis_height: (M,) height of the axis at each point of the path, m.
    """
    ground_points = np.flatnonzero(cloud.of(PointKind.GROUND, PointKind.VERGE))
    # Chosen: 300,000 points tell the ground's shape, and as few as 200 a verge's width or the ground beyond it.
    ground_points = ground_points[:: max(1, len(ground_points) // 300_000)]
    station, offset = path.project(cloud.xyz[ground_points, :2])
    on_road_length = (station > 0.0) & (station < path.length)
    ground_points, station, offset = ground_points[on_road_length], station[on_road_length], offset[on_road_length]
    edge_distance = np.where(offset > 0.0, offset - _outer(section, 1), -offset - _outer(section, -1))
    at_usual_edge = _is_beside_usual_edge(section, station, offset)
    verge = edge_distance[(cloud.kind[ground_points] == PointKind.VERGE) & (edge_distance > 0.1) & at_usual_edge]
    verge_seen = len(verge) > 200
    # Chosen: 3 % of the points may be wrongly classified; verges are 0.5 to 5 m wide.
    width = float(np.clip(np.percentile(verge, 97), 0.5, 5.0)) if verge_seen else USUAL_VERGE
    beyond_verge = edge_distance > width + _BEYOND
    outermost = max(_outer(section, 1), _outer(section, -1)) + width
    if beyond_verge.sum() < 200:
        # Chosen: flat ground for 10 m, with 5 cm of unevenness.
        return GroundShape(outermost + 10.0, 0.0, 0.05, width, verge_seen)
    # How far the ground lies below the axis at the same station.
    depth = (
        axis_height[np.clip(station[beyond_verge].astype(np.int64), 0, len(axis_height) - 1)]
        - cloud.xyz[ground_points[beyond_verge], 2]
    )
    # Percentiles keep stray points out; 16 and 84 % lie one deviation below and above a normal distribution's mean.
    reach = float(np.percentile(np.abs(offset[beyond_verge]), 99))
    spread = float(np.clip(0.5 * (np.percentile(depth, 84) - np.percentile(depth, 16)), 0.05, 2.0))
    return GroundShape(max(reach, outermost + 5.0), float(np.median(depth)), spread, width, verge_seen)


def _is_beside_usual_edge(section: MeasuredSection, station: Float, offset: Float) -> Bool:
    """Return a mask (N,) of places beside which the pavement's edge is the road's, not a turnout's."""
    result = np.zeros(len(station), dtype=bool)
    for side in section.sides.values():
        stretch = np.clip((station / (STRETCH * SPACING)).astype(np.int64), 0, len(side.usual) - 1)
        result |= (offset * side.sign > 0.0) & side.usual[stretch]
    return result


def _outer(section: MeasuredSection, sign: int) -> float:
    """Return the distance of one side's outer paved edge from the axis, m."""
    side = section.sides["left" if sign > 0 else "right"]
    return side.inner_offset.value + side.paved_width.value
