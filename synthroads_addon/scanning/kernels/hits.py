"""Room for what rays meet, as loops over pulses write it, beside `pulses.c`; and the hits of echoes that come of it."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import AnyArray, Float, Index
from ...materials.reflectance import retroreflection
from ...materials.surfaces import Surfaces
from ..pulses import Pulses
from ..receiving.radiometry import received_intensity
from ..returns import HitSignals
from ..scene.target import Target
from ..trace import BEYOND
from .beams import POINTER, pointers


class Met(ctypes.Structure):
    """Hits; as `Met` in pulses.c, where the cosine is named `along`."""

    _fields_ = tuple(
        (name, POINTER) for name in ("face", "distance", "intensity", "weight", "fading", "cosine", "share")
    )


class Behind(ctypes.Structure):
    """Hits behind surfaces; as `Behind` in pulses.c."""

    _fields_ = (("ray", POINTER), ("met", Met))


def address_of(array: AnyArray | None) -> int | None:
    """Return the address of an array; None for NULL, of none."""
    return None if array is None else array.ctypes.data


class Passed(ctypes.Structure):
    """Light that goes on; as `Passed` in pulses.c, where light is named `left`."""

    _fields_ = tuple((name, POINTER) for name in ("ray", "light", "start", "step", "face"))


class Ahead(ctypes.Structure):
    """Hits of rays that go on, before they are weighed; as `Ahead` in pulses.c, where the cosine is named `along`."""

    _fields_ = tuple((name, POINTER) for name in ("face", "distance", "cosine", "through"))


@dataclass(frozen=True)
class HitRows:
    """Hits and what they send back, (N,) each.

    Attributes:
        face: number of the face.
        distance: m; inf where it is out of reach.
        intensity: received, without what the air takes.
        weight: in mean ranges.
        fading: exponent of what the air leaves; None where it takes nothing.
        cosine: n . d of the face's normal and the ray; None where it is worked out again for those that are asked for.
        share: of the pulse's energy that the surface takes; None where nobody asks.
    """

    face: AnyArray
    distance: Float
    intensity: Float
    weight: Float
    fading: Float | None
    cosine: Float | None
    share: Float | None

    @classmethod
    def of(cls, count: int, fades: bool, cosine: bool, share: bool) -> HitRows:
        """Return uninitialised arrays for ``count`` hits.

        Args:
            count: of hits.
            fades: whether the air weakens light, so that ``fading`` is needed.
            cosine, share: whether these arrays are needed.
        """
        distance, intensity, weight = (np.empty(count) for _ in range(3))
        optional_arrays = (np.empty(count) if flag else None for flag in (fades, cosine, share))
        return cls(np.empty(count, np.int32), distance, intensity, weight, *optional_arrays)

    @property
    def native(self) -> Met:
        """Return the addresses of the arrays, as pulses.c takes them."""
        return Met(*(address_of(getattr(self, item[0])) for item in Met._fields_))

    def select(self, count: int) -> HitRows:
        """Return the first ``count`` hits, as views."""
        arrays: list[Any] = [getattr(self, field.name) for field in fields(self)]
        selected_arrays: list[Any] = [None if array is None else array[:count] for array in arrays]
        return HitRows(*selected_arrays)

    def fade(self) -> None:
        """Replace the exponents of what the air leaves of the light by factors, in place."""
        if self.fading is not None:
            with np.errstate(under="ignore"):
                np.exp(self.fading, out=self.fading)

    def signals(self, shape: tuple[int, ...]) -> HitSignals:
        """Return the signals that hits send back, less what the air takes, in a shape; call `fade` before."""
        intensity = self.intensity if self.fading is None else self.intensity * self.fading
        return HitSignals(*(array.reshape(shape) for array in (self.distance, self.weight, intensity)))


@dataclass(frozen=True)
class LateHits:
    """Hits behind surfaces that let light through, (N,) each.

    Attributes:
        ray: k * P + p for ray k of pulse p.
        hits: the rest; they always have ``cosine``.
    """

    ray: Index
    hits: HitRows

    @classmethod
    def of(cls, count: int, fades: bool, share: bool) -> LateHits:
        """Return uninitialised arrays for ``count`` hits, see `HitRows.of`."""
        return cls(np.empty(count, np.int64), HitRows.of(count, fades, cosine=True, share=share))

    @property
    def native(self) -> Behind:
        """Return the addresses of the arrays, as pulses.c takes them."""
        return Behind(self.ray.ctypes.data, self.hits.native)

    @classmethod
    def join(cls, parts: list[LateHits], fades: bool, share: bool) -> LateHits:
        """Return hits of several parts as one, in the order of the parts; the flags tell the arrays of no hits."""
        if not parts:
            return cls.of(0, fades, share)
        hits = [part.hits for part in parts]
        columns = ([getattr(part_hits, field.name) for part_hits in hits] for field in fields(HitRows))
        joined_columns: list[Any] = [None if column[0] is None else np.concatenate(column) for column in columns]
        return cls(np.concatenate([part.ray for part in parts]), HitRows(*joined_columns))


class OnwardRays(NamedTuple):
    """Rays (N,) that go on behind surfaces.

    Attributes:
        ray: k * P + p for ray k of pulse p.
        start: range of the surface that it has passed, m.
        step: how far behind that it goes on, m; None where all go on as far.
        usual_step: that distance, m.
    """

    ray: Index
    start: Float
    step: Float | None
    usual_step: float


@dataclass(frozen=True)
class OnwardLight:
    """Room for rays that go on behind surfaces, (N,) each.

    Attributes:
        ray: k * P + p for ray k of pulse p.
        light: that it keeps, as a share of the pulse's energy.
        start: range of the surface that it has passed, m.
        step: how far behind that it goes on, m; None where no material is clear in places.
        face: that it has passed; None likewise.
    """

    ray: Index
    light: Float
    start: Float
    step: Float | None
    face: AnyArray | None

    @classmethod
    def of(cls, count: int, clear: bool) -> OnwardLight:
        """Return uninitialised arrays for ``count`` rays.

        Args:
            count: of rays.
            clear: whether some materials are clear in places, so that steps and faces are needed.
        """
        optional_arrays = (np.empty(count), np.empty(count, np.int32)) if clear else (None, None)
        return cls(np.empty(count, np.int64), np.empty(count), np.empty(count), *optional_arrays)

    @property
    def native(self) -> Passed:
        """Return the addresses of the arrays, as pulses.c takes them."""
        return Passed(*(address_of(getattr(self, item[0])) for item in Passed._fields_))

    def onward(self, count: int) -> OnwardRays:
        """Return the first ``count`` rays, as views."""
        return OnwardRays(
            self.ray[:count], self.start[:count], None if self.step is None else self.step[:count], BEYOND
        )


@dataclass(frozen=True)
class TracedPulses:
    """Hits that gave a block's echoes; hit i gave echo i.

    Attributes:
        target: what was scanned.
        pulses: the block's.
        pulse: (N,) of each hit.
        face: (N,) that was hit.
        cosine: (N,) n . d of its normal and the ray.
        distance: (N,) range of the hit, m.
        direction: (3, N) of its ray.
        begin: (3, N) where its ray begins, local, m; None for where its pulse does.
    """

    target: Target
    pulses: Pulses
    pulse: Index
    face: Index
    cosine: Float
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


class ShiningHits:
    """Room for hits whose surface sends light back the way that it came.

    Args:
        count: hits at most.
    """

    def __init__(self, count: int) -> None:
        self._hit = np.empty(count, np.int64)
        self._cosine, self._brightness, self._share = (np.empty(count) for _ in range(3))
        self._material = np.empty(count, np.uint16)
        self.native = pointers(self._hit, self._cosine, self._brightness, self._share, self._material)

    def shine(self, surfaces: Surfaces, hits: HitRows, count: int) -> None:
        """Add what their surfaces send back the way that it came to the intensities of hits, in place.

        Args:
            surfaces: the materials.
            hits: all hits of the call.
            count: number of those, noted in this object, whose surfaces do so.
        """
        if not count:
            return
        hit, material = self._hit[:count], self._material[:count]
        retro, lobe = np.take(surfaces.retro, material), np.take(surfaces.inverse_lobe_squared, material)
        brightness = self._brightness[:count] + retroreflection(self._cosine[:count], retro, lobe)
        brightness *= self._share[:count]
        hits.intensity[hit] = received_intensity(brightness, np.take(hits.distance, hit))
