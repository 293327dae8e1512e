"""Who stands where beside a road: lateral zones, reserved stretches, and barriers that others have to stand behind.

Outwards from the pavement's edge follow a zone of barriers and delineators, one of small things (signs, posts,
cabinets) and one of noise barriers. Things of different zones cannot meet; things of one zone keep apart along the
road by reserving their stretches before they are built. A thing's distance is known last, when the barriers stand.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from ...base.schema import round_value
from ...road.guidelines import OBSTACLE_LEAD, OBSTACLE_TAIL
from ...road.objects import PointObject, Side, least_width
from ...road.side_roads.mouth import Mouth
from ...road.things.sign import TrafficSign
from .edge import EdgeProfile
from .ranges import Range, Reservations
from .site import PlacementSite
from .village_plan import BESIDE_VILLAGE

BARRIER_AXIS = 0.70
"""From the paved edge to the axis of a guardrail's posts: its face then stands 0.5 m from the pavement, m."""
MEDIAN_BARRIER_HALF = 0.3
"""From the centreline to the sides of the median's single barrier, m at most."""
MEDIAN_OBSTACLE = 0.85
"""From the paved edge to what stands in the median behind a guardrail, m."""
SMALL_ZONE = 1.25
"""From the paved edge to the nearest part of small things, m: behind barriers and delineators."""
FAR_ZONE = 3.0
"""From the paved edge to the nearest part of noise barriers, m: behind the small things."""
SIGNPOST = "signpost"
"""Name of the requests of signposts at the mouths of tracks, which come after the rows of avenues."""
_CLEAR = 1.0
"""Length of the road kept clear beside a mouth's corners, m; chosen."""
_MARGIN = 1.0  # m along the road: barriers reach so much farther than they need to
_CALM = OBSTACLE_LEAD + 2.0 * _MARGIN  # m along the road: nearer to a turnout, an obstacle's barrier might meet it
_BESIDE_BARRIER = 0.5  # m along the road: what stands so near a barrier's end stands behind it
_LEAST_HALF = 1.0  # m along the road: the front is taken over at least so much to either side of a thing
_ROUNDED = 1e-6  # m: distances are rounded
_ISLAND_MARGIN = 0.6  # m: to a ramp's inner edge beyond what lies in the island


def mouth_stretch(mouth: Mouth) -> Range:
    """Return the stations (m) between which nothing stands beside the road for a side road's corners and verges."""
    slant = abs(math.tan(math.radians(mouth.side_road.angle_deg - 90.0))) * FAR_ZONE
    return mouth.low.start_station - _CLEAR - slant, mouth.high.start_station + _CLEAR + slant


class BarrierPiece(NamedTuple):
    """A barrier's stretch of road, and the line that its place is counted from.

    Attributes:
        start, end: stations, m.
        base: distance from the centreline from which its place was counted, m; no pavement beside it reaches beyond.
        ramp: it stands beside a gore.
    """

    start: float
    end: float
    base: float
    ramp: bool = False


@dataclass(frozen=True)
class PlacementRequest:
    """A requested thing of the small zone, whose distance from the road is known once the barriers stand.

    Attributes:
        name: first part of its id.
        make: its class.
        station: of its axis, m.
        half: what it takes to either side along the road, m.
        width: what it takes across the road, m.
        fields: its fields but its place.
        shift: how much farther out than it has to it stands, m.
        outer: it stands outside of a ramp, never in the island beside it.
        obstacle: it needs a barrier before it.
        distance: of its axis from the centreline, where that is known, m.
    """

    name: str
    make: type[PointObject]
    station: float
    half: float
    width: float
    fields: dict[str, Any] = field(default_factory=dict)
    shift: float = 0.0
    outer: bool = False
    obstacle: bool = False
    distance: float | None = None


class Roadside:
    """The outer side of one carriageway while it is furnished: what is reserved, requested and built.

    Attributes:
        side, sign, traffic: as in `Carriageway`.
        country: whose signs stand there.
        length: of the road, m.
        edge: the pavement's edge.
        near, far: stretches taken in the zones of small things and of noise barriers.
        mouths: stretches of side roads' mouths and of tunnels, which are taken in every zone.
        villages: stretches of villages, and beside them, in which nothing of the open road stands.
        crossed: stretches that an overpass crosses: no place for what is high.
        turnouts: stretches of turnouts.
        restless: stretches where an obstacle's barrier would meet a turnout, a mouth or a village.
        requests: things of the small zone.
        protected: stretches that need a barrier.
        pieces: the barriers that stand, in order.
        openings: stretches that entrances to fields take, in which nothing stands along the edge.
    """

    def __init__(self, site: PlacementSite, side: Side) -> None:
        carriageway, section = site.carriageways[side], site.sections[side]
        self.side, self.sign, self.traffic = side, carriageway.sign, carriageway.traffic
        self.country = site.guideline.country
        self.length = site.length
        self.edge = EdgeProfile(section, self.length)
        mouths = [mouth_stretch(mouth) for mouth in site.mouths_of(side)]
        taken = [*mouths, *site.bridged, *site.tunnelled]
        # Barriers before obstacles would reach into tunnels that are too near.
        around = [*taken, *((start - _CALM, end + _CALM) for start, end in site.tunnelled)]
        self.near, self.far, self.crossed = Reservations(taken), Reservations(around), Reservations(around)
        if stretch := site.interchange_stretch:
            # Behind the verge lie ramps and their embankments.
            self.far.add(*stretch)
            self.crossed.add(*stretch)
        self.mouths = Reservations([*mouths, *site.tunnelled])
        self.villages = Reservations((v.start - BESIDE_VILLAGE, v.end + BESIDE_VILLAGE) for v in site.villages)
        self.turnouts = Reservations(shape.range() for shape in section.turnouts)
        if site.scenario.overtaking.share:  # where lanes begin and end, barriers have steps as beside turnouts
            for start, end in self.edge.tapers():
                self.turnouts.add(start, end)
        calm_from = [*self.turnouts.stretches, *self.mouths.stretches, *self.villages.stretches]
        self.restless = Reservations((start - _CALM, end + _CALM) for start, end in calm_from)
        self.requests: list[PlacementRequest] = []
        self.protected: list[Range] = []
        self.pieces: list[BarrierPiece] = []
        self.openings: list[Range] = []
        for start, end in site.bridged:
            self.protect(start, end)

    @property
    def facing(self) -> float:
        """Return the rotation (deg) of things that face this carriageway's traffic: 0 or 180."""
        return 0.0 if self.traffic > 0 else 180.0

    @property
    def along_right(self) -> float:
        """Return the rotation (deg) of things that lie to the right of their direction, on this side: 0 or 180.

        It is `facing` where traffic keeps right.
        """
        return 0.0 if self.sign < 0 else 180.0

    @property
    def towards_road(self) -> Side:
        """Return the side, "left" or "right", on which a barrier faces this carriageway."""
        return "right" if self.sign > 0 else "left"

    def ahead(self, station: float, distance: float) -> float:
        """Return the station a distance (m) ahead in the direction of traffic."""
        return station + self.traffic * distance

    def protect(self, start: float, end: float) -> None:
        """Ask for a barrier before an obstacle that stands between two stations (m)."""
        self.protected.append(self._barrier_stretch(start, end))

    def put(self, request: PlacementRequest) -> None:
        """Request a thing: reserve its stretch of the small zone, and ask for a barrier if it is an obstacle."""
        start, end = request.station - request.half, request.station + request.half
        self.near.add(start, end)
        if request.obstacle:
            self.protect(start, end)
        self.requests.append(request)

    def front(self, start: float, end: float, depth: float, outer: bool = False) -> float:
        """Return the distance (m) from the centreline from which zones are counted between two stations.

        It is the largest of the paved edge and of the barriers' bases; beside an island that is deep enough (m) for the
        thing, the main road's.
        """
        nearby_barriers = [
            p for p in self.pieces if p.start - _BESIDE_BARRIER < end and p.end + _BESIDE_BARRIER > start
        ]
        if not outer:
            main_edge = self.edge.largest_main(start, end)
            distance_in_island = max(main_edge, *(p.base for p in nearby_barriers if not p.ramp), 0.0)
            if self.edge.is_clear_beside_main(start, end, distance_in_island - main_edge + depth + _ISLAND_MARGIN):
                return distance_in_island
        return max(self.edge.largest_paved(start, end), *(p.base for p in nearby_barriers), 0.0)

    def front_of_obstacle(self, start: float, end: float, depth: float) -> float:
        """Return `front` (m) for an obstacle: behind all of the barrier before it."""
        barrier_start, barrier_end = self._barrier_stretch(start, end)
        bases = [p.base for p in self.pieces if p.start < barrier_end and p.end > barrier_start and not p.ramp]
        return max(self.front(start, end, depth), *bases, 0.0)

    def is_behind_barriers(self, station: float, half: float, distance: float) -> bool:
        """Return whether a thing stands behind the zone of all barriers beside it.

        Args:
            station: of its axis, m.
            half: what it takes to either side along the road, m.
            distance: of its nearest side from the centreline, m.
        """
        start, end = station - half - _BESIDE_BARRIER, station + half + _BESIDE_BARRIER
        bases = (p.base for p in self.pieces if p.start < end and p.end > start)
        return all(distance >= base + SMALL_ZONE - _ROUNDED for base in bases)

    def objects(self) -> Iterator[tuple[str, PointObject]]:
        """Yield (id, object) of the requested things in the order of their stations, with instance 1."""
        counts: Counter[str] = Counter()
        for request in sorted(self.requests, key=lambda item: item.station):
            counts[request.name] += 1
            station, offset = round_value(request.station), round_value(self.sign * self._distance(request))
            fields = {"rotation_deg": self.facing, **request.fields}
            item = request.make(instance=1, station=station, offset=offset, **fields)
            yield f"{request.name}-{self.side}-{counts[request.name]:03d}", item

    def _distance(self, request: PlacementRequest) -> float:
        """Return the distance (m) of a requested thing's axis from the centreline.

        From the front outwards follow the zone of barriers and delineators, the shift, and the thing's width.
        """
        if request.distance is not None:
            return request.distance
        half_length = max(request.half, _LEAST_HALF)
        start, end = request.station - half_length, request.station + half_length
        depth = SMALL_ZONE + request.width + request.shift
        if request.obstacle:
            front = self.front_of_obstacle(start, end, depth)
        else:
            front = self.front(start, end, depth, request.outer)
        return front + SMALL_ZONE + request.width / 2.0 + request.shift

    def _barrier_stretch(self, start: float, end: float) -> Range:
        """Return the stretch (m) of the barrier before an obstacle that stands between two stations."""
        lead, tail = OBSTACLE_LEAD + _MARGIN, OBSTACLE_TAIL + _MARGIN
        return (start - lead, end + tail) if self.traffic > 0 else (start - tail, end + lead)


@dataclass
class MedianStrip:
    """The median while it is furnished: what is reserved and which signs stand in it.

    Attributes:
        inner: distances of the carriageways' inner edges from the centreline by side, the smallest along the road, m.
        taken: stretches taken by posts, piers and signs.
        has_obstacles: something stands in it that needs a barrier on either side.
        signs: the signs in it.
    """

    inner: dict[Side, float]
    taken: Reservations = field(default_factory=Reservations)
    has_obstacles: bool = False
    signs: list[TrafficSign] = field(default_factory=list)

    @property
    def half_width(self) -> float:
        """Return the distance of the nearer carriageway's inner edge from the centreline, m."""
        return min(self.inner.values())

    @property
    def obstacle_half(self) -> float:
        """Return half the width (m) of what may stand on the centreline between guardrails; below 0 if nothing may."""
        return self.half_width - MEDIAN_OBSTACLE if len(self.inner) > 1 else -1.0


class Layout:
    """A road while it is furnished: both outer sides and the median.

    Attributes:
        site: the road.
        sides: the outer sides of its carriageways.
        median: its median.
    """

    def __init__(self, site: PlacementSite) -> None:
        self.site = site
        self.length = site.length
        self.sides: dict[Side, Roadside] = {side: Roadside(site, side) for side in site.carriageways}
        self.median = MedianStrip({side: least_width(c.inner_offset) for side, c in site.carriageways.items()})
        for start, end in [*site.bridged, *site.tunnelled]:
            self.median.taken.add(start, end)

    def reserve(self, start: float, end: float, sides: Iterable[Side], zones: Iterable[str], in_median: bool) -> None:
        """Reserve a stretch for an obstacle, and ask for barriers before it.

        Args:
            start, end: stations, m.
            sides: of the carriageways beside which it stands.
            zones: that it stands in there: ``near``, ``far``, ``crossed``.
            in_median: whether it stands in the median as well.
        """
        for roadside in (self.sides[side] for side in sides):
            for zone in zones:
                getattr(roadside, zone).add(start, end)
            roadside.protect(start, end)
        if in_median:
            self.median.taken.add(start, end)
            self.median.has_obstacles = True

    @cached_property
    def tight_arcs(self) -> list[tuple[float, float, float]]:
        """Return start and end (m) and curvature (1/m) of the arcs that are tight for the design class."""
        return self._arcs_below(self.site.limits.tight_curve * self.site.limits.radius)

    @property
    def signed_arcs(self) -> list[tuple[float, float, float]]:
        """Return start and end (m) and curvature (1/m) of the arcs that have danger signs before them."""
        radius = self.site.limits.curve_sign_radius
        return self._arcs_below(radius) if radius else self.tight_arcs

    def _arcs_below(self, radius: float) -> list[tuple[float, float, float]]:
        """Return start and end (m) and curvature (1/m) of the arcs below a radius (m); none below 0."""
        arcs: list[tuple[float, float, float]] = []
        start = 0.0
        if radius == 0.0:
            return arcs
        tight_curvature = 1.0 / radius
        for element in self.site.alignment.horizontal:
            if element.kind == "arc" and abs(element.curvature_start) > tight_curvature:
                arcs.append((start, start + element.length, element.curvature_start))
            start += element.length
        return arcs
