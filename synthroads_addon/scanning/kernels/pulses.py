"""A block's pulses in compiled loops: rays, what they meet, what that sends back and the returns, beside `pulses.c`.

The NumPy code of `scanning.trace`, `scanning.returns` and `BlockScan.signals` is the reference: for the same faces the
results have the same bytes. It does what is left out here, see `ScanPlan.pulse_kernel`. What needs an exponential or an
arc cosine, which no two C libraries round alike, is NumPy's here as well.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ...base.arrays import AnyArray, Float, Index
from ...materials.reflectance import EDGE_ON
from ...materials.surfaces import Surfaces
from ..beam import BeamPattern
from ..devices.device import ScannerSetting
from ..knots import Track
from ..pulses import Pulses
from ..receiving.radiometry import NEAREST
from ..returns import LEAST_REFLECTANCE, BothSignals, Echoes
from ..scene.gaps import CORNERS
from ..scene.target import FirstHits, Target
from ..trace import BEYOND, BEYOND_CLEAR, CLEAR_LAYERS, FAINTEST, LAYERS, Hits, Openings, TracedRays
from .beams import DOUBLE, INT64, POINTER, BeamRays, Beams, BeamShape, pointers
from .hits import Ahead, HitRows, LateHits, OnwardLight, OnwardRays, ShiningHits, TracedPulses, address_of
from .library import NoKernelError, load_kernel
from .moving import MovingKernel, MovingParts
from .packets import PacketScene

_LOT, _LEAST_LOT = 512, 16
"""Rays whose arrays stay in the processor's first cache; pulses that are a whole number of packets of any width."""
_BUFFER = 1024
"""Rays that are cast at once behind surfaces; as BUFFER in rays.h."""


class _Scene(ctypes.Structure):
    """Scene and settings; as `Scene` in pulses.c."""

    _fields_ = (
        *((name, POINTER) for name in ("cast", "scene", "shape")),
        *((name, POINTER) for name in ("planes", "material", "reflectivity", "facet_a", "facet_b")),
        *((name, POINTER) for name in ("transmission", "open_below", "gap_size")),
        *((name, POINTER) for name in ("pervious", "gappy", "shining", "clear")),
        ("corners", POINTER),
        ("frame", DOUBLE * 3),
        ("gap_area", DOUBLE),
        ("gap_key", ctypes.c_uint32),
        *((name, ctypes.c_int32) for name in ("gaps", "open")),
        *((name, DOUBLE) for name in ("nearest", "farthest", "attenuation")),
        *((name, DOUBLE) for name in ("faintest", "beyond", "beyond_clear", "edge_on", "closest", "least_reflectance")),
        ("limit", ctypes.c_float),
    )


@dataclass(frozen=True)
class _Block:
    """A block's rays and what moves meanwhile.

    Attributes:
        rays: of its pulses.
        beams: the pulses for C.
        kept: arrays of these.
        motions: tracks of the target's moving parts.
        moving: those; None without any.
    """

    rays: BeamRays
    beams: Beams
    kept: list[AnyArray]
    motions: list[Track]
    moving: MovingParts | None


class PulseKernel:
    """Compiled loops over the pulses of a scan's blocks; any threads may use it side by side.

    Args:
        target: what is scanned.
        surfaces: its materials.
        setting: the scanner's.
        pattern: rays of a pulse.
        openings: where materials are open; None where none is.
        attenuation: of the air, 1/m of range.
        parallel: a pulse's rays run parallel.

    Raises:
        NoKernelError: this machine has none, or rays aren't cast in packets.
    """

    def __init__(
        self,
        target: Target,
        surfaces: Surfaces,
        setting: ScannerSetting,
        pattern: BeamPattern,
        openings: Openings | None,
        attenuation: float,
        parallel: bool = False,
    ) -> None:
        self._kernel, caster = _load(), target.caster
        if not isinstance(caster, PacketScene) or not len(target.static_planes):
            raise NoKernelError("no rays are cast in packets")
        if int(target.material.max()) >= len(surfaces.reflectivity):
            raise NoKernelError("faces are of materials that aren't there")
        self._target, self._surfaces, self._caster = target, surfaces, caster
        self._moving = MovingKernel(target) if target.moving else None
        self._shape = BeamShape(pattern, setting.divergence, parallel)
        self._rays, self._fades, self._setting = len(pattern), attenuation > 0.0, setting
        # Pulses whose rays are worked on together: a multiple of `_LEAST_LOT`, about `_LOT` rays.
        self._lot = max(_LEAST_LOT, _LOT // self._rays // _LEAST_LOT * _LEAST_LOT)
        gaps, self._clear = openings or Openings()
        numbers = (
            *(target.static_planes, target.material),
            *(surfaces.reflectivity, surfaces.facet_a, surfaces.facet_b),
            *(surfaces.transmission, surfaces.transmission * 2.0**32, surfaces.gap_size),
            *(surfaces.pervious, surfaces.gappy, surfaces.shining, surfaces.clear),
            CORNERS,
        )
        self._kept = [np.ascontiguousarray(array) for array in numbers]  # as long as C may read them
        address = [array.ctypes.data for array in self._kept]
        limits = (setting.minimum_range, setting.maximum_range, attenuation)
        self._scene = _Scene(
            *(*caster.native, ctypes.addressof(self._shape.native)),
            *address,
            (DOUBLE * 3)(*(np.zeros(3) if gaps is None else gaps.frame_origin)),
            0.0 if gaps is None else 0.75 / math.pi * gaps.solid_angle,
            0 if gaps is None else gaps.key,
            *(gaps is not None, openings is not None),
            *limits,
            *(FAINTEST, BEYOND, BEYOND_CLEAR, EDGE_ON, NEAREST, LEAST_REFLECTANCE),
            setting.maximum_range,
        )

    def trace(self, pulses: Pulses, motions: list[Track], axis: FirstHits | None = None) -> tuple[TracedPulses, Echoes]:
        """Return the hits that gave the echoes of pulses, and the echoes; hit i is that of echo i.

        Args:
            pulses: two or more: NumPy adds the rays of a single one in another order.
            motions: tracks of the target's moving parts.
            axis: (P,) what the first ray of each pulse meets, where it has been cast already.
        """
        block = self._cast_block(pulses, motions, axis)
        first_hits, late_hits = self._follow_block(block, axis, with_shares=False)
        echo_count, columns = self._group(len(pulses.time), first_hits, late_hits)
        pulse, hit, *other_columns = (column[:echo_count].copy() for column in columns)
        traced_pulses = self._describe(block, pulses, first_hits, late_hits, pulse, hit)
        return traced_pulses, Echoes(pulse, np.arange(echo_count), *other_columns)

    def follow(self, pulses: Pulses, motions: list[Track]) -> tuple[TracedRays, BothSignals]:
        """Return all that the rays of pulses meet, and its signals, for effects that change these.

        Args:
            pulses: any number of them.
            motions: tracks of the target's moving parts.
        """
        block = self._cast_block(pulses, motions, None)
        first_hits, late_hits = self._follow_block(block, None, with_shares=True)
        shape, late_shape = (self._rays, len(pulses.time)), (len(late_hits.ray),)
        hits = (self._hits(first_hits, shape), self._hits(late_hits.hits, late_shape))
        signals = (first_hits.signals(shape), late_hits.hits.signals(late_shape))
        return TracedRays(block.rays, *hits, late_hits.ray), signals

    def group(self, signals: BothSignals, ray: Index) -> Echoes:
        """Return the echoes of pulses, two or more, as `returns.group_returns` does.

        Args:
            signals: of what rays (K, P) meet first, and (B,) of what lies behind.
            ray: (B,) rays of these, as k * P + p.
        """
        # Arrays that C reads: kept as long as it does.
        columns = [
            [np.ascontiguousarray(array) for array in (signal.distance, signal.intensity, signal.weight)]
            for signal in signals
        ]
        no_faces = np.empty(0, np.int32)
        first_hits, hits_behind = (
            HitRows(no_faces, distance, intensity, weight, None, None, None) for distance, intensity, weight in columns
        )
        late_hits = LateHits(np.ascontiguousarray(ray, np.int64), hits_behind)
        echo_count, echo_columns = self._group(signals[0].distance.shape[1], first_hits, late_hits)
        return Echoes(*(column[:echo_count].copy() for column in echo_columns))

    def _hits(self, hits: HitRows, shape: tuple[int, ...]) -> Hits:
        """Return hits in the form that NumPy's code takes, in a shape."""
        face = hits.face.astype(np.intp).reshape(shape)
        material = np.take(self._target.material, face, mode="clip").astype(np.intp)
        assert hits.cosine is not None
        assert hits.share is not None
        return Hits(face, material, *(array.reshape(shape) for array in (hits.distance, hits.cosine, hits.share)))

    def _cast_block(self, pulses: Pulses, motions: list[Track], axis: FirstHits | None) -> _Block:
        """Return the rays of pulses and what moves meanwhile, ready to be cast.

        Args:
            pulses: of a block.
            motions: tracks of the target's moving parts.
            axis: (P,) what the pulses' axes meet, by which parallel rays are placed; None: it is cast if it is needed.
        """
        reach = None
        if self._shape.parallel:
            farthest = self._setting.maximum_range
            axis_hits = axis or self._target.cast(pulses.origin, pulses.direction, farthest, pulses.time, motions)
            reach = axis_hits.distance
        rays = BeamRays.of(self._shape, pulses, reach)
        return _Block(rays, *rays.native(), motions, None if self._moving is None else self._moving.at(motions))

    def _follow_block(self, block: _Block, axis: FirstHits | None, with_shares: bool) -> tuple[HitRows, LateHits]:
        """Return what rays (K, P) meet first, and behind that, with what the air leaves of it.

        Args:
            block: of pulses.
            axis: see `trace`.
            with_shares: hits have shares of the energy.
        """
        # Two passes, one that casts and one that weighs, where something has to look at all hits between them.
        two_passes = (
            bool(block.moving) or self._clear is not None or axis is not None or self._shape.parallel or with_shares
        )
        count, lot = len(block.rays.time), self._lot
        size = self._rays * count
        first_hits = HitRows.of(size, self._fades, cosine=two_passes, share=with_shares)
        light = OnwardLight.of(size if self._surfaces.permeable else 0, self._clear is not None)
        shining = ShiningHits(size if self._surfaces.retroreflective else 0)
        # Room that the loops work in: rays as rows, vectors in the frames of what moves, faces; then results: the
        # number of hits and of shining ones of the last call, and hits of each ray.
        rows = np.empty((2, max(lot * self._rays, _BUFFER) * 3), np.float32)
        turned_vectors, face_buffer = np.empty(3 * lot * self._rays), np.empty(lot * self._rays, np.int32)
        counts, lengths, casting = np.zeros(2, np.int64), np.empty(self._rays, np.int64), self._caster.casting()
        work = [lot, *(array.ctypes.data for array in (*rows, turned_vectors, face_buffer))]
        scene, pulses = ctypes.byref(self._scene), ctypes.byref(block.beams)
        native_hits, native_light = ctypes.byref(first_hits.native), ctypes.byref(light.native)
        if two_passes:
            assert first_hits.cosine is not None
            arrays, first_ray = (first_hits.face, first_hits.distance, first_hits.cosine), int(axis is not None)
            # The first ray of each pulse isn't cast again where it is known what it meets.
            for array, axis_values in zip(arrays, axis or (), strict=False):
                array[:count] = axis_values
            self._kernel.synthroads_cast_first(scene, ctypes.byref(casting), pulses, native_hits, first_ray, *work)
            if block.moving:
                block.moving.cast(self._shape, block.beams, first_ray, None, arrays, self._setting.maximum_range)
            transmission = self._transmission(block, None, *arrays)
            onward_count = self._kernel.synthroads_weigh_first(
                *(scene, pulses, native_hits, address_of(transmission), native_light, shining.native),
                *(counts.ctypes.data, lengths.ctypes.data),
            )
        else:
            onward_count = self._kernel.synthroads_first(
                *(scene, ctypes.byref(casting), pulses, native_hits, native_light, shining.native),
                *(counts.ctypes.data, *work, lengths.ctypes.data),
            )
        shining.shine(self._surfaces, first_hits, int(counts[0]))
        layers: list[LateHits] = []
        most_layers = (LAYERS if self._clear is None else CLEAR_LAYERS) - 1
        while onward_count and len(layers) < most_layers:
            layer = LateHits.of(onward_count, self._fades, with_shares)
            onward_count = self._follow_layer(block, light, onward_count, layer, shining, counts, rows)
            shining.shine(self._surfaces, layer.hits, int(counts[1]))
            layers.append(LateHits(layer.ray[: counts[0]], layer.hits.select(int(counts[0]))))
        late_hits = LateHits.join(layers, self._fades, with_shares)
        for hits in (first_hits, late_hits.hits):
            hits.fade()
        return first_hits, late_hits

    def _follow_layer(
        self,
        block: _Block,
        light: OnwardLight,
        count: int,
        layer: LateHits,
        shining: ShiningHits,
        counts: Index,
        rows: AnyArray,
    ) -> int:
        """Fill in what rays meet behind the surfaces that they have passed; return how many of them go on behind that.

        Args:
            block: of pulses.
            light: rays that go on; replaced in place by those that do so again.
            count: number of these rays.
            layer: their hits, filled in.
            shining: hits whose surface sends light back the way that it came, filled in.
            counts: (2,) number of hits and of shining ones, filled in.
            rows: (2, B) room for rays.
        """
        face, distance, cosine = np.empty(count, np.int32), np.empty(count), np.empty(count)
        ahead = Ahead(*(address_of(array) for array in (face, distance, cosine)), None)
        casting = self._caster.casting()
        scene, pulses = ctypes.byref(self._scene), ctypes.byref(block.beams)
        native_light, native_ahead = ctypes.byref(light.native), ctypes.byref(ahead)
        work = [array.ctypes.data for array in rows]
        self._kernel.synthroads_cast_behind(
            *(scene, ctypes.byref(casting), pulses, native_light, count, native_ahead, *work)
        )
        onward = light.onward(count)
        if block.moving:
            arrays, farthest = (face, distance, cosine), self._setting.maximum_range
            block.moving.cast(self._shape, block.beams, 0, onward, arrays, farthest)
        transmission = self._transmission(block, onward, face, distance, cosine)
        ahead.through = address_of(transmission)
        return int(
            self._kernel.synthroads_weigh_behind(
                *(scene, pulses, native_light, count, native_ahead, ctypes.byref(layer.native)),
                *(shining.native, counts.ctypes.data),
            )
        )

    def _transmission(
        self, block: _Block, onward: OnwardRays | None, face: AnyArray, distance: Float, cosine: Float
    ) -> Float | None:
        """Return the shares (N,) of light that rays keep behind materials that are clear in places; NaN for other ones.

        None where the scene has no such materials.

        Args:
            block: of pulses.
            onward: (N,) rays that go on behind surfaces; None for all rays (K, P) from their origins, N = K P in a row.
            face, distance, cosine: (N,) what they meet.
        """
        if self._clear is None:
            return None
        result = np.full(len(face), np.nan)
        material = np.take(self._target.material, face, mode="clip")
        rows = np.flatnonzero(np.take(self._surfaces.clear, material) & (face >= 0))
        ranges = np.take(distance, rows)
        if onward is None:
            in_reach = ranges < self._setting.maximum_range
            rows, ranges = rows[in_reach], ranges[in_reach]
            ray = rows
        else:
            ray = onward.ray[rows]
            step = onward.usual_step if onward.step is None else onward.step[rows]
            ranges = onward.start[rows] + step + ranges
        if len(rows):
            origin, direction = block.rays.pick(ray)
            result[rows] = self._clear.transmitted(
                *(self._target, material[rows].astype(np.intp), face[rows].astype(np.intp), cosine[rows]),
                *(origin + ranges * direction, np.take(block.rays.time, ray % len(block.rays.time)), block.motions),
            )
        return result

    def _group(self, count: int, first_hits: HitRows, late_hits: LateHits) -> tuple[int, list[AnyArray]]:
        """Return the number E of echoes, and columns: their pulses, hits, ranges, intensities and weights.

        Columns have room for as many echoes as there are hits; only the first E rows are filled in.

        Args:
            count: number of pulses P.
            first_hits: (K * P,) of their rays.
            late_hits: (B,) of what lies behind.
        """
        late_count, lot = len(late_hits.ray), self._lot
        # Room that the loop works in: sums of a lot, chains of the hits of each pulse, lists of the hits of one pulse.
        sums, chains = np.empty(8 * lot), [np.empty(size, np.int64) for size in (count, count, late_count)]
        most_hits = self._rays + (int(np.bincount(late_hits.ray % count).max()) if late_count else 0)
        lists = [np.empty(most_hits, np.int64 if i < 3 else np.float64) for i in range(10)]
        columns: list[AnyArray] = [
            np.empty(self._rays * count + late_count, np.int64 if i < 2 else np.float64) for i in range(5)
        ]
        echo_count = self._kernel.synthroads_group(
            *(self._rays, count, ctypes.byref(first_hits.native), late_count, ctypes.byref(late_hits.native)),
            *(self._setting.range_resolution, lot, sums.ctypes.data, *(array.ctypes.data for array in chains)),
            *(pointers(*lists), pointers(*columns)),
        )
        return echo_count, columns

    def _describe(
        self, block: _Block, pulses: Pulses, first_hits: HitRows, late_hits: LateHits, pulse: Index, hit: Index
    ) -> TracedPulses:
        """Return the hits (N,) of echoes with their faces, ranges and rays.

        Args:
            block: of the pulses.
            pulses: P of them.
            first_hits, late_hits: all hits of the block.
            pulse: (N,) of each echo.
            hit: (N,) number of the hit of each echo, as in `returns.Echoes`.
        """
        count = len(hit)
        face, cosine, distance = np.empty(count, np.int64), np.empty(count), np.empty(count)
        direction, begin = np.empty((3, count)), np.empty((3, count)) if self._shape.parallel else None
        self._kernel.synthroads_describe(
            *(ctypes.byref(item) for item in (self._scene, block.beams, first_hits.native, late_hits.native)),
            *(count, *(address_of(array) for array in (hit, face, cosine, distance, begin, direction))),
        )
        return TracedPulses(self._target, pulses, pulse, face, cosine, distance, direction, begin)


@cache
def _load() -> ctypes.CDLL:
    """Return the kernel with its functions' signatures; raise `NoKernelError` if this machine has none."""
    kernel = load_kernel("pulses")
    for name, result, arguments in _signatures():
        function = getattr(kernel, name)
        function.restype, function.argtypes = result, arguments
    return kernel


def _signatures() -> Iterator[tuple[str, Any, list[Any]]]:
    """Yield the name, the type of the result and the types of the arguments of each function of pulses.c."""
    yield "synthroads_first", INT64, [*[POINTER] * 7, INT64, *[POINTER] * 5]
    yield "synthroads_cast_first", None, [*[POINTER] * 4, INT64, INT64, *[POINTER] * 4]
    yield "synthroads_weigh_first", INT64, [POINTER] * 8
    yield "synthroads_cast_behind", None, [*[POINTER] * 4, INT64, *[POINTER] * 3]
    yield "synthroads_weigh_behind", INT64, [*[POINTER] * 3, INT64, *[POINTER] * 4]
    yield "synthroads_group", INT64, [INT64, INT64, POINTER, INT64, POINTER, DOUBLE, INT64, *[POINTER] * 6]
    yield "synthroads_describe", None, [*[POINTER] * 4, INT64, *[POINTER] * 6]
