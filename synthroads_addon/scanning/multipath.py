"""Ghost echoes by multipath: light that a surface mirrors onto another one, and that comes back the same way.

A wet road, the steel of a barrier, a pane or the paint of a car mirrors a share F of the beam at the range d. What the
mirrored beam meets e farther on sends light back over the same mirror, and the scanner places it at the range d + e in
the mirror's direction: behind it, below the ground, where the mirrored surface's image is. The echo is as bright as
that surface at this range, times F^2 and times a share that is lost because the mirror isn't even. F follows from the
reflectance at a right angle F0 and the incidence angle t by Schlick's approximation (1994, An inexpensive BRDF model
for physically-based rendering, Computer Graphics Forum 13),

    F = F0 + (1 - F0) (1 - cos t)^5.

Facets with slopes of the standard deviation s turn the light by 2 s, once on each way. A spot that the beam lights e
behind the mirror is then blurred, as seen from the scanner, to about 4 s e / (d + e), of which a receiver sees what
lies within its field of view, here the beam's full angle g:

    share = 1 / (1 + (4 s e / ((d + e) g))^2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Float, Index
from ..materials.surfaces import Surfaces, brightness_of
from ..materials.table import Material
from .devices.device import BRIGHTEST, ScannerSetting
from .knots import Track
from .receiving.detector import PROVISIONAL_THRESHOLD
from .receiving.radiometry import received_intensity
from .returns import LEAST_REFLECTANCE, HitSignals
from .scene.target import Target
from .trace import Hits, TracedRays

COATED, WATER = 0.04, 0.02
"""Reflectances at a right angle of paint and glass, with a refractive index of 1.5, and of water, with one of 1.33."""
FILM_SLOPE = 0.01
"""Slope of the surface of a film of water, rad: assumed."""
MATT = 0.1
"""Surfaces with facets of this slope or more, rad, don't mirror: what they blur is too faint."""
_OFF_SURFACE = 1e-3
"""How far from its mirror a mirrored ray begins, m."""


@dataclass(frozen=True)
class Mirrors:
    """How M materials mirror light.

    Attributes:
        reflectance: (M,) at a right angle; 0 for those that don't.
        slope: (M,) of their facets, rad.
    """

    reflectance: Float
    slope: Float


def mirrors_of(rows: Sequence[Material], films: Sequence[float]) -> Mirrors:
    """Return how materials mirror light.

    Args:
        rows: M materials.
        films: share of each, 0 to 1, that a film of water covers.
    """
    slope = np.array([row.slope for row in rows])
    bare_reflectance = np.array([row.metallic * row.reflectivity + (1.0 - row.metallic) * COATED for row in rows])
    film = np.asarray(films, dtype=np.float64)
    is_wet = film > 0.0
    reflectance = np.where(is_wet, film * WATER, np.where(slope < MATT, bare_reflectance, 0.0))
    return Mirrors(reflectance, np.where(is_wet, FILM_SLOPE, slope))


def mirrored_share(reflectance: Float, cosine: Float) -> Float:
    """Return the share (N,) of the light that a mirror reflects, by Schlick's approximation; 0 for what isn't a mirror.

    Args:
        reflectance: (N,) at a right angle, F0 of the formula above.
        cosine: (N,) cos t of the incidence angle.
    """
    return np.asarray(reflectance + np.where(reflectance > 0.0, 1.0 - reflectance, 0.0) * (1.0 - cosine) ** 5)


def seen_share(slope: Float, mirror_range: Float, range_beyond: Float, angle: float) -> Float:
    """Return the share (N,) of a blurred image that lies within the receiver's field of view.

    Args:
        slope: (N,) of the mirror's facets, rad.
        mirror_range, range_beyond: (N,) range of the mirror, and what the light goes behind it, m.
        angle: the field of view, rad.
    """
    blur = 4.0 * slope * range_beyond / np.maximum(mirror_range + range_beyond, 1e-9)
    return np.asarray(1.0 / (1.0 + (blur / max(angle, 1e-9)) ** 2))


@dataclass(frozen=True)
class Multipath:
    """Ghost echoes of a scan.

    Attributes:
        mirrors: how the scene's materials mirror light.
        strength: factor on the echoes' power.
    """

    mirrors: Mirrors
    strength: float

    def ghosts(
        self,
        target: Target,
        surfaces: Surfaces,
        setting: ScannerSetting,
        attenuation: float,
        traced_rays: TracedRays,
        motions: list[Track],
    ) -> tuple[Hits, Index, HitSignals]:
        """Return the ghosts of a block's rays as hits in the air, the rays that they are of, and their signals.

        Args:
            target: the scene.
            surfaces: its materials.
            setting: the scanner's.
            attenuation: 1/m of range.
            traced_rays: what the rays meet first: only that mirrors.
            motions: of the target's moving parts.
        """
        ray, share = self._mirroring(setting, surfaces, traced_rays)
        if not len(ray):
            zeros, nothing = np.empty(0, dtype=np.intp), np.empty(0)
            return Hits(zeros, zeros, nothing, nothing, nothing), zeros, HitSignals(nothing, nothing, nothing)
        first_hits, rays = traced_rays.first, traced_rays.rays
        mirror_range, pulse = np.take(first_hits.distance, ray), ray % len(rays.time)
        normal = target.normals(
            np.take(first_hits.face, ray), np.take(first_hits.cosine, ray), rays.time[pulse], motions
        )
        origin, direction = rays.pick(ray)
        place = origin + mirror_range * direction + _OFF_SURFACE * normal
        # Law of reflection: d' = d - 2 (d . n) n.
        mirrored_direction = direction - 2.0 * np.einsum("ij,ij->j", direction, normal) * normal
        mirrored_hits = target.cast(place, mirrored_direction, setting.maximum_range, rays.time[pulse], motions)
        distance = mirror_range + mirrored_hits.distance
        recorded_rows = np.flatnonzero((mirrored_hits.face >= 0) & (distance <= setting.maximum_range))
        ray, share, distance = ray[recorded_rows], share[recorded_rows], distance[recorded_rows]
        material = np.take(target.material, mirrored_hits.face[recorded_rows]).astype(np.intp)
        slope = self.mirrors.slope[np.take(first_hits.material, ray)]
        share = share * seen_share(
            slope, mirror_range[recorded_rows], mirrored_hits.distance[recorded_rows], setting.beam_angle
        )
        brightness = share * brightness_of(surfaces, material, np.abs(mirrored_hits.cosine[recorded_rows]))
        zeros = np.zeros(len(recorded_rows), dtype=np.intp)
        # What comes from nowhere has no face; it counts as one that lies across the beam.
        hits = Hits(zeros - 1, zeros, distance, zeros - 1.0, brightness)
        weight = np.maximum(brightness, LEAST_REFLECTANCE)
        return hits, ray, HitSignals(distance, weight, received_intensity(brightness, distance, attenuation))

    def _mirroring(self, setting: ScannerSetting, surfaces: Surfaces, traced_rays: TracedRays) -> tuple[Index, Float]:
        """Return the rays (N,) whose light may come back over a mirror, and the share (N,) of it that does so at most.

        Rays whose ghosts couldn't be detected even if all of this came back from the brightest surface are left out.
        """
        first_hits = traced_rays.first
        material = first_hits.material.ravel()
        reflectance = np.take(self.mirrors.reflectance, material)
        ray = np.flatnonzero(
            (reflectance > 0.0) & (first_hits.face.ravel() >= 0) & np.isfinite(first_hits.distance.ravel())
        )
        cosine = np.minimum(np.abs(np.take(first_hits.cosine, ray)), 1.0)
        ray_share = np.take(np.broadcast_to(traced_rays.rays.share, first_hits.face.shape), ray)
        share = ray_share * self.strength * mirrored_share(reflectance[ray], cosine) ** 2
        brightest = BRIGHTEST if surfaces.retroreflective else 1.0
        faintest = PROVISIONAL_THRESHOLD * setting.threshold * np.take(first_hits.distance, ray) ** 2
        detectable = np.flatnonzero(share * brightest > faintest)
        return ray[detectable], share[detectable]
