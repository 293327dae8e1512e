"""Things beside a carriageway follow its edge where an exit, entry or bay comes or goes.

Barriers are made anew along the new edge, delineators and what stands just behind the edge move with it, and what runs
along the road farther out is opened where the pavement and its verge take its place.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...base.schema import round_value
from ...road.guidelines import BARRIER_DISTANCE, OBSTACLE_LEAD, OBSTACLE_TAIL
from ...road.objects import RoadObject, Side, nominal_width
from ...road.things.beacon import ConstructionBeacon
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.delineator import Delineator
from ...road.things.gantry import Gantry
from ...road.things.guardrail import Guardrail
from ...road.things.noise_barrier import NoiseBarrier
from ...road.things.overpass import Overpass
from ...road.things.temporary_barrier import TemporaryBarrier
from ...road.things.thing import LengthwiseThing, StandingThing, Thing
from ..placing.barriers import JOIN, SHORT_TERMINAL, TERMINAL, barrier_pieces
from ..placing.delineators import delineators
from ..placing.layout import BARRIER_AXIS, FAR_ZONE, SMALL_ZONE, BarrierPiece, Layout, Roadside
from ..placing.ranges import Range, merge_ranges
from .site import free_ids, is_outside, piece_of

_FOLLOWS = 0.6
"""Distance (m) behind the zone of small things up to which things follow the edge. Chosen: posts and cabinets do,
buildings don't."""
_BESIDE = 1.0
"""Room along the road, m, that is kept from where something was opened."""
_BEHIND_VERGE = 0.5
"""From the verge's outer edge to what runs along the road there, m."""
_BEHIND_SMALL = 1.0
"""From the zone of noise barriers to other things along the road, m: cabinets that were moved reach into it. Chosen."""
_SHORTEST_REST = 8.0
"""Shorter rests of what was opened are left out, m."""
_FARTHEST = 99.0
"""Largest offset of things, m, that follow an edge."""
_SAME = 1e-4
"""Distances that differ by less (m) are one."""

_PART = re.compile(r"^(.+-\d+)-\d+$")
"""Id of a part of a barrier that an edge has parted."""

Barrier = Guardrail | ConcreteBarrier


@dataclass
class Furnishing:
    """Furniture beside one carriageway while its edge changes along a stretch.

    Attributes:
        before, now: the road with its old and its new edge.
        side: of the carriageway.
        stretch: stations between which the edge changes, m.
        name: id of the turnout that comes or goes; new things' ids begin with it.
        kind: what it is called in sentences.
        notes: sentences on what was opened, moved and left out.
    """

    before: Layout
    now: Layout
    side: Side
    stretch: Range
    name: str
    kind: str
    notes: list[str] = field(default_factory=list)

    @property
    def _new(self) -> Roadside:
        return self.now.sides[self.side]

    @property
    def _old(self) -> Roadside:
        return self.before.sides[self.side]

    def follow(self, objects: dict[str, RoadObject]) -> dict[str, RoadObject]:
        """Return a road's objects with those beside the carriageway where the new edge has them, and new signs."""
        objects = self._with_opened(self._with_joined(objects) if self._closes else objects)
        self._protect(objects)
        objects = self._with_barriers(objects)
        objects = self._with_delineators(objects)
        result: dict[str, RoadObject] = {}
        for key, item in objects.items():
            if isinstance(item, Gantry):
                result[key] = self._gantry(key, item)
            elif isinstance(item, StandingThing) and self._is_behind(item):
                if moved := self._standing(key, item):
                    result[key] = moved
            else:
                result[key] = item
        for name, sign in self._new.objects():
            words = name.split("-")[0]
            result[free_ids(result, f"{self.name}-{words}")] = sign
        return result

    @property
    def _closes(self) -> bool:
        """Return whether the turnout goes, so that what its edge had parted is one again."""
        return self.name not in self.now.site.turnouts

    def _overlaps(self, start: float, end: float) -> bool:
        return start < self.stretch[1] and end > self.stretch[0]

    def _protect(self, objects: dict[str, RoadObject]) -> None:
        """Ask for barriers before what stands near the stretch and needs one."""
        roadside = self._new
        reach = self.stretch[0] - OBSTACLE_LEAD - JOIN, self.stretch[1] + OBSTACLE_LEAD + JOIN
        for item in objects.values():
            if not isinstance(item, Thing) or not (item.obstacle or isinstance(item, NoiseBarrier)):
                continue
            start, end = _ends(item)
            if isinstance(item, Overpass) or end < reach[0] or start > reach[1]:
                continue
            is_beside = is_outside(item, self.before.site, self.side)
            if (isinstance(item, Gantry) and self._outer_post(item)) or (is_beside and self._had_barrier(start, end)):
                roadside.protect(start, end)

    def _had_barrier(self, start: float, end: float) -> bool:
        return any(piece.start < end and piece.end > start for piece in self._old.pieces)

    @staticmethod
    def _has_barrier(roadside: Roadside, item: StandingThing, near: float) -> bool:
        """Return whether barriers stand before an obstacle, whose nearest part is so far out (m), as far as needed."""
        start, end = _ends(item)
        lead, tail = (OBSTACLE_LEAD, OBSTACLE_TAIL) if roadside.traffic > 0 else (OBSTACLE_TAIL, OBSTACLE_LEAD)
        low, high = max(0.0, start - lead), min(roadside.length, end + tail)
        before = ((piece.start, piece.end) for piece in roadside.pieces if piece.base < near - BARRIER_AXIS)
        return any(first <= low + _SAME and last >= high - _SAME for first, last in merge_ranges(before, _SAME))

    def _loses_barrier(self, item: StandingThing, was: float, being: float) -> bool:
        """Return whether an obstacle had all of its barrier, and lost it; its nearest part was, and is, so far out."""
        return self._has_barrier(self._old, item, was) and not self._has_barrier(self._new, item, being)

    # --- barriers ----------------------------------------------------------------------------------------------------

    def _with_barriers(self, objects: dict[str, RoadObject]) -> dict[str, RoadObject]:
        """Return objects with the barriers along the new edge, and those before new obstacles."""
        roadside = self._new
        barriers = {
            key: item
            for key, item in objects.items()
            if isinstance(item, Barrier) and is_outside(item, self.before.site, self.side)
        }
        wanted = [self.stretch, *roadside.protected]
        touched = {
            key: item
            for key, item in barriers.items()
            if any(item.start_station < end + JOIN and item.end_station > start - JOIN for start, end in wanted)
        }
        spans = [(item.start_station, item.end_station) for item in touched.values()]
        if self._closes:
            spans += self._parted(touched)
        spans = merge_ranges([*spans, *roadside.protected], JOIN)
        still = [item for key, item in barriers.items() if key not in touched]
        roadside.pieces = [piece_of(item, roadside.sign) for item in still]
        made = list(barrier_pieces(roadside, spans))
        roadside.pieces = sorted([*roadside.pieces, *made])
        new = dict(self._barriers(made, touched, objects))
        result: dict[str, RoadObject] = {}
        for key, item in objects.items():
            if key in new:
                result[key] = new.pop(key)
            elif key not in touched:
                result[key] = item
        return result | new

    def _parted(self, touched: dict[str, Barrier]) -> Iterator[Range]:
        """Yield the stretches (m) of barriers that the edge had parted: their ids differ by a number."""
        families: dict[str, list[Barrier]] = {}
        for key, item in touched.items():
            if self._overlaps(item.start_station - JOIN, item.end_station + JOIN):
                families.setdefault(_PART.sub(r"\1", key), []).append(item)
        for parts in families.values():
            yield min(item.start_station for item in parts), max(item.end_station for item in parts)

    def _barriers(
        self, pieces: list[BarrierPiece], touched: dict[str, Barrier], objects: dict[str, RoadObject]
    ) -> Iterator[tuple[str, Barrier]]:
        """Yield (id, barrier) of pieces, made like the nearest of those that they take the place of."""
        roadside, used = self._new, set[str]()
        borders = {segment.end for segment in roadside.edge.segments[:-1]}
        for piece in pieces:
            middle = (piece.start + piece.end) / 2.0
            by_distance = sorted(touched, key=lambda key: _distance(touched[key], middle))
            model = touched[by_distance[0]] if by_distance else self._usual()
            key = next((key for key in touched if key not in used and _covers(touched[key], piece)), "")
            if not key:
                goes_on = next((key for key in touched if _covers(touched[key], piece)), "")
                words = goes_on or f"{self.name}-{_kind_words(model)}"
                key = free_ids(objects | dict.fromkeys(used, model), words)
            used.add(key)
            foot = model.base_width / 2.0 + BARRIER_DISTANCE if isinstance(model, ConcreteBarrier) else BARRIER_AXIS
            terminal = SHORT_TERMINAL if borders & {piece.start, piece.end} else TERMINAL
            if (model.start_station, model.end_station) == (piece.start, piece.end):
                terminal = model.terminal_length
            if piece.start <= 0.0 and piece.end >= roadside.length:
                terminal = 0.0
            before = self._old.edge.base_at(middle)
            keeps_line = key in touched and abs(before - piece.base) < _SAME
            update: dict[str, Any] = {
                "start_station": round_value(piece.start),
                "end_station": round_value(piece.end),
                "offset": model.offset if keeps_line else round_value(roadside.sign * (piece.base + foot)),
                "terminal_length": round_value(min(terminal, (piece.end - piece.start) / 4.0)),
            }
            yield key, model.model_copy(update=update)

    def _usual(self) -> Barrier:
        return Guardrail(instance=1, start_station=0.0, end_station=1.0, offset=0.0, faces=self._new.towards_road)

    # --- delineators -------------------------------------------------------------------------------------------------

    def _with_delineators(self, objects: dict[str, RoadObject]) -> dict[str, RoadObject]:
        """Return objects with the delineators beside the changed edge, or its barriers, where the rule has them."""
        posts = {
            key: item
            for key, item in objects.items()
            if isinstance(item, Delineator) and is_outside(item, self.before.site, self.side)
        }
        if not posts:
            return objects
        stations = np.array([item.station for item in posts.values()])
        old, new = (list(delineators(side, stations)) for side in (self._old, self._new))
        moved: dict[str, RoadObject] = {}
        for (key, post), (_, was), (_, being) in zip(posts.items(), old, new, strict=True):
            shift = being.offset - was.offset
            if abs(shift) > _SAME:
                moved[key] = post.model_copy(update={"offset": round_value(post.offset + shift)})
        return objects | moved

    # --- what stands and runs behind ---------------------------------------------------------------------------------

    def _with_opened(self, objects: dict[str, RoadObject]) -> dict[str, RoadObject]:
        """Return objects with what runs along the road opened where the new pavement and its verge reach it."""
        result: dict[str, RoadObject] = {}
        for key, item in objects.items():
            if not (isinstance(item, LengthwiseThing) and self._is_behind(item)):
                result[key] = item
                continue
            for part in self._opened(key, item):
                result[key if key not in result else free_ids(objects | result, key)] = part
        return result

    def _is_behind(self, item: RoadObject) -> bool:
        """Return whether an object stands beside the stretch and isn't a barrier, a delineator or a bridge."""
        fixed = (Guardrail, ConcreteBarrier, TemporaryBarrier, ConstructionBeacon, Delineator, Overpass)
        if not isinstance(item, Thing) or isinstance(item, fixed):
            return False
        if not is_outside(item, self.before.site, self.side):
            return False
        start, end = _ends(item)
        room = OBSTACLE_LEAD + OBSTACLE_TAIL + JOIN if isinstance(item, StandingThing) and item.obstacle else _BESIDE
        return self._overlaps(start - room, end + room)

    def _standing(self, key: str, item: StandingThing) -> StandingThing | None:
        """Return a thing moved with the edge if it stood behind it or would be in its way; None without room."""
        sign = self._new.sign
        half, along = _half_extents(item)
        span = item.station - max(along, _BESIDE), item.station + max(along, _BESIDE)
        distance, depth = sign * item.offset, SMALL_ZONE + 2.0 * half
        old_front, new_front = self._old.front(*span, depth), self._new.front(*span, depth)
        gap = distance - half - old_front
        needed = new_front + SMALL_ZONE + half
        place = distance
        if -_FOLLOWS < gap <= SMALL_ZONE + _FOLLOWS and abs(new_front - old_front) > _SAME:
            place = new_front + gap + half
        elif not self._is_free(span, distance - half, distance + half):
            place = max(distance, needed)
        if item.obstacle and self._loses_barrier(item, distance - half, place - half):
            self.notes.append(f"{key} is left out: no barrier can stand before all of it beside the {self.kind}")
            return None
        if place == distance:
            return item
        if place + half > min(_FARTHEST, self.now.site.terrain.half_width):
            self.notes.append(f"{key} is left out: it has no room beside the {self.kind}")
            return None
        return item.model_copy(update={"offset": round_value(sign * place)})

    def _is_free(self, span: Range, low: float, high: float) -> bool:
        """Return whether pavement and barriers of the new edge keep clear of distances (m) along a stretch."""
        edge = self._new.edge
        if high <= edge.largest_main(*span):
            return True
        grid = np.linspace(*span, 5)
        section = self.now.site.sections[self.side]
        distances = section.distances(grid)
        names = list(section.kinds)
        for number, kind in enumerate(names):
            if kind in ("island", "verge"):
                continue
            inner, outer = distances[:, number], distances[:, number + 1]
            if bool(((outer - inner > _SAME) & (outer > low - SMALL_ZONE) & (inner < high + SMALL_ZONE)).any()):
                return False
        return True

    def _with_joined(self, objects: dict[str, RoadObject]) -> dict[str, RoadObject]:
        """Return objects with what was opened in the stretch in one piece again: parts whose ids differ by a number."""
        result = dict(objects)
        for key, item in objects.items():
            if not isinstance(item, LengthwiseThing) or not is_outside(item, self.before.site, self.side):
                continue
            other = result.get(f"{key}-2")
            if type(other) is not type(item) or key not in result or not isinstance(other, LengthwiseThing):
                continue
            gap = item.end_station, other.start_station
            alike = item.model_copy(update={"instance": other.instance, "start_station": 0.0, "end_station": 0.0})
            twin = other.model_copy(update={"start_station": 0.0, "end_station": 0.0})
            if gap[0] <= gap[1] and self._overlaps(*gap) and alike == twin:
                result[key] = item.model_copy(update={"end_station": other.end_station})
                del result[f"{key}-2"]
        return result

    def _opened(self, key: str, item: LengthwiseThing) -> Iterator[LengthwiseThing]:
        """Yield the parts of what runs along the road, without where the new pavement and its verge reach it."""
        right, left = item.reach()
        low = self._new.sign * item.offset - max(right, left)
        taken = self._taken(low, isinstance(item, NoiseBarrier))
        if taken is None or taken[0] >= item.end_station or taken[1] <= item.start_station:
            yield item
            return
        rests = [
            (item.start_station, min(taken[0], item.end_station)),
            (max(taken[1], item.start_station), item.end_station),
        ]
        rests = [(start, end) for start, end in rests if end - start >= _SHORTEST_REST]
        self.notes.append(f"{key} is opened from {taken[0]:.0f} to {taken[1]:.0f} m" if rests else f"{key} is left out")
        for start, end in rests:
            update: dict[str, Any] = {"start_station": round_value(start), "end_station": round_value(end)}
            if "end_offset" in type(item).model_fields:
                slope = np.array([item.start_station, item.end_station]), np.array([item.offset, item.end_offset])  # type: ignore[attr-defined]
                update |= {
                    "offset": round_value(float(np.interp(start, *slope))),
                    "end_offset": round_value(float(np.interp(end, *slope))),
                }
            yield item.model_copy(update=update)

    def _taken(self, low: float, is_wall: bool) -> Range | None:
        """Return the stretch (m) where the new edge reaches a distance (m) from the centreline; None if nowhere."""
        section = self.now.site.sections[self.side]
        grid = np.arange(self.stretch[0], self.stretch[1] + 1.0, 1.0)
        verge = nominal_width(section.carriageway.verge_width)
        room = max(verge + _BEHIND_VERGE, FAR_ZONE + (0.0 if is_wall else _BEHIND_SMALL))
        edge, main = section.paved_edge(grid), section.main_edge(grid) + room
        for segment in self._new.edge.segments:  # barriers stand at its largest distance, and others behind them
            within = (grid >= segment.start - 2.0 * _BESIDE) & (grid <= segment.end + 2.0 * _BESIDE)
            edge[within] = np.maximum(edge[within], segment.base)
        edge += room
        reached = grid[(edge > low) & (edge > main + _SAME)]
        if not len(reached):
            return None
        if is_wall:  # the barrier before it ends with the turnout
            margin = OBSTACLE_LEAD + OBSTACLE_TAIL
            return self.stretch[0] - margin, self.stretch[1] + margin
        return float(reached[0]) - _BESIDE, float(reached[-1]) + _BESIDE

    def _gantry(self, key: str, gantry: Gantry) -> Gantry:
        """Return a gantry with its outer post behind the new edge and its barriers, if its post stood by the rule."""
        end = self._outer_post(gantry)
        if not end:
            return gantry
        sign, post = self._new.sign, SMALL_ZONE + gantry.post_width
        distance = sign * float(getattr(gantry, end))
        span = gantry.station - _BESIDE, gantry.station + _BESIDE
        # Its posts stand outside of ramps, see `Roadside.front`.
        old_front, new_front = (side.front(*span, post, outer=True) for side in (self._old, self._new))
        place = max(distance + new_front - old_front, new_front + post)
        if self._loses_barrier(gantry, distance - gantry.post_width, place - gantry.post_width):
            self.notes.append(f"{key} has no barrier before all of its post: move it, or choose another station")
        if abs(place - distance) < _SAME:
            return gantry
        update = {end: round_value(sign * place)}
        ends = {"left_offset": gantry.left_offset, "right_offset": gantry.right_offset} | update
        return gantry.model_copy(update=update | {"offset": round_value(sum(ends.values()) / 2.0)})

    def _outer_post(self, gantry: Gantry) -> str:
        """Return the field with the offset of a gantry's end outside of this carriageway; empty if it has none."""
        end = "left_offset" if self.side == "left" else "right_offset"
        edge = float(self.before.site.sections[self.side].lane_boundaries(gantry.station)[0][0])
        return end if self._new.sign * float(getattr(gantry, end)) > edge else ""


def _ends(item: Thing) -> Range:
    """Return the lowest and the highest station (m) that a thing takes."""
    blocks = list(item.footprint())
    if not blocks:
        station = float(getattr(item, "station", getattr(item, "start_station", 0.0)))
        return station, float(getattr(item, "end_station", station))
    return min(block.start for block in blocks), max(block.end for block in blocks)


def _half_extents(item: StandingThing) -> tuple[float, float]:
    """Return how far (m) a thing reaches from its axis across the road and along it."""
    blocks = list(item.footprint())
    across = max((max(abs(block.low - item.offset), abs(block.high - item.offset)) for block in blocks), default=0.0)
    along = max((max(abs(block.start - item.station), abs(block.end - item.station)) for block in blocks), default=0.0)
    return across, along


def _distance(item: Barrier, station: float) -> float:
    return max(item.start_station - station, station - item.end_station, 0.0)


def _covers(item: Barrier, piece: BarrierPiece) -> bool:
    return item.start_station < piece.end and item.end_station > piece.start


def _kind_words(item: Barrier) -> str:
    return "concrete-barrier" if isinstance(item, ConcreteBarrier) else "guardrail"
