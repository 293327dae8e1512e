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
from ...materials.reflectance import EDGE_ON, retroreflection
from ...materials.surfaces import Surfaces
from ..beam import BeamPattern, beam_factors
from ..devices.device import ScannerSetting
from ..pulses import Pulses
from ..receiving.radiometry import NEAREST, received_intensity
from ..returns import LEAST_REFLECTANCE, Echoes
from ..scene.gaps import CORNERS, LeafGaps
from ..scene.target import Target
from ..trace import BEYOND, FAINTEST, LAYERS
from .library import NoKernelError, load_kernel
from .packets import PacketScene

_LOT, _LEAST_LOT = 512, 16
"""Rays whose arrays stay in the processor's first cache; pulses that are a whole number of packets of any width."""
_BUFFER = 1024
"""Rays that are cast at once behind surfaces; as BUFFER in pulses.c."""
_POINTER, _INT64, _DOUBLE = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


class _Scene(ctypes.Structure):
    """Scene and settings; as `Scene` in pulses.c."""

    _fields_ = (
        *((name, _POINTER) for name in ("cast", "scene")),
        ("rays", _INT64),
        *((name, _POINTER) for name in ("stretch", "in_plane", "across", "share")),
        ("faces", _INT64),
        *((name, _POINTER) for name in ("planes", "material", "reflectivity", "facet_a", "facet_b")),
        *((name, _POINTER) for name in ("transmission", "open_below", "gap_size", "pervious", "gappy", "shining")),
        ("corners", _POINTER),
        ("frame", _DOUBLE * 3),
        ("gap_area", _DOUBLE),
        ("gap_key", ctypes.c_uint32),
        ("gaps", ctypes.c_int32),
        *((name, _DOUBLE) for name in ("nearest", "farthest", "attenuation")),
        *((name, _DOUBLE) for name in ("faintest", "beyond", "edge_on", "closest", "least_reflectance")),
        ("limit", ctypes.c_float),
    )


class _Beams(ctypes.Structure):
    """Pulses; as `Beams` in pulses.c."""

    _fields_ = (("pulses", _INT64), *((name, _POINTER) for name in ("origin", "direction", "in_plane", "across")))


class _Met(ctypes.Structure):
    """Hits; as `Met` in pulses.c."""

    _fields_ = tuple((name, _POINTER) for name in ("face", "distance", "intensity", "weight", "fading"))


class _Behind(ctypes.Structure):
    """Hits behind surfaces; as `Behind` in pulses.c."""

    _fields_ = (("ray", _POINTER), ("along", _POINTER), ("met", _Met))


def _pointers(*arrays: AnyArray) -> ctypes.Array[Any]:
    """Return the addresses of arrays side by side, as structures of pulses.c that hold nothing else have them."""
    return (_POINTER * len(arrays))(*(array.ctypes.data for array in arrays))


@dataclass(frozen=True)
class _Hits:
    """Hits and what they send back, (N,) each.

    Attributes:
        face: number of the face.
        distance: m; inf where it is out of reach.
        intensity: received, without what the air takes.
        weight: in mean ranges.
        fading: exponent of what the air leaves; None where it takes nothing.
    """

    face: AnyArray
    distance: Float
    intensity: Float
    weight: Float
    fading: Float | None

    @classmethod
    def of(cls, count: int, fades: bool) -> _Hits:
        """Return room for so many hits."""
        distance, intensity, weight = (np.empty(count) for _ in range(3))
        return cls(np.empty(count, np.int32), distance, intensity, weight, np.empty(count) if fades else None)

    @property
    def native(self) -> _Met:
        """Return the addresses of the arrays."""
        arrays = (self.face, self.distance, self.intensity, self.weight, self.fading)
        return _Met(*(None if array is None else array.ctypes.data for array in arrays))

    def select(self, count: int) -> _Hits:
        """Return the first hits."""
        fading = None if self.fading is None else self.fading[:count]
        return _Hits(self.face[:count], self.distance[:count], self.intensity[:count], self.weight[:count], fading)

    def fade(self) -> None:
        """Turn the exponents of what the air leaves into factors, in place."""
        if self.fading is not None:
            with np.errstate(under="ignore"):
                np.exp(self.fading, out=self.fading)


@dataclass(frozen=True)
class _Late:
    """Hits behind surfaces that let light through, (N,) each.

    Attributes:
        ray: k * P + p for ray k of pulse p.
        along: n . d of the face's normal and the ray.
        hits: the rest.
    """

    ray: Index
    along: Float
    hits: _Hits

    @classmethod
    def of(cls, count: int, fades: bool) -> _Late:
        """Return room for so many hits."""
        return cls(np.empty(count, np.int64), np.empty(count), _Hits.of(count, fades))

    @property
    def native(self) -> _Behind:
        """Return the addresses of the arrays."""
        return _Behind(self.ray.ctypes.data, self.along.ctypes.data, self.hits.native)

    @classmethod
    def join(cls, parts: list[_Late], fades: bool) -> _Late:
        """Return hits in the order of the parts."""
        if not parts:
            return cls.of(0, fades)
        hits = [part.hits for part in parts]
        face, distance, intensity, weight = (
            np.concatenate([getattr(one, name) for one in hits]) for name in ("face", "distance", "intensity", "weight")
        )
        fading = np.concatenate([one.fading for one in hits if one.fading is not None]) if fades else None
        ray, along = (np.concatenate([getattr(part, name) for part in parts]) for name in ("ray", "along"))
        return cls(ray, along, _Hits(face, distance, intensity, weight, fading))


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
    """

    target: Target
    pulses: Pulses
    pulse: Index
    face: Index
    along: Float
    distance: Float
    direction: Float

    def pick(self, name: str, hits: Index) -> AnyArray:
        """Return the named attribute of chosen hits, ``material`` that of their faces."""
        if name == "material":
            return np.take(self.target.material, np.take(self.face, hits)).astype(np.intp)
        return np.asarray(np.take(getattr(self, name), hits))

    def ends(self, hits: Index) -> tuple[Float, Float]:
        """Return where chosen hits are and where their rays begin, (3, N) each, local, m."""
        begin = np.take(self.pulses.origin, np.take(self.pulse, hits), axis=1)
        return begin + np.take(self.distance, hits) * self.directions(hits), begin

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
        self.native = _pointers(self._hit, self._cosine, self._brightness, self._share, self._material)

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
        target: what is scanned; nothing of it moves.
        surfaces: its materials.
        setting: the scanner's.
        pattern: rays of a pulse.
        gaps: leaves and gaps of the materials; None where there are none.
        attenuation: of the air, 1/m of range.

    Raises:
        NoKernelError: this machine has none, or rays aren't cast in packets.
    """

    def __init__(
        self,
        target: Target,
        surfaces: Surfaces,
        setting: ScannerSetting,
        pattern: BeamPattern,
        gaps: LeafGaps | None,
        attenuation: float,
    ) -> None:
        self._kernel, caster = _load(), target.caster
        if not isinstance(caster, PacketScene) or not target.triangles:
            raise NoKernelError("no rays are cast in packets")
        if int(target.material.max()) >= len(surfaces.reflectivity):
            raise NoKernelError("faces are of materials that aren't there")
        self._target, self._surfaces, self._caster = target, surfaces, caster
        self._rays, self._fades, self._resolution = len(pattern), attenuation > 0.0, setting.range_resolution
        self._permeable, self._shines = surfaces.permeable, surfaces.retroreflective
        numbers = (
            *beam_factors(pattern, setting.divergence),
            pattern.weights,
            target.static_planes,
            target.material,
            *(surfaces.reflectivity, surfaces.facet_a, surfaces.facet_b),
            *(surfaces.transmission, surfaces.transmission * 2.0**32, surfaces.gap_size),
            *(surfaces.pervious, surfaces.gappy, surfaces.shining),
            CORNERS,
        )
        self._kept = [np.ascontiguousarray(array) for array in numbers]  # as long as C may read them
        cast, scene = caster.native
        address = [array.ctypes.data for array in self._kept]
        limits = (setting.minimum_range, setting.maximum_range, attenuation)
        self._scene = _Scene(
            cast,
            scene,
            self._rays,
            *address[:4],
            target.triangles,
            *address[4:],
            (_DOUBLE * 3)(*(np.zeros(3) if gaps is None else gaps.frame_origin)),
            0.0 if gaps is None else 0.75 / math.pi * gaps.solid_angle,
            0 if gaps is None else gaps.key,
            gaps is not None,
            *limits,
            *(FAINTEST, BEYOND, EDGE_ON, NEAREST, LEAST_REFLECTANCE),
            setting.maximum_range,
        )

    def trace(self, pulses: Pulses) -> tuple[TracedPulses, Echoes]:
        """Return the echoes of pulses, hit i that of echo i, and the hits that gave them.

        Args:
            pulses: two or more: NumPy adds the rays of a single one in another order.
        """
        several = self._rays > 1
        vectors = (pulses.origin, pulses.direction, *((pulses.in_plane, pulses.across) if several else ()))
        kept = [np.ascontiguousarray(vector, np.float64) for vector in vectors if vector is not None]
        count = len(pulses.time)
        if len(kept) != len(vectors) or any(vector.shape != (3, count) for vector in kept):
            raise ValueError(f"vectors of pulses {[vector.shape for vector in kept]}: {len(vectors)} of (3, {count})")
        beams = _Beams(count, *(array.ctypes.data for array in (kept if several else kept * 2)))
        first = _Hits.of(self._rays * count, self._fades)
        late = self._met(beams, first, count)
        for hits in (first, late.hits):
            hits.fade()
        made, columns = self._grouped(count, first, late)
        pulse, hit, *others = (column[:made].copy() for column in columns)
        echoes = Echoes(pulse, np.arange(made), *others)
        return self._described(beams, pulses, first, late, pulse, hit), echoes

    def _met(self, beams: _Beams, first: _Hits, count: int) -> _Late:
        """Fill in what the rays of pulses meet first, and return what they meet behind it."""
        size, lot = self._rays * count, max(_LEAST_LOT, _LOT // self._rays // _LEAST_LOT * _LEAST_LOT)
        rows = np.empty((2, max(lot * self._rays, _BUFFER) * 3), np.float32)
        turned, found = np.empty(3 * lot * self._rays), np.empty(max(lot * self._rays, _BUFFER), np.int32)
        passed = [np.empty(size if self._permeable else 0, kind) for kind in (np.int64, np.float64, np.float64)]
        counts, length = np.zeros(2, np.int64), np.empty(self._rays, np.int64)
        shining = _Shining(size if self._shines else 0)
        work = [array.ctypes.data for array in (*rows, turned, found, length)]
        casts, lists = self._caster.casting(), _pointers(*passed)
        head = (ctypes.byref(self._scene), ctypes.byref(casts), ctypes.byref(beams))
        onward = self._kernel.synthroads_first(
            *head, ctypes.byref(first.native), lists, shining.native, counts.ctypes.data, lot, *work
        )
        shining.shine(self._surfaces, first, int(counts[0]))
        layers: list[_Late] = []
        while onward and len(layers) < LAYERS - 1:
            late, casts = _Late.of(onward, self._fades), self._caster.casting()
            head = (ctypes.byref(self._scene), ctypes.byref(casts), ctypes.byref(beams))
            onward = self._kernel.synthroads_behind(
                *head, lists, onward, ctypes.byref(late.native), shining.native, counts.ctypes.data, *work[:2], work[3]
            )
            hits = int(counts[0])
            shining.shine(self._surfaces, late.hits, int(counts[1]))
            layers.append(_Late(late.ray[:hits], late.along[:hits], late.hits.select(hits)))
        return _Late.join(layers, self._fades)

    def _grouped(self, count: int, first: _Hits, late: _Late) -> tuple[int, list[AnyArray]]:
        """Return the number of echoes of so many pulses, and their pulses, hits, ranges, intensities and weights."""
        behind = len(late.ray)
        lot = max(_LEAST_LOT, _LOT // self._rays // _LEAST_LOT * _LEAST_LOT)
        sums, chains = np.empty(8 * lot), [np.empty(size, np.int64) for size in (count, count, behind)]
        most = self._rays + min(behind, self._rays * LAYERS)
        lists = [np.empty(most, np.int64 if i < 3 else np.float64) for i in range(10)]
        columns: list[AnyArray] = [
            np.empty(self._rays * count + behind, np.int64 if i < 2 else np.float64) for i in range(5)
        ]
        made = self._kernel.synthroads_group(
            *(self._rays, count, ctypes.byref(first.native), behind, ctypes.byref(late.native), self._resolution),
            *(lot, sums.ctypes.data, *(array.ctypes.data for array in chains)),
            *(_pointers(*lists), _pointers(*columns)),
        )
        return made, columns

    def _described(
        self, beams: _Beams, pulses: Pulses, first: _Hits, late: _Late, pulse: Index, hit: Index
    ) -> TracedPulses:
        """Return what is known of the hits (N,) of echoes."""
        made = len(hit)
        face, along, distance, direction = np.empty(made, np.int64), np.empty(made), np.empty(made), np.empty((3, made))
        self._kernel.synthroads_describe(
            *(ctypes.byref(item) for item in (self._scene, beams, first.native, late.native)),
            *(made, *(array.ctypes.data for array in (hit, face, along, distance, direction))),
        )
        return TracedPulses(self._target, pulses, pulse, face, along, distance, direction)


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
    yield "synthroads_first", _INT64, [*[_POINTER] * 7, _INT64, *[_POINTER] * 5]
    yield "synthroads_behind", _INT64, [*[_POINTER] * 4, _INT64, *[_POINTER] * 6]
    yield "synthroads_group", _INT64, [_INT64, _INT64, _POINTER, _INT64, _POINTER, _DOUBLE, _INT64, *[_POINTER] * 6]
    yield "synthroads_describe", None, [*[_POINTER] * 4, _INT64, *[_POINTER] * 5]
