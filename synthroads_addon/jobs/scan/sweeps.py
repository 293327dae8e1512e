"""`SweepFiles`: a scan's points cut into sweeps, each with its pose and the boxes of things, into their files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import AnyArray, Bool, Float
from ...base.errors import InputError, nearest_name
from ...base.version import generator
from ...cloud.points import PointBlock, concatenate
from ...cloud.sweeps.registry import SWEEPS, open_sweep_writer
from ...cloud.sweeps.spool import SweepSpool
from ...cloud.sweeps.sweep import Box, Sweep, SweepPlace, quaternion
from ...cloud.sweeps.writer import SweepWriter
from ...road.geometry import RoadGeometry
from ...road.instances import InstanceNumbers
from ...road.parameters import RoadParameters
from ...road.surroundings import Vehicle
from ...scanning.plan import ScanPlan
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.platforms.path import Strip, epoch_of
from ...scanning.scene.bodies import LONGEST, Body, moving_bodies, standing_bodies
from ...scanning.scene.motion import LaneMotion
from ...scanning.stages.emission import PulseEmitter
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import Scenario
from ...scenario.sweeps import SURFACES, SweepScenario
from .awaited_sweeps import AwaitedSweeps

_STEP = 0.005
"""Half the time (s) over which velocities are taken. Chosen: a vehicle turns by less than a milliradian meanwhile."""
_TRAVEL = 0.1
"""Half the time (s) over which the way of the scanner is taken, by which a sweep's frame looks ahead. Chosen."""
_STANDING = 0.5
"""Speed (m/s) below which a scanner counts as standing: its frame looks where it looks itself. Chosen."""
_BESIDE = 0.02
"""Distance (m) by which a line of sight may end before a place on a surface and still count as reaching it. Chosen."""
_FULL_SCALE = 65_535.0


def box_classes(scenario: Scenario, inputs: ScenarioInputs) -> frozenset[int]:
    """Return the ``class_id`` of the classes whose things get boxes.

    Raises:
        InputError: the scenario names a class that the scheme doesn't know.
    """
    ids, wanted = inputs.scheme.source_ids(), scenario.sweeps.box_classes
    if wanted is None:
        return frozenset(number for name, number in ids.items() if name not in SURFACES)
    names = [name.strip() for name in wanted.split(",") if name.strip()]
    for name in names:
        if name not in ids:
            raise InputError("sweeps.box_classes", name, f"must be one of {', '.join(ids)}{nearest_name(name, ids)}")
    return frozenset(ids[name] for name in names)


def sight_of_sweeps(settings: SweepScenario, path: ScanPath) -> float:
    """Return how far (m) from a section's pulses things may get boxes, or be too long for one, in the sweeps of it.

    A sweep may lie half in the next section: so far as the scanner goes in its time is added.
    """
    if not settings.formats:
        return 0.0
    way = 0.0
    for strip in path.strips:
        count = int(np.ceil(strip.duration / settings.duration)) + 1
        times = strip.start_time + np.minimum(np.arange(count) * settings.duration, strip.duration)
        places = path.pose(strip, times)[0]
        way = max(way, float(np.linalg.norm(np.diff(places, axis=0), axis=1).max(initial=0.0)))
    return settings.box_range + LONGEST + way


@dataclass
class SweepFiles:
    """Sink of a scan's points that cuts them into sweeps and writes these; see `scenario.sweeps`.

    A scan by sections has a plan for each. Its sweeps are kept on disk, and written in their order in the end.

    Attributes:
        scenario: the job.
        inputs: what the files that it names hold.
        folder: where the files go.
        origin: (3,) map coordinates near the points, m, that the files' map frame begins at.
        intensity_scale: 16-bit steps per unit of intensity.
        epsg: map coordinate system; None if unknown.
        road: what stands on and beside it, for names and models; None without a road.
        counts: what was counted so far, as JSON data.
    """

    scenario: Scenario
    inputs: ScenarioInputs
    folder: Path
    origin: Float
    intensity_scale: float
    epsg: int | None = None
    road: RoadParameters | None = None
    counts: dict[str, Any] = field(default_factory=dict)
    _writers: list[SweepWriter] = field(default_factory=list)
    _bodies: list[Body] = field(default_factory=list)
    _plan: ScanPlan | None = None
    _held: list[PointBlock] = field(default_factory=list)
    _awaited: AwaitedSweeps | None = None
    _spool: SweepSpool | None = None
    _too_long: set[int] = field(default_factory=set)
    _rows: list[dict[str, Any]] = field(default_factory=list)
    _strips: Mapping[int, Strip] = field(default_factory=dict)

    def open(self) -> None:
        """Begin the files."""
        scenario = self.scenario
        place = SweepPlace(
            self.inputs.scheme,
            self.origin,
            self.epsg,
            scenario.title,
            generator(),
            lambda number: self._described(number)[0],
        )
        self._writers = [open_sweep_writer(name, self.folder, place) for name in scenario.sweeps.formats]
        self.counts = {"sweeps": 0, "boxes": 0, "points_in_boxes": 0, "farthest_outside_mm": 0.0, "too_long": 0}

    def begin(self, plan: ScanPlan) -> None:
        """Take the plan of the scan, or of a section of it, whose points follow: its path, and its scene's things."""
        self._plan = plan
        if (blocks := plan.run.chosen_blocks) is not None:
            if self._awaited is None:
                self._awaited = AwaitedSweeps(plan.cut, self.scenario.sweeps.duration)
                self._spool = SweepSpool(self.folder)
            self._awaited.take(blocks)
        self._strips = {strip.index: strip for strip in plan.path.strips}
        classes = box_classes(self.scenario, self.inputs)
        target = plan.target
        bodies = [
            *standing_bodies(target.static, classes, self._rotations),
            *moving_bodies(target.moving, classes),
        ]
        self._bodies = [body for body in bodies if body.size.max() <= LONGEST]
        self._too_long |= {body.instance for body in bodies if body.size.max() > LONGEST}
        self.counts["too_long"] = len(self._too_long)
        self._middles = np.array([body.rotation @ body.centre for body in self._bodies]).reshape(-1, 3)
        self._moves = np.array([body.motion is not None for body in self._bodies], dtype=bool)
        self._shift = target.origin - self.origin

    def add(self, points: PointBlock) -> None:
        """Take points in the order of their blocks; sweeps before their first one are complete, and are written."""
        if not len(points):
            return
        first = self._keys(points).min(axis=1)
        if self._held:
            self._write_held(lambda keys: (keys[0] < first[0]) | ((keys[0] == first[0]) & (keys[1] < first[1])))
        self._held.append(points)

    def end(self) -> None:
        """Write the sweeps that are complete with the points of a plan, which have all come, and let its scene go.

        What is left of a section waits for the next one, whose scene has the things around it as well.
        """
        if self._held:
            self._write_held(lambda keys: np.ones(keys.shape[1], dtype=bool))
        self._plan, self._bodies = None, []

    def close(self) -> None:
        """Complete the files."""
        if self._plan is not None:
            self.end()
        if self._spool is not None:
            for sweep in self._spool.sweeps():
                self._put(sweep)
        self.discard()
        for writer in self._writers:
            writer.close()
        content = {
            "type": "Sweeps",
            "generator": generator(),
            "epsg": self.epsg,
            "origin": self.origin.tolist(),
            "frame": "origin at the scanner; x ahead in plan, y to the left, z up; m",
            "sweeps": self._rows,
        }
        (self.folder / SWEEPS).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")

    def discard(self) -> None:
        """Remove the scratch files, if there are any."""
        if self._spool is not None:
            self._spool.close()
            self._spool = None

    def _write_held(self, has_passed: Callable[[AnyArray], Bool]) -> None:
        """Write the complete ones of the sweeps of which points are held: none comes any more of this plan, or another.

        Args:
            has_passed: returns of sweeps, by strip and number in it (2, N), of which no points follow in this plan.
        """
        held = concatenate(self._held)
        keys = self._keys(held)
        is_done = has_passed(keys)
        if self._awaited is not None:
            is_done &= self._awaited.is_complete(keys)
        if is_done.any():
            self._write(held.select(is_done))
            held = held.select(~is_done)
        self._held = [held] if len(held) else []

    def _keys(self, points: PointBlock) -> Any:
        """Return strip and number in the strip (2, N) of the sweeps that points belong to."""
        assert self._plan is not None
        starts = np.zeros(max(self._strips) + 1)
        for index, strip in self._strips.items():
            starts[index] = strip.start_time
        time = points.gps_time - epoch_of(self._plan.path) - starts[points.strip]
        number = np.maximum(np.floor(time / self.scenario.sweeps.duration + 1e-9), 0.0).astype(np.int64)
        return np.stack([points.strip.astype(np.int64), number])

    def _write(self, points: PointBlock) -> None:
        """Write the sweeps of points, all of which are there."""
        keys = self._keys(points)
        order = np.lexsort((points.gps_time, keys[1], keys[0]))
        keys, points = keys[:, order], points.select(order)
        starts = np.flatnonzero(np.r_[True, (np.diff(keys, axis=1) != 0).any(axis=0)])
        for begin, end in zip(starts, [*starts[1:], len(points)], strict=True):
            sweep = self._sweep(int(keys[0, begin]), int(keys[1, begin]), points.select(slice(begin, end)))
            if self._spool is not None:
                self._spool.keep(sweep)
            else:
                self._put(sweep)

    def _put(self, sweep: Sweep) -> None:
        """Write the next sweep of the scan to all files, and note what it is."""
        sweep = replace(sweep, number=self.counts["sweeps"])
        for writer in self._writers:
            writer.write(sweep)
        self._note(sweep)

    def _sweep(self, strip_index: int, number: int, points: PointBlock) -> Sweep:
        """Return a sweep: points in its frame, and the boxes of the things around."""
        assert self._plan is not None
        duration, strip = self.scenario.sweeps.duration, self._strips[strip_index]
        begin = strip.start_time + number * duration
        end = min(begin + duration, strip.start_time + max(strip.duration, duration))
        position, rotation = self._frame(strip, (begin + end) / 2.0)
        xyz = (points.xyz - self.origin - position) @ rotation
        remission = np.clip(points.intensity * self.intensity_scale / _FULL_SCALE, 0.0, 1.0)
        boxes = tuple(self._boxes(strip, (begin + end) / 2.0, position, points))
        scheme = self.inputs.scheme
        return Sweep(
            0,  # numbered when it is written
            strip_index,
            number,
            begin,
            end,
            position,
            rotation,
            points,
            xyz.astype(np.float32),
            remission.astype(np.float32),
            scheme.ids[points.class_id],
            boxes,
        )

    def _frame(self, strip: Strip, time: float) -> tuple[Float, Float]:
        """Return the origin (3,), m, of a sweep's frame and its rotation (3, 3) to the map's; see `Sweep`."""
        assert self._plan is not None
        begin, end = strip.start_time, strip.start_time + strip.duration
        times = np.clip(np.array([time - _TRAVEL, time, time + _TRAVEL]), begin, max(end, begin))
        position, rotation = self._plan.path.pose(strip, times)
        way, ahead = position[2] - position[0], rotation[1][:, 0]
        if np.hypot(way[0], way[1]) > _STANDING * max(times[2] - times[0], 1e-9):
            ahead = way
        yaw = np.arctan2(ahead[1], ahead[0])
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        return position[1] + self._shift, turn

    def _boxes(self, strip: Strip, time: float, position: Float, points: PointBlock) -> Iterator[Box]:
        """Yield the boxes of the things that are there at a time, s, within the range of boxes."""
        assert self._plan is not None
        limit = self.scenario.sweeps.box_range
        scanner = position - self._shift
        is_near = np.linalg.norm(self._middles - scanner, axis=1) <= limit
        poses = PulseEmitter(self._plan).poses_between(strip, time - _STEP, time + _STEP)
        chosen: list[tuple[Body, Float, Float]] = []
        for index in np.flatnonzero(is_near | self._moves).tolist():
            body = self._bodies[index]
            turn, place, present = body.pose(time)
            if body.part >= 0:
                present = present and bool(poses.motions[body.part].at(np.array([time]))[2][0])
            if present and np.linalg.norm(turn @ body.centre + place - scanner) <= limit:
                chosen.append((body, turn, place))
        seen = self._seen(chosen, scanner, time, poses.motions)
        order = np.argsort(points.instance_id, kind="stable")
        sorted_numbers = points.instance_id[order]
        for (body, turn, place), share in zip(chosen, seen, strict=True):
            number = body.number(time)
            first, last = np.searchsorted(sorted_numbers, [number, number + 1])
            rows = order[first:last]
            velocity = np.zeros(3)
            if body.motion is not None:
                ends = [body.pose(time + sign * _STEP) for sign in (-1.0, 1.0)]
                middles = [end[0] @ body.centre + end[1] for end in ends]
                velocity = (middles[1] - middles[0]) / (2.0 * _STEP)
            low_high = self._extent(body, points, rows)
            seen_centre = seen_size = None
            if low_high is not None:
                seen_centre = turn @ low_high.mean(axis=0) + place + self._shift
                seen_size = low_high[1] - low_high[0]
            name, kind = self._described(number)
            yield Box(
                number,
                body.class_id,
                name,
                kind,
                turn @ body.centre + place + self._shift,
                body.size,
                turn,
                velocity,
                len(rows),
                share,
                seen_centre,
                seen_size,
            )

    def _extent(self, body: Body, points: PointBlock, rows: Any) -> Float | None:
        """Return the extent (2, 3), m, of points in the body frame when they were measured; None without points.

        Counts the points, and how far the farthest is outside of the box.
        """
        if not len(rows):
            return None
        assert self._plan is not None
        local = points.xyz[rows] - self._plan.target.origin
        if body.motion is None:
            inside = (local - body.position) @ body.rotation
        else:
            times = points.gps_time[rows] - epoch_of(self._plan.path)
            rotation, place, _ = body.poses(times)
            inside = np.einsum("nij,ni->nj", rotation, local - place)
        outside = np.abs(inside - body.centre) - body.size / 2.0
        self.counts["points_in_boxes"] += len(rows)
        self.counts["farthest_outside_mm"] = max(self.counts["farthest_outside_mm"], 1000.0 * float(outside.max()))
        return np.array([inside.min(axis=0), inside.max(axis=0)])

    def _seen(
        self, chosen: list[tuple[Body, Float, Float]], scanner: Float, time: float, motions: Any
    ) -> list[float | None]:
        """Return the shares of the sides facing the scanner to which lines of sight are free; None without a side."""
        assert self._plan is not None
        if not chosen:
            return []
        places = np.concatenate([body.places @ turn.T + place for body, turn, place in chosen])
        normals = np.concatenate([body.normals @ turn.T for body, turn, _ in chosen])
        owner = np.repeat(np.arange(len(chosen)), [len(body.places) for body, _, _ in chosen])
        way = places - scanner
        distance = np.linalg.norm(way, axis=1)
        directions = way / np.maximum(distance, _BESIDE)[:, None]
        faces = np.einsum("ij,ij->i", directions, normals) < 0.0
        target = self._plan.target
        rays = np.ascontiguousarray(directions.T)
        begins = np.ascontiguousarray(np.broadcast_to(scanner[:, None], rays.shape))
        times = np.full(len(way), time)
        hits = target.cast(begins, rays, float(distance.max()) + 1.0, times, motions)
        numbers = target.instances(hits.face, times)
        own_numbers = np.array([body.number(time) for body, _, _ in chosen])[owner]
        is_free = (hits.face < 0) | (hits.distance > distance - _BESIDE) | (numbers == own_numbers)
        facing = np.bincount(owner, weights=faces, minlength=len(chosen))
        free = np.bincount(owner, weights=faces & is_free, minlength=len(chosen))
        return [float(part / whole) if whole else None for part, whole in zip(free, facing, strict=True)]

    def _note(self, sweep: Sweep) -> None:
        """Count a sweep, and note what it is."""
        self.counts["sweeps"] += 1
        self.counts["boxes"] += len(sweep.boxes)
        self._rows.append(
            {
                "number": sweep.number,
                "strip": sweep.strip,
                "begin": round(sweep.begin, 9),
                "end": round(sweep.end, 9),
                "points": len(sweep.points),
                "boxes": len(sweep.boxes),
                "position": sweep.position.tolist(),
                "quaternion_wxyz": quaternion(sweep.rotation).tolist(),
            }
        )

    @cached_property
    def _numbers(self) -> InstanceNumbers | None:
        """Return the instance numbers of the road's things; None without a road."""
        return InstanceNumbers(self.road) if self.road else None

    def _described(self, number: int) -> tuple[str, str]:
        """Return a thing's id in the parameter set, and the model of a vehicle; empty where there is none."""
        name = self._numbers.name_of(number) if self._numbers else None
        if name is None or self.road is None:
            return "", ""
        item = self.road.objects.get(name.partition("/")[0])
        return name, item.model if isinstance(item, Vehicle) else ""

    @cached_property
    def _rotations(self) -> dict[int, Float]:
        """Return the rotations (3, 3) of the road's vehicles, as their lanes lead them, by instance number."""
        if self.road is None or not (vehicles := self.road.of_type(Vehicle)):
            return {}
        geometry = RoadGeometry(self.road)
        return {item.instance: LaneMotion(geometry, item, 0.0).pose(np.zeros(1))[0][0] for item in vehicles.values()}
