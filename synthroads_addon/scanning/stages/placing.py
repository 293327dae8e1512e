"""`PointPlacer`: the points of a block's echoes, with measured ranges, classes and layers, and where each was seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base.arithmetic.loops import EchoPlaces, PointLoops
from ...base.arrays import AnyArray, Bool, Float, Index, UInt8
from ...cloud.points import PointBlock, make_block
from ..colour.colour import SeenPoints
from ..kernels.hits import TracedPulses
from ..knots import Track
from ..plan import ScanPlan
from ..platforms.path import Strip
from ..point_layers import MeasuredPoints, fill_layers, place_points
from ..pulses import Errors, Pulses
from ..receiving.range_noise import range_sigma, range_walk
from ..returns import Echoes
from ..sparing import Traced
from ..strip_errors import strip_gain

_OFF_SURFACE = 1e-3
"""How far from its surface a ray towards the sun begins, m."""


class RecordedEchoes(NamedTuple):
    """N echoes that the scanner records.

    Attributes:
        echoes: the echoes.
        number: (N,) number of each in its pulse, from 1.
        returns: (N,) returns of its pulse.
        speckle: (N,) factor by which speckle has changed its power; None without.
        pulse_number: (P,) numbers, within the block, of the pulses that the echoes are of.
    """

    echoes: Echoes
    number: UInt8
    returns: UInt8
    speckle: Float | None
    pulse_number: Index


PlacedArrays = tuple[dict[str, AnyArray], SeenPoints | None]
"""Arrays of points by name, and where the points were seen; None where the plan doesn't ask for it."""


@dataclass(frozen=True)
class PointPlacer:
    """Points of the echoes of a plan's blocks.

    Attributes:
        plan: the scan.
        off_surfaces: whether there may be echoes that come from no surface.
    """

    plan: ScanPlan
    off_surfaces: bool

    def points(
        self,
        strip: Strip,
        pulses: Pulses,
        traced: Traced,
        recorded: RecordedEchoes,
        errors: Errors,
        motions: list[Track],
    ) -> tuple[PointBlock, SeenPoints | None]:
        """Return the points of echoes, with intensities as they arrive, and where they were seen.

        Args:
            strip: of the pulses.
            pulses: P of a block.
            traced: hits of their rays.
            recorded: N echoes.
            errors: of the block.
            motions: tracks of the target's moving parts.
        """
        plan, echoes = self.plan, recorded.echoes
        cosine = traced.pick("cosine", echoes.hit)
        distance = self._measured_ranges(strip, recorded, errors, cosine)
        loops = plan.point_loops
        if loops is not None and isinstance(traced, TracedPulses) and not plan.target.moving:
            arrays, seen_points = self._place_by_loops(loops, pulses, traced, echoes, distance)
        else:
            arrays, seen_points = self._place(pulses, traced, echoes, distance, motions)
        count = len(echoes.pulse)
        points = make_block(
            intensity=echoes.intensity,
            rgb=np.zeros((count, 3), dtype=np.uint16),
            return_number=recorded.number,
            number_of_returns=recorded.returns,
            strip=np.full(count, strip.index, dtype=np.uint16),
            range=distance,
            incidence_deg=np.rad2deg(np.arccos(np.minimum(np.abs(cosine), 1.0))).astype(np.float32),
            **arrays,
        )
        return points, seen_points

    def _measured_ranges(self, strip: Strip, recorded: RecordedEchoes, errors: Errors, cosine: Float) -> Float:
        """Return the ranges (N,), m, that the scanner measures of echoes: with bias, random errors and range walk.

        Args:
            strip: of the pulses.
            recorded: N echoes.
            errors: of the block.
            cosine: (N,) n . d of the faces' normals and the rays.
        """
        setting, noise, echoes = self.plan.setting, self.plan.reception.noise, recorded.echoes
        distance = echoes.range + noise.range_bias
        if errors.range is None:
            return distance
        pulse_number = np.take(recorded.pulse_number, echoes.pulse)
        range_errors = errors.range_errors(pulse_number, recorded.number, setting.receiver.range_delay or 0.0)
        distance = distance + range_sigma(setting, echoes.range, cosine, echoes.intensity) * range_errors
        if setting.receiver.range_walk:
            gain = strip_gain(self.plan.reception.strip_errors, self.plan.run.seed, strip.index)
            distance = distance + range_walk(setting, recorded.speckle, noise, gain)
        return distance

    def _place(
        self, pulses: Pulses, traced: Traced, echoes: Echoes, distance: Float, motions: list[Track]
    ) -> PlacedArrays:
        """Return the arrays of echoes' points that follow from where these are, and where they were seen.

        Args:
            pulses: of the block.
            traced: hits.
            echoes: N of them.
            distance: (N,) measured ranges, m.
            motions: tracks of the target's moving parts.
        """
        plan, target = self.plan, self.plan.target
        pulse, hit_numbers = echoes.pulse, echoes.hit
        face, cosine = traced.pick("face", hit_numbers), traced.pick("cosine", hit_numbers)
        normal: Float | None = None
        if self._with_normals:
            normal = target.normals(face, cosine, pulses.time[pulse], motions)
            if self.off_surfaces:
                air_rows = np.flatnonzero(face < 0)
                normal[:, air_rows] = -traced.directions(hit_numbers[air_rows])
        class_id = target.face_values("class_id", face)
        if self.off_surfaces:
            class_id = np.where(face < 0, np.uint8(plan.atmosphere.air_class), class_id)
        bias = plan.reception.noise.range_bias
        points = MeasuredPoints(plan.setting, target, pulses, pulse, echoes.range, bias, echoes.intensity, face, normal)
        arrays: dict[str, AnyArray] = {
            "xyz": place_points(pulses.measured_origin, pulses.measured_direction, pulse, distance, target.origin),
            "class_id": class_id,
            "instance_id": target.instances(face, pulses.time[pulse]),
            "gps_time": pulses.time[pulse] + plan.reception.epoch,
            "scan_angle_deg": np.rad2deg(pulses.scan_angle[pulse]).astype(np.float32),
        }
        seen_points = None
        if plan.layers.seen_points and normal is not None:
            seen_points = self._seen_points(traced, hit_numbers, face, normal, motions)
        return arrays | fill_layers(points, plan.layers.measured), seen_points

    def _place_by_loops(
        self, loops: PointLoops, pulses: Pulses, traced: TracedPulses, echoes: Echoes, distance: Float
    ) -> PlacedArrays:
        """Return what `_place` does where nothing moves and all echoes are of surfaces, by compiled loops."""
        plan, target = self.plan, self.plan.target
        hit_columns = (traced.face, traced.cosine, traced.distance, traced.direction, traced.begin)
        pulse_columns = (
            *(pulses.time, pulses.scan_angle, pulses.origin, pulses.measured_origin, pulses.measured_direction),
        )
        face_columns = (target.static_planes, target.class_id, target.instance_id, target.material)
        echo_places = EchoPlaces(
            *(echoes.pulse, echoes.hit, distance, *hit_columns, *pulse_columns, *face_columns),
            *(target.origin, plan.reception.epoch),
        )
        placed_points = loops.placed(echo_places, self._with_normals)
        face = traced.pick("face", echoes.hit)
        loop_layers: dict[str, AnyArray] = {"normal": placed_points.narrow_normal, "material": placed_points.material}
        of_echoes = (echoes.pulse, echoes.range, plan.reception.noise.range_bias, echoes.intensity)
        points = MeasuredPoints(plan.setting, target, pulses, *of_echoes, face, None)
        arrays: dict[str, AnyArray] = {
            "xyz": placed_points.xyz,
            "class_id": placed_points.class_id,
            "instance_id": placed_points.instance_id,
            "gps_time": placed_points.gps_time,
            "scan_angle_deg": placed_points.scan_angle_deg,
            **{name: array for name, array in loop_layers.items() if name in plan.layers.measured},
            **fill_layers(points, plan.layers.measured - loop_layers.keys()),
        }
        if not plan.layers.seen_points:
            return arrays, None
        sunlit = None
        if plan.sun is not None:
            facing, begin = loops.facing(placed_points.normal, placed_points.position, plan.sun, _OFF_SURFACE)
            sunlit = self._unshaded(facing, begin, placed_points.time, [])
        seen_points = SeenPoints(
            position=placed_points.position,
            scanner=placed_points.scanner,
            normal=placed_points.normal,
            material=placed_points.material,
            time=placed_points.time,
            face=face,
            sunlit=sunlit,
        )
        return arrays, seen_points

    @property
    def _with_normals(self) -> bool:
        """Return whether points need normals: as a layer, or to tell how they were seen."""
        return self.plan.layers.seen_points or "normal" in self.plan.layers.measured

    def _seen_points(
        self, traced: Traced, hit_numbers: Index, face: Index, normal: Float, motions: list[Track]
    ) -> SeenPoints:
        """Return the surface points that gave the returns, in the scene at time 0, as it is rendered.

        That is on the surface that gave most of the return: the mean of all its hits may lie in the air between them.

        Args:
            traced: hits.
            hit_numbers: (N,) of the hits that gave most of the returns.
            face: (N,) of these.
            normal: (3, N) unit normals there, towards the scanner.
            motions: tracks of the target's moving parts.
        """
        target, time = self.plan.target, traced.times(hit_numbers)
        position, scanner = traced.ends(hit_numbers)
        sunlit = None if self.plan.sun is None else self._sunlit(face, position, normal, time, motions)
        if target.moving:
            position, offset, normal = target.at_time_zero(face, position, time, motions, (scanner - position, normal))
            scanner = position + offset
        return SeenPoints(
            position=np.ascontiguousarray(position.T),
            scanner=np.ascontiguousarray(scanner.T),
            normal=np.ascontiguousarray(normal.T),
            material=target.face_values("material", face),
            time=time,
            face=face,
            sunlit=sunlit,
        )

    def _sunlit(self, face: Index, position: Float, normal: Float, time: Float, motions: list[Track]) -> Bool:
        """Return a mask (N,) of the points that the sun reaches, on the side that their normals point to.

        Args:
            face: (N,); points without one, of -1, are in no sun.
            position, normal: (3, N) local, m, and unit vectors.
            time: (N,) s.
            motions: tracks of the target's moving parts.
        """
        sun = self.plan.sun
        assert sun is not None
        facing = (sun[0] * normal[0] + sun[1] * normal[1] + sun[2] * normal[2] > 0.0) & (face >= 0)
        return self._unshaded(facing, normal * _OFF_SURFACE + position, time, motions)

    def _unshaded(self, facing: Bool, begin: Float, time: Float, motions: list[Track]) -> Bool:
        """Return a mask (N,) of the places that face the sun and that nothing shades.

        Args:
            facing: (N,) whether they face it.
            begin: (3, N) places, m.
            time: (N,) s.
            motions: tracks of the target's moving parts.
        """
        sun, rows = self.plan.sun, np.flatnonzero(facing)
        assert sun is not None
        if len(rows) < len(facing):
            # Columns are chosen several times as fast by `take` as by indexing.
            begin, time = np.take(begin, rows, axis=1), np.take(time, rows)
        result = np.zeros(len(facing), bool)
        result[rows] = self.plan.target.unobstructed(begin, sun, time, motions)
        return result
