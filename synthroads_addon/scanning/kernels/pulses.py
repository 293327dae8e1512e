"""A block's pulses in compiled loops: rays, what they meet, what that sends back and the returns, beside `pulses.c`.

The NumPy code of `scanning.trace`, `scanning.returns` and `BlockScan.signals` is the reference: for the same faces the
results have the same bytes. It does what is left out here, see `ScanPlan.pulse_kernel`. What needs an exponential or an
arc cosine, which no two C libraries round alike, is NumPy's here as well.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np

from ...base.arrays import AnyArray, Float, Index
from ...materials.reflectance import EDGE_ON, retroreflection
from ...materials.surfaces import Surfaces
from ..beam import BeamPattern
from ..devices.device import ScannerSetting
from ..knots import Track
from ..pulses import Pulses
from ..receiving.radiometry import NEAREST, received_intensity
from ..returns import LEAST_REFLECTANCE, BothSignals, Echoes, HitSignals
from ..scene.gaps import CORNERS
from ..scene.target import FirstHits, Target
from ..trace import BEYOND, BEYOND_CLEAR, CLEAR_LAYERS, FAINTEST, LAYERS, Hits, Openings, TracedRays
from .beams import DOUBLE, INT64, POINTER, Beams, BeamRays, BeamShape, pointers
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
        ("faces", INT64),
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


class _Met(ctypes.Structure):
    """Hits; as `Met` in pulses.c."""

    _fields_ = tuple((name, POINTER) for name in ("face", "distance", "intensity", "weight", "fading", "along", "share"))


class _Behind(ctypes.Structure):
    """Hits behind surfaces; as `Behind` in pulses.c."""

    _fields_ = (("ray", POINTER), ("met", _Met))


def _address(array: AnyArray | None) -> int | None:
    return None if array is None else array.ctypes.data


class _Passed(ctypes.Structure):
    """Light that goes on; as `Passed` in pulses.c."""

    _fields_ = tuple((name, POINTER) for name in ("ray", "left", "start", "step", "face"))


class _Ahead(ctypes.Structure):
    """What rays on their way meet; as `Ahead` in pulses.c."""

    _fields_ = tuple((name, POINTER) for name in ("face", "distance", "along", "through"))


@dataclass(frozen=True)
class _Hits:
    """Hits and what they send back, (N,) each.

    Attributes:
        face: number of the face.
        distance: m; inf where it is out of reach.
        intensity: received, without what the air takes.
        weight: in mean ranges.
        fading: exponent of what the air leaves; None where it takes nothing.
        along: n . d of the face's normal and the ray; None where it is worked out again for those that are asked for.
        share: of the pulse's energy that the surface takes; None where nobody asks.
    """

    face: AnyArray
    distance: Float
    intensity: Float
    weight: Float
    fading: Float | None
    along: Float | None
    share: Float | None

    @classmethod
    def of(cls, count: int, fades: bool, along: bool, share: bool) -> _Hits:
        """Return room for so many hits."""
        distance, intensity, weight = (np.empty(count) for _ in range(3))
        others = (np.empty(count) if wanted else None for wanted in (fades, along, share))
        return cls(np.empty(count, np.int32), distance, intensity, weight, *others)

    @property
    def native(self) -> _Met:
        """Return the addresses of the arrays."""
        return _Met(*(_address(getattr(self, name)) for name, _ in _Met._fields_))

    def select(self, count: int) -> _Hits:
        """Return the first hits."""
        arrays = (getattr(self, field.name) for field in fields(self))
        return _Hits(*(None if array is None else array[:count] for array in arrays))

    def fade(self) -> None:
        """Turn the exponents of what the air leaves into factors, in place."""
        if self.fading is not None:
            with np.errstate(under="ignore"):
                np.exp(self.fading, out=self.fading)

    def signals(self, shape: tuple[int, ...]) -> HitSignals:
        """Return what hits send back, less what the air takes, in a shape; `fade` has been called."""
        intensity = self.intensity if self.fading is None else self.intensity * self.fading
        return HitSignals(*(array.reshape(shape) for array in (self.distance, self.weight, intensity)))


@dataclass(frozen=True)
class _Late:
    """Hits behind surfaces that let light through, (N,) each.

    Attributes:
        ray: k * P + p for ray k of pulse p.
        hits: the rest; they always have ``along``.
    """

    ray: Index
    hits: _Hits

    @classmethod
    def of(cls, count: int, fades: bool, share: bool) -> _Late:
        """Return room for so many hits."""
        return cls(np.empty(count, np.int64), _Hits.of(count, fades, along=True, share=share))

    @property
    def native(self) -> _Behind:
        """Return the addresses of the arrays."""
        return _Behind(self.ray.ctypes.data, self.hits.native)

    @classmethod
    def join(cls, parts: list[_Late], fades: bool, share: bool) -> _Late:
        """Return hits in the order of the parts."""
        if not parts:
            return cls.of(0, fades, share)
        hits = [part.hits for part in parts]
        columns = ([getattr(one, field.name) for one in hits] for field in fields(_Hits))
        joined = (None if column[0] is None else np.concatenate(column) for column in columns)
        return cls(np.concatenate([part.ray for part in parts]), _Hits(*joined))


@dataclass(frozen=True)
class _Light:
    """Room for rays that go on behind surfaces, (N,) each; see `trace._Passed`.

    Attributes:
        ray, left, start: as there.
        step, face: likewise; None where no material is clear in places.
    """

    ray: Index
    left: Float
    start: Float
    step: Float | None
    face: AnyArray | None

    @classmethod
    def of(cls, count: int, clear: bool) -> _Light:
        """Return room for so many rays."""
        seen = (np.empty(count), np.empty(count, np.int32)) if clear else (None, None)
        return cls(np.empty(count, np.int64), np.empty(count), np.empty(count), *seen)

    @property
    def native(self) -> _Passed:
        """Return the addresses of the arrays."""
        return _Passed(*(_address(getattr(self, name)) for name, _ in _Passed._fields_))

    def onward(self, count: int) -> tuple[Index, Float, Float | None, float]:
        """Return the first so many rays, see `MovingParts.cast`."""
        return self.ray[:count], self.start[:count], None if self.step is None else self.step[:count], BEYOND


@dataclass(frozen=True)
class TracedPulses:
    """Hits that gave a block's echoes; hit i gave echo i.

    Attributes:
        target: what was scanned.
        pulses: the block's.
        pulse: (N,) of each hit.
        face: (N,) that was hit.
        along: (N,) n . d of its normal and the ray.
        distance: (N,) range of the hit, m.
        direction: (3, N) of its ray.
        begin: (3, N) where its ray begins, local, m; None for where its pulse does.
    """

    target: Target
    pulses: Pulses
    pulse: Index
    face: Index
    along: Float
    distance: Float
    direction: Float
    begin: Float | None

    @property
    def count(self) -> int:
        """Return the number of hits."""
        return len(self.pulse)

    def pick(self, name: str, hits: Index) -> AnyArray:
        """Return the named attribute of chosen hits, ``material`` that of their faces."""
        if name == "material":
            return np.take(self.target.material, np.take(self.face, hits)).astype(np.intp)
        return np.asarray(np.take(getattr(self, name), hits))

    def ends(self, hits: Index) -> tuple[Float, Float]:
        """Return where chosen hits are and where their rays begin, (3, N) each, local, m."""
        begin = self.begins(hits)
        return begin + np.take(self.distance, hits) * self.directions(hits), begin

    def begins(self, hits: Index) -> Float:
        """Return where the rays of chosen hits begin, (3, N) local, m."""
        if self.begin is not None:
            return np.take(self.begin, hits, axis=1)
        return np.take(self.pulses.origin, np.take(self.pulse, hits), axis=1)

    def directions(self, hits: Index) -> Float:
        """Return the directions (3, N) of chosen hits' rays."""
        return np.take(self.direction, hits, axis=1)

    def times(self, hits: Index) -> Float:
        """Return when the rays of chosen hits (N,) were emitted, s."""
        return np.take(self.pulses.time, np.take(self.pulse, hits))


class _Shining:
    """Room for hits whose surface sends light back the way that it came.

    Args:
        count: hits at most.
    """

    def __init__(self, count: int) -> None:
        self._hit = np.empty(count, np.int64)
        self._cosine, self._brightness, self._share = (np.empty(count) for _ in range(3))
        self._material = np.empty(count, np.uint16)
        self.native = pointers(self._hit, self._cosine, self._brightness, self._share, self._material)

    def shine(self, surfaces: Surfaces, hits: _Hits, count: int) -> None:
        """Add, in place, to the intensities of hits what their surfaces send back; ``count`` of them do."""
        if not count:
            return
        hit, material = self._hit[:count], self._material[:count]
        retro, lobe = np.take(surfaces.retro, material), np.take(surfaces.inverse_lobe_squared, material)
        brightness = self._brightness[:count] + retroreflection(self._cosine[:count], retro, lobe)
        brightness *= self._share[:count]
        hits.intensity[hit] = received_intensity(brightness, np.take(hits.distance, hit))


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
        if not isinstance(caster, PacketScene) or not len(target.static_planes[0]):
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
            *(len(target.static_planes[0]), *address),
            (DOUBLE * 3)(*(np.zeros(3) if gaps is None else gaps.frame_origin)),
            0.0 if gaps is None else 0.75 / math.pi * gaps.solid_angle,
            0 if gaps is None else gaps.key,
            *(gaps is not None, openings is not None),
            *limits,
            *(FAINTEST, BEYOND, BEYOND_CLEAR, EDGE_ON, NEAREST, LEAST_REFLECTANCE),
            setting.maximum_range,
        )

    def trace(
        self, pulses: Pulses, motions: list[Track], axis: FirstHits | None = None
    ) -> tuple[TracedPulses, Echoes]:
        """Return the echoes of pulses, hit i that of echo i, and the hits that gave them.

        Args:
            pulses: two or more: NumPy adds the rays of a single one in another order.
            motions: tracks of the target's moving parts.
            axis: (P,) what the first ray of each pulse meets, where it has been cast already.
        """
        rays, beams, kept = self._aimed(pulses, motions, axis)
        first, late = self._followed(rays, beams, motions, axis, shares=False)
        made, columns = self._grouped(len(pulses.time), first, late)
        pulse, hit, *others = (column[:made].copy() for column in columns)
        echoes = Echoes(pulse, np.arange(made), *others)
        traced = self._described(beams, pulses, first, late, pulse, hit)
        del kept  # until here C has read the pulses
        return traced, echoes

    def follow(self, pulses: Pulses, motions: list[Track]) -> tuple[TracedRays, BothSignals]:
        """Return all that the rays of pulses meet, and its signals, for what changes them before they are grouped.

        Args:
            pulses: any.
            motions: tracks of the target's moving parts.
        """
        rays, beams, kept = self._aimed(pulses, motions, None)
        first, late = self._followed(rays, beams, motions, None, shares=True)
        del kept
        shape = (self._rays, len(pulses.time))
        hits = (self._hits(first, shape), self._hits(late.hits, (len(late.ray),)))
        return TracedRays(rays, *hits, late.ray), (first.signals(shape), late.hits.signals((len(late.ray),)))

    def group(self, signals: BothSignals, ray: Index) -> Echoes:
        """Return the echoes of pulses, two or more, as `returns.group_returns` does.

        Args:
            signals: of what rays (K, P) meet first, and (B,) of what lies behind.
            ray: (B,) rays of these, as k * P + p.
        """
        first, behind = (
            _Hits(np.empty(0, np.int32), *(np.ascontiguousarray(array) for array in arrays), None, None, None)
            for arrays in ((one.distance, one.intensity, one.weight) for one in signals)
        )
        late = _Late(np.ascontiguousarray(ray, np.int64), behind)
        made, columns = self._grouped(signals[0].distance.shape[1], first, late)
        return Echoes(*(column[:made].copy() for column in columns))

    def _hits(self, hits: _Hits, shape: tuple[int, ...]) -> Hits:
        """Return hits as NumPy has them."""
        face = hits.face.astype(np.intp).reshape(shape)
        material = np.take(self._target.material, face, mode="clip").astype(np.intp)
        assert hits.along is not None
        assert hits.share is not None
        return Hits(face, material, *(array.reshape(shape) for array in (hits.distance, hits.along, hits.share)))

    def _aimed(
        self, pulses: Pulses, motions: list[Track], axis: FirstHits | None
    ) -> tuple[BeamRays, Beams, list[AnyArray]]:
        """Return the rays of pulses, and the same for C with the arrays that must stay meanwhile."""
        reach = None
        if self._shape.parallel:
            farthest = self._setting.maximum_range
            met = axis or self._target.cast(pulses.origin, pulses.direction, farthest, pulses.time, motions)
            reach = met.distance
        rays = BeamRays.of(self._shape, pulses, reach)
        return rays, *rays.native()

    def _followed(
        self, rays: BeamRays, beams: Beams, motions: list[Track], axis: FirstHits | None, shares: bool
    ) -> tuple[_Hits, _Late]:
        """Return what rays meet first, (K, P), and behind it, with what the air leaves."""
        moving = None if self._moving is None else self._moving.at(motions)
        # What is asked before rays are weighed is asked of all rays at once.
        apart = bool(moving) or self._clear is not None or axis is not None or self._shape.parallel
        count = len(rays.time)
        size, lot = self._rays * count, max(_LEAST_LOT, _LOT // self._rays // _LEAST_LOT * _LEAST_LOT)
        first = _Hits.of(size, self._fades, along=apart or shares, share=shares)
        light = _Light.of(size if self._surfaces.permeable else 0, self._clear is not None)
        shining = _Shining(size if self._surfaces.retroreflective else 0)
        rows = np.empty((2, max(lot * self._rays, _BUFFER) * 3), np.float32)
        turned, found = np.empty(3 * lot * self._rays), np.empty(lot * self._rays, np.int32)
        counts, length, casts = np.zeros(2, np.int64), np.empty(self._rays, np.int64), self._caster.casting()
        work = [lot, *(array.ctypes.data for array in (*rows, turned, found))]
        scene, pulses = ctypes.byref(self._scene), ctypes.byref(beams)
        head, met = (scene, ctypes.byref(casts), pulses), ctypes.byref(first.native)
        if apart or shares:
            begin = 0
            if axis is not None:
                begin = 1
                assert first.along is not None
                for mine, theirs in zip((first.face, first.distance, first.along), axis, strict=True):
                    mine[:count] = theirs
            self._kernel.synthroads_cast_first(*head, met, begin, *work)
            assert first.along is not None
            known = (first.face, first.distance, first.along)
            if moving:
                moving.cast(self._shape, beams, begin, None, known, self._setting.maximum_range)
            through = self._through(rays, None, *known, motions)
            onward = self._kernel.synthroads_weigh_first(
                *(scene, pulses, met, _address(through), ctypes.byref(light.native), shining.native),
                *(counts.ctypes.data, length.ctypes.data),
            )
        else:
            onward = self._kernel.synthroads_first(
                *(*head, met, ctypes.byref(light.native), shining.native, counts.ctypes.data, *work),
                length.ctypes.data,
            )
        shining.shine(self._surfaces, first, int(counts[0]))
        layers: list[_Late] = []
        most = (LAYERS if self._clear is None else CLEAR_LAYERS) - 1
        while onward and len(layers) < most:
            late = _Late.of(onward, self._fades, shares)
            onward = self._step(rays, beams, moving, motions, light, onward, late, shining, counts, rows)
            shining.shine(self._surfaces, late.hits, int(counts[1]))
            layers.append(_Late(late.ray[: counts[0]], late.hits.select(int(counts[0]))))
        behind = _Late.join(layers, self._fades, shares)
        for hits in (first, behind.hits):
            hits.fade()
        return first, behind

    def _step(
        self,
        rays: BeamRays,
        beams: Beams,
        moving: MovingParts | None,
        motions: list[Track],
        light: _Light,
        count: int,
        late: _Late,
        shining: _Shining,
        counts: Index,
        rows: AnyArray,
    ) -> int:
        """Fill in what so many rays meet that go on, and return how many of them do again."""
        face, distance, along = np.empty(count, np.int32), np.empty(count), np.empty(count)
        ahead, casts = _Ahead(*(_address(array) for array in (face, distance, along)), None), self._caster.casting()
        scene, pulses = ctypes.byref(self._scene), ctypes.byref(beams)
        passed = ctypes.byref(light.native)
        work = [array.ctypes.data for array in rows]
        self._kernel.synthroads_cast_behind(
            *(scene, ctypes.byref(casts), pulses, passed, count, ctypes.byref(ahead), *work)
        )
        if moving:
            met, farthest = (face, distance, along), self._setting.maximum_range
            moving.cast(self._shape, beams, 0, light.onward(count), met, farthest)
        through = self._through(rays, light.onward(count), face, distance, along, motions)
        ahead.through = _address(through)
        return int(
            self._kernel.synthroads_weigh_behind(
                *(scene, pulses, passed, count, ctypes.byref(ahead), ctypes.byref(late.native)),
                *(shining.native, counts.ctypes.data),
            )
        )

    def _through(
        self,
        rays: BeamRays,
        onward: tuple[Index, Float, Float | None, float] | None,
        face: AnyArray,
        distance: Float,
        along: Float,
        motions: list[Track],
    ) -> Float | None:
        """Return the shares of light that rays keep behind what is clear in places, no number for other materials.

        Args:
            rays: of the pulses.
            onward: see `MovingParts.cast`.
            face, distance, along: what they meet, (K, P) in a row, or (N,) of those that go on.
            motions: tracks of the target's moving parts.
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
            origin, direction = rays.pick(ray)
            result[some] = self._clear.transmitted(
                *(self._target, material[some].astype(np.intp), face[some].astype(np.intp), along[some]),
                *(origin + here * direction, np.take(rays.time, ray % len(rays.time)), motions),
            )
        return result

    def _grouped(self, count: int, first: _Hits, late: _Late) -> tuple[int, list[AnyArray]]:
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
        self, beams: Beams, pulses: Pulses, first: _Hits, late: _Late, pulse: Index, hit: Index
    ) -> TracedPulses:
        """Return what is known of the hits (N,) of echoes."""
        made = len(hit)
        face, along, distance, direction = np.empty(made, np.int64), np.empty(made), np.empty(made), np.empty((3, made))
        begin = np.empty((3, made)) if self._shape.parallel else None
        self._kernel.synthroads_describe(
            *(ctypes.byref(item) for item in (self._scene, beams, first.native, late.native)),
            *(made, *(_address(array) for array in (hit, face, along, distance, begin, direction))),
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
