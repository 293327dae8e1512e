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
from .hits import Ahead, HitRows, LateHits, OnwardLight, ShiningHits, TracedPulses, address_of
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
        """Return the echoes of pulses, hit i that of echo i, and the hits that gave them.

        Args:
            pulses: two or more: NumPy adds the rays of a single one in another order.
            motions: tracks of the target's moving parts.
            axis: (P,) what the first ray of each pulse meets, where it has been cast already.
        """
        block = self._aimed(pulses, motions, axis)
        first, late = self._followed(block, axis, shares=False)
        made, columns = self._grouped(len(pulses.time), first, late)
        pulse, hit, *others = (column[:made].copy() for column in columns)
        traced = self._described(block, pulses, first, late, pulse, hit)
        return traced, Echoes(pulse, np.arange(made), *others)

    def follow(self, pulses: Pulses, motions: list[Track]) -> tuple[TracedRays, BothSignals]:
        """Return all that the rays of pulses meet, and its signals, for what changes them before they are grouped.

        Args:
            pulses: any.
            motions: tracks of the target's moving parts.
        """
        block = self._aimed(pulses, motions, None)
        first, late = self._followed(block, None, shares=True)
        shape = (self._rays, len(pulses.time))
        hits = (self._hits(first, shape), self._hits(late.hits, (len(late.ray),)))
        return TracedRays(block.rays, *hits, late.ray), (first.signals(shape), late.hits.signals((len(late.ray),)))

    def group(self, signals: BothSignals, ray: Index) -> Echoes:
        """Return the echoes of pulses, two or more, as `returns.group_returns` does.

        Args:
            signals: of what rays (K, P) meet first, and (B,) of what lies behind.
            ray: (B,) rays of these, as k * P + p.
        """
        arrays = ([one.distance, one.intensity, one.weight] for one in signals)
        kept = [[np.ascontiguousarray(array) for array in three] for three in arrays]
        first, behind = (HitRows(np.empty(0, np.int32), a, b, c, None, None, None) for a, b, c in kept)
        late = LateHits(np.ascontiguousarray(ray, np.int64), behind)
        made, columns = self._grouped(signals[0].distance.shape[1], first, late)
        return Echoes(*(column[:made].copy() for column in columns))

    def _hits(self, hits: HitRows, shape: tuple[int, ...]) -> Hits:
        """Return hits as NumPy has them."""
        face = hits.face.astype(np.intp).reshape(shape)
        material = np.take(self._target.material, face, mode="clip").astype(np.intp)
        assert hits.along is not None
        assert hits.share is not None
        return Hits(face, material, *(array.reshape(shape) for array in (hits.distance, hits.along, hits.share)))

    def _aimed(self, pulses: Pulses, motions: list[Track], axis: FirstHits | None) -> _Block:
        """Return the rays of pulses at what they are cast at."""
        reach = None
        if self._shape.parallel:
            farthest = self._setting.maximum_range
            met = axis or self._target.cast(pulses.origin, pulses.direction, farthest, pulses.time, motions)
            reach = met.distance
        rays = BeamRays.of(self._shape, pulses, reach)
        return _Block(rays, *rays.native(), motions, None if self._moving is None else self._moving.at(motions))

    def _followed(self, block: _Block, axis: FirstHits | None, shares: bool) -> tuple[HitRows, LateHits]:
        """Return what rays meet first, (K, P), and behind it, with what the air leaves.

        Args:
            block: of pulses.
            axis: see `trace`.
            shares: hits have shares of the energy.
        """
        # What is asked before rays are weighed is asked of all rays at once.
        two_passes = bool(block.moving) or self._clear is not None or axis is not None or self._shape.parallel or shares
        count = len(block.rays.time)
        size, lot = self._rays * count, max(_LEAST_LOT, _LOT // self._rays // _LEAST_LOT * _LEAST_LOT)
        first = HitRows.of(size, self._fades, along=two_passes, share=shares)
        light = OnwardLight.of(size if self._surfaces.permeable else 0, self._clear is not None)
        shining = ShiningHits(size if self._surfaces.retroreflective else 0)
        rows = np.empty((2, max(lot * self._rays, _BUFFER) * 3), np.float32)
        turned, face_buffer = np.empty(3 * lot * self._rays), np.empty(lot * self._rays, np.int32)
        counts, length, casts = np.zeros(2, np.int64), np.empty(self._rays, np.int64), self._caster.casting()
        work = [lot, *(array.ctypes.data for array in (*rows, turned, face_buffer))]
        scene, pulses = ctypes.byref(self._scene), ctypes.byref(block.beams)
        head, met = (scene, ctypes.byref(casts), pulses), ctypes.byref(first.native)
        if two_passes:
            assert first.along is not None
            known, begin = (first.face, first.distance, first.along), int(axis is not None)
            for mine, theirs in zip(known, axis or (), strict=False):
                mine[:count] = theirs
            self._kernel.synthroads_cast_first(*head, met, begin, *work)
            if block.moving:
                block.moving.cast(self._shape, block.beams, begin, None, known, self._setting.maximum_range)
            through = self._through(block, None, *known)
            onward = self._kernel.synthroads_weigh_first(
                *(scene, pulses, met, address_of(through), ctypes.byref(light.native), shining.native),
                *(counts.ctypes.data, length.ctypes.data),
            )
        else:
            onward = self._kernel.synthroads_first(
                *(*head, met, ctypes.byref(light.native), shining.native, counts.ctypes.data, *work),
                length.ctypes.data,
            )
        shining.shine(self._surfaces, first, int(counts[0]))
        layers: list[LateHits] = []
        most = (LAYERS if self._clear is None else CLEAR_LAYERS) - 1
        while onward and len(layers) < most:
            late = LateHits.of(onward, self._fades, shares)
            onward = self._step(block, light, onward, late, shining, counts, rows)
            shining.shine(self._surfaces, late.hits, int(counts[1]))
            layers.append(LateHits(late.ray[: counts[0]], late.hits.select(int(counts[0]))))
        behind = LateHits.join(layers, self._fades, shares)
        for hits in (first, behind.hits):
            hits.fade()
        return first, behind

    def _step(
        self,
        block: _Block,
        light: OnwardLight,
        count: int,
        late: LateHits,
        shining: ShiningHits,
        counts: Index,
        rows: AnyArray,
    ) -> int:
        """Fill in what so many rays meet that go on, and return how many of them do again."""
        face, distance, along = np.empty(count, np.int32), np.empty(count), np.empty(count)
        ahead, casts = Ahead(*(address_of(array) for array in (face, distance, along)), None), self._caster.casting()
        scene, pulses = ctypes.byref(self._scene), ctypes.byref(block.beams)
        passed = ctypes.byref(light.native)
        work = [array.ctypes.data for array in rows]
        self._kernel.synthroads_cast_behind(
            *(scene, ctypes.byref(casts), pulses, passed, count, ctypes.byref(ahead), *work)
        )
        if block.moving:
            met, farthest = (face, distance, along), self._setting.maximum_range
            block.moving.cast(self._shape, block.beams, 0, light.onward(count), met, farthest)
        through = self._through(block, light.onward(count), face, distance, along)
        ahead.through = address_of(through)
        return int(
            self._kernel.synthroads_weigh_behind(
                *(scene, pulses, passed, count, ctypes.byref(ahead), ctypes.byref(late.native)),
                *(shining.native, counts.ctypes.data),
            )
        )

    def _through(
        self,
        block: _Block,
        onward: tuple[Index, Float, Float | None, float] | None,
        face: AnyArray,
        distance: Float,
        along: Float,
    ) -> Float | None:
        """Return the shares of light that rays keep behind what is clear in places, no number for other materials.

        Args:
            block: of pulses.
            onward: see `MovingParts.cast`.
            face, distance, along: what they meet, (K, P) in a row, or (N,) of those that go on.
        """
        if self._clear is None:
            return None
        result = np.full(len(face), np.nan)
        material = np.take(self._target.material, face, mode="clip")
        some = np.flatnonzero(np.take(self._surfaces.clear, material) & (face >= 0))
        here = np.take(distance, some)
        if onward is None:
            near = here < self._setting.maximum_range
            some, here = some[near], here[near]
            ray = some
        else:
            on, start, step, beyond = onward
            ray = on[some]
            here = start[some] + (beyond if step is None else step[some]) + here
        if len(some):
            origin, direction = block.rays.pick(ray)
            result[some] = self._clear.transmitted(
                *(self._target, material[some].astype(np.intp), face[some].astype(np.intp), along[some]),
                *(origin + here * direction, np.take(block.rays.time, ray % len(block.rays.time)), block.motions),
            )
        return result

    def _grouped(self, count: int, first: HitRows, late: LateHits) -> tuple[int, list[AnyArray]]:
        """Return the number of echoes of so many pulses, and their pulses, hits, ranges, intensities and weights."""
        behind = len(late.ray)
        lot = max(_LEAST_LOT, _LOT // self._rays // _LEAST_LOT * _LEAST_LOT)
        sums, chains = np.empty(8 * lot), [np.empty(size, np.int64) for size in (count, count, behind)]
        most = self._rays + (int(np.bincount(late.ray % count).max()) if behind else 0)
        lists = [np.empty(most, np.int64 if i < 3 else np.float64) for i in range(10)]
        columns: list[AnyArray] = [
            np.empty(self._rays * count + behind, np.int64 if i < 2 else np.float64) for i in range(5)
        ]
        made = self._kernel.synthroads_group(
            *(self._rays, count, ctypes.byref(first.native), behind, ctypes.byref(late.native)),
            *(self._setting.range_resolution, lot, sums.ctypes.data, *(array.ctypes.data for array in chains)),
            *(pointers(*lists), pointers(*columns)),
        )
        return made, columns

    def _described(
        self, block: _Block, pulses: Pulses, first: HitRows, late: LateHits, pulse: Index, hit: Index
    ) -> TracedPulses:
        """Return what is known of the hits (N,) of echoes."""
        made = len(hit)
        face, along, distance, direction = np.empty(made, np.int64), np.empty(made), np.empty(made), np.empty((3, made))
        begin = np.empty((3, made)) if self._shape.parallel else None
        self._kernel.synthroads_describe(
            *(ctypes.byref(item) for item in (self._scene, block.beams, first.native, late.native)),
            *(made, *(address_of(array) for array in (hit, face, along, distance, begin, direction))),
        )
        return TracedPulses(self._target, pulses, pulse, face, along, distance, direction, begin)


@cache
def _load() -> ctypes.CDLL:
    """Return the kernel with its functions' signatures; raise `NoKernelError` if this machine has none."""
    kernel = load_kernel("pulses")
    for name, result, arguments in _signatures():
        function = getattr(kernel, name)
        function.restype, function.argtypes = result, arguments
    return kernel


def _signatures() -> Iterator[tuple[str, Any, list[Any]]]:
    """Yield names, results and arguments of the functions of pulses.c."""
    yield "synthroads_first", INT64, [*[POINTER] * 7, INT64, *[POINTER] * 5]
    yield "synthroads_cast_first", None, [*[POINTER] * 4, INT64, INT64, *[POINTER] * 4]
    yield "synthroads_weigh_first", INT64, [POINTER] * 8
    yield "synthroads_cast_behind", None, [*[POINTER] * 4, INT64, *[POINTER] * 3]
    yield "synthroads_weigh_behind", INT64, [*[POINTER] * 3, INT64, *[POINTER] * 4]
    yield "synthroads_group", INT64, [INT64, INT64, POINTER, INT64, POINTER, DOUBLE, INT64, *[POINTER] * 6]
    yield "synthroads_describe", None, [*[POINTER] * 4, INT64, *[POINTER] * 6]
