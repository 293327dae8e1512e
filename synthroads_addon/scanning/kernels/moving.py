"""Rays cast at moving things in a compiled loop, beside `moving.c`: the bytes of `scene.target.Target.cast`."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...base.arrays import AnyArray, Float
from ..knots import Track
from ..scene.target import Target, TargetPart
from .beams import DOUBLE, INT64, POINTER, BeamShape, pointers
from .hits import OnwardRays
from .library import NoKernelError, load_kernel
from .packets import PacketScene

_BUNDLE, _BOUNDS, _BUFFER = 64, 12, 1024
"""As in moving.c and rays.h."""


class _Part(ctypes.Structure):
    """A rigid body and its track; as `Part` in moving.c."""

    _fields_ = (
        *((name, POINTER) for name in ("cast", "casts", "scene")),
        ("first", INT64),
        ("planes", POINTER),
        ("knots", INT64),
        *((name, DOUBLE) for name in ("begin", "spacing")),
        *((name, POINTER) for name in ("rotation", "position", "way", "present")),
        *((name, DOUBLE) for name in ("radius", "square", "fastest")),
    )


class _Rays(ctypes.Structure):
    """Rays and what they have met; as `Rays` in moving.c, where the cosine is named `along`."""

    _fields_ = (
        *((name, INT64) for name in ("from", "count")),
        *((name, POINTER) for name in ("list", "start", "step")),
        ("beyond", DOUBLE),
        *((name, POINTER) for name in ("reach", "face", "distance", "cosine")),
        ("limit", ctypes.c_float),
    )


class MovingParts:
    """The moving parts of a block's target at their tracks.

    Args:
        kernel: that casts at them.
        parts: of the target.
        motions: their tracks, that span the block.
    """

    def __init__(self, kernel: MovingKernel, parts: Sequence[TargetPart], motions: Sequence[Track]) -> None:
        self._kernel, self._kept = kernel, list[AnyArray]()
        self._bodies, self._casters = list[_Part](), list[PacketScene]()
        for part, track in zip(parts, motions, strict=True):
            if part.count and track.present.any():
                self._add(part, track)

    def __len__(self) -> int:
        return len(self._bodies)

    def _add(self, part: TargetPart, track: Track) -> None:
        """Add a part that is there, as the kernel takes it, and hold on to the arrays that it points to."""
        assert isinstance(part.caster, PacketScene)
        way = track.way_of(part.centre)
        fastest = float(np.sqrt(np.square(np.diff(way, axis=1)).sum(axis=0).max())) / track.spacing  # m/s
        arrays = [np.ascontiguousarray(array, np.float64) for array in (track.rotation, track.position, way)]
        arrays.append(np.ascontiguousarray(track.present, np.bool_))
        cast, scene = part.caster.native
        planes = part.planes.planes
        self._kept += [*arrays, planes]
        self._casters.append(part.caster)
        track_fields = (way.shape[1], track.begin, track.spacing, *(array.ctypes.data for array in arrays))
        sphere_fields = (part.radius, part.radius**2, fastest)
        self._bodies.append(_Part(cast, None, scene, part.first, planes.ctypes.data, *track_fields, *sphere_fields))

    def cast(
        self,
        shape: BeamShape,
        beams: ctypes.Structure,
        first_ray: int,
        onward: OnwardRays | None,
        hit_arrays: tuple[AnyArray, Float, Float],
        maximum_range: float,
    ) -> None:
        """Replace, in place, what rays have met by what moves, where they meet that nearer.

        Args:
            shape: of the beam.
            beams: the pulses, `Beams`.
            first_ray: number of the first of each pulse's rays that is cast.
            onward: (N,) rays that go on behind surfaces; None for the rays (K, P) of the pulses.
            hit_arrays: (K, P) or (N,) faces, int32, ranges, m, and n . d; ranges count from where a ray goes on.
            maximum_range: m.
        """
        if not self._bodies:
            return
        face, distance, cosine = hit_arrays
        reach = np.minimum(distance, maximum_range)
        ray_count = beams.pulses if onward is None else len(onward.ray)
        bundles = -(-ray_count // _BUNDLE)
        onward_fields: tuple[Any, ...] = (0, None, None, None, 0.0)
        if onward is not None:
            step = None if onward.step is None else onward.step.ctypes.data
            onward_fields = (ray_count, onward.ray.ctypes.data, onward.start.ctypes.data, step, onward.usual_step)
        met_fields = (array.ctypes.data for array in (reach, face, distance, cosine))
        rays = _Rays(first_ray, *onward_fields, *met_fields, maximum_range)
        # Room that the loop works in: bounds of the bundles, rays near a body, and these as a caster takes them.
        work: list[AnyArray] = [np.empty((bundles, _BOUNDS)), np.empty((_BUFFER, 6)), np.empty(bundles, np.uint8)]
        work += [np.empty(_BUFFER, np.int64), *np.empty((2, _BUFFER, 3), np.float32), np.empty(_BUFFER, np.int32)]
        # From call to call a packet's rays are judged by those before them of the same call alone.
        castings = [caster.casting() for caster in self._casters]
        bodies = (_Part * len(castings))(*self._bodies)
        for body, casting in zip(bodies, castings, strict=True):
            body.casts = ctypes.addressof(casting)
        self._kernel.call(
            ctypes.byref(shape.native), ctypes.byref(beams), len(castings), bodies, ctypes.byref(rays), pointers(*work)
        )


class MovingKernel:
    """The compiled loop over what moves in a target; any threads may use it side by side.

    Args:
        target: what is scanned.

    Raises:
        NoKernelError: this machine has none, or rays aren't cast in packets.
    """

    def __init__(self, target: Target) -> None:
        self._parts = target.moving_parts
        if any(part.count and not isinstance(part.caster, PacketScene) for part in self._parts):
            raise NoKernelError("no rays are cast in packets at what moves")
        self.call = load_kernel("moving").synthroads_moving
        self.call.restype, self.call.argtypes = None, [POINTER, POINTER, INT64, POINTER, POINTER, POINTER]

    def at(self, motions: Sequence[Track]) -> MovingParts:
        """Return the moving parts at their tracks, which span a block."""
        return MovingParts(self, self._parts, motions)
