"""Pulses and the rays that sample them, as the kernels and NumPy see them, beside `rays.h`."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.arrays import AnyArray, Float, Index
from ..beam import BeamPattern, beam_factors, beam_radii
from ..pulses import Pulses

POINTER, INT64, DOUBLE = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


class Shape(ctypes.Structure):
    """Rays of a pulse; as `Shape` in rays.h."""

    _fields_ = (
        ("rays", INT64),
        *((name, POINTER) for name in ("stretch", "in_plane", "across", "share")),
        ("parallel", ctypes.c_int32),
    )


class Beams(ctypes.Structure):
    """Pulses; as `Beams` in rays.h."""

    _fields_ = (("pulses", INT64), *((name, POINTER) for name in ("origin", "direction", "in_plane", "across", "time")))


def pointers(*arrays: AnyArray) -> ctypes.Array[Any]:
    """Return the addresses of arrays side by side, as structures of C that hold nothing else have them."""
    return (POINTER * len(arrays))(*(array.ctypes.data for array in arrays))


class BeamShape:
    """The K rays of a scan's pulses: how each is deflected, and its share of the energy.

    Args:
        pattern: of the rays.
        divergence: of the beam, two full angles at 1/e2, rad.
        parallel: the rays begin side by side and run parallel, in place of diverging.

    Attributes:
        rays: K.
        parallel: as given; False for a single ray.
        share: (K,) of the energy.
        native: for kernels.
    """

    def __init__(self, pattern: BeamPattern, divergence: tuple[float, float], parallel: bool) -> None:
        self.rays, self.parallel, self.share = len(pattern), parallel and len(pattern) > 1, pattern.weights
        if self.parallel:
            radii = beam_radii(divergence)
            x, y = (pattern.across[:, i] * radii[i] for i in range(2))
            factors = (np.ones(self.rays), x, y)
        else:
            factors = beam_factors(pattern, divergence)
        self.factors = tuple(np.ascontiguousarray(array, np.float64) for array in factors)
        self._kept = (*self.factors, np.ascontiguousarray(pattern.weights, np.float64))
        self.native = Shape(self.rays, *(array.ctypes.data for array in self._kept), self.parallel)


@dataclass(frozen=True)
class BeamRays:
    """K rays of each of P pulses, worked out where they are asked for: `trace.Rays` for those of whom few are.

    Attributes:
        shape: of the beam.
        pulses: P of them; of parallel rays the beam's axes are as long as its range.
    """

    shape: BeamShape
    pulses: Pulses

    @classmethod
    def of(cls, shape: BeamShape, pulses: Pulses, reach: Float | None) -> BeamRays:
        """Return the rays of pulses.

        Args:
            shape: of the beam.
            pulses: P of them.
            reach: (P,) range of what their axes meet, m, by which parallel rays are placed, see `cylindrical_offsets`.

        Raises:
            ValueError: a vector of the pulses is missing, or there are too few.
        """
        names = ("origin", "direction", *(("in_plane", "across") if shape.rays > 1 else ()))
        vectors, count = [getattr(pulses, name) for name in names], len(pulses.time)
        if any(vector is None or vector.shape != (3, count) for vector in vectors):
            shapes = {
                name: None if vector is None else vector.shape for name, vector in zip(names, vectors, strict=True)
            }
            raise ValueError(f"vectors of pulses must each have the shape (3, {count}), but have {shapes}")
        if reach is not None:
            assert pulses.in_plane is not None
            assert pulses.across is not None
            footprint_range = np.where((reach > 0.0) & (reach < np.inf), reach, 0.0)
            in_plane, across = pulses.in_plane * footprint_range, pulses.across * footprint_range
            pulses = replace(pulses, in_plane=in_plane, across=across)
        return cls(shape, pulses)

    @property
    def share(self) -> Float:
        """Return the shares (K, 1) of the pulse's energy."""
        return self.shape.share[:, None]

    @property
    def time(self) -> Float:
        """Return when the pulses are emitted, (P,), s."""
        return self.pulses.time

    def pick(self, ray: Index) -> tuple[Float, Float]:
        """Return origins and directions (3, N) of chosen rays, as k * P + p for ray k of pulse p."""
        ray_number, pulse = np.divmod(ray, len(self.time))
        pulses = self.pulses
        length, x, y = (np.take(factor, ray_number) for factor in self.shape.factors)
        origin, direction = (np.take(vectors, pulse, axis=1) for vectors in (pulses.origin, pulses.direction))
        if self.shape.rays == 1:
            return origin, direction
        assert pulses.in_plane is not None
        assert pulses.across is not None
        in_plane, across = np.take(pulses.in_plane, pulse, axis=1), np.take(pulses.across, pulse, axis=1)
        if self.shape.parallel:  # origins lie side by side
            in_plane *= x
            in_plane += across * y
            return origin + in_plane, direction
        # Rays diverge: length times the axis, and the two deflections.
        direction *= length
        direction += in_plane * x
        direction += across * y
        return origin, direction

    def native(self) -> tuple[Beams, list[AnyArray]]:
        """Return the pulses for kernels, and the arrays that must be kept as long as these use them."""
        pulses, has_frame = self.pulses, self.shape.rays > 1
        vectors = (pulses.origin, pulses.direction, *((pulses.in_plane, pulses.across) if has_frame else ()))
        arrays = [np.ascontiguousarray(vector, np.float64) for vector in (*vectors, pulses.time)]
        address = [array.ctypes.data for array in arrays]
        frame = address[2:4] if has_frame else address[:2]
        return Beams(len(pulses.time), *address[:2], *frame, address[-1]), arrays
