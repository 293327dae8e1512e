"""Finish of points after the scan: intensities from layers meet the detector as any others do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from synthroads_addon.materials.reflectance import reflectivity
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.colour.colour import MaterialLayers, surface_constants
from synthroads_addon.scanning.finish import Finish
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scan import BlockResult
from tests.helpers.scenes.scan_scenes import altered, mesh_of, middle_pulses, plane, scan_of

KEPT = frozenset({"color_source", "true_xyz", "normal", "material", "scanner", "true_range"})


class Striped:
    """Layers of the material, but for the base colour, which is dark where x is negative and bright elsewhere."""

    main_thread_only = False

    def __init__(self, material: str, dark: float, bright: float) -> None:
        self.report: dict[str, Any] = {}
        self.material = MaterialLayers(surface_constants([materials()[material]]))
        self.dark, self.bright = dark, bright

    def sample(self, points, names):
        values = self.material.sample(points, names)
        values.arrays["base_color"] *= np.where(points.position[:, :1] < 0.0, self.dark, self.bright).astype(np.float32)
        return values


def finish_of(scan: ScanPlan, source: Any, corrected: bool = False) -> Callable[[BlockResult], BlockResult]:
    plan = altered(scan, means=scan.reflection.surfaces, range_corrected=corrected, kept=KEPT)
    return Finish(plan, source).finish_block


def detected_later(scan: ScanPlan) -> ScanPlan:
    layers = scan.layers.measured | {"material"}
    return altered(scan, seen_points=True, after_layers=True, measured=layers)


def finished(scan: ScanPlan, dark: float, bright: float, material: str = "asphalt") -> BlockResult:
    later = detected_later(scan)
    return finish_of(later, Striped(material, dark, bright))(middle_pulses(later, 200))


def local_x(result: BlockResult) -> np.ndarray:
    assert result.points.true_xyz is not None
    return result.points.true_xyz[:, 0] - 294_000.0


def flying(**changes: Any) -> ScanPlan:
    """Return a scan of a plane, half of whose points have negative x."""
    scan = scan_of(plane(), **changes)
    scan.path.pose = lambda strip, time: (  # type: ignore[method-assign]
        np.stack([4e4 * (time - 0.0025), 0.0 * time, 60.0 + 0.0 * time], axis=1),
        np.broadcast_to(np.eye(3), (len(time), 3, 3)),
    )
    return scan


def test_layers_that_are_the_materials_change_nothing() -> None:
    scan = flying(threshold=0.0, saturation=1e-4)
    plain, by_layers = middle_pulses(scan, 200), finished(scan, 1.0, 1.0)
    assert by_layers.saturated == plain.saturated
    np.testing.assert_allclose(by_layers.points.intensity, plain.points.intensity, rtol=1e-6)
    np.testing.assert_array_equal(by_layers.points.return_number, plain.points.return_number)


def test_dark_patches_are_lost_and_bright_ones_found() -> None:
    """The threshold lies just above the mean: the scan by itself records nothing, the pattern's bright half is seen."""
    base = middle_pulses(flying(), 200)
    limit = 1.05 * base.points.intensity.max()
    scan = flying(threshold=limit)
    assert len(middle_pulses(scan, 200).points) == 0
    found = finished(scan, 0.3, 1.8)
    assert 50 < len(found.points) < 150
    assert (local_x(found) >= 0.0).all()
    assert found.below_threshold == 200 - len(found.points)
    assert (found.points.intensity >= limit).all()
    row = materials()["asphalt"]
    dark, mean = (float(reflectivity(np.array(row.base_color) * f, row.metallic, row.specular)) for f in (0.3, 1.0))
    limit = 0.5 * (1.0 + dark / mean) * base.points.intensity.min()
    left = finished(flying(threshold=limit), 0.3, 1.8)
    expected = (local_x(base) >= 0.0) | (base.points.intensity * dark / mean >= limit)
    assert 100 <= expected.sum() < 150
    np.testing.assert_array_equal(left.points.gps_time, base.points.gps_time[expected])


def test_bright_patches_saturate() -> None:
    base = middle_pulses(flying(), 200).points.intensity
    limit = 1.05 * base.max()
    found = finished(flying(saturation=limit), 0.3, 1.8)
    bright = local_x(found) >= 0.0
    assert found.saturated == bright.sum() > 50
    np.testing.assert_array_equal(found.points.intensity[bright], limit)
    # What the mean would saturate keeps its own intensity where it is dark.
    row = materials()["asphalt"]
    dark = reflectivity(np.zeros(3), row.metallic, row.specular)
    dark /= reflectivity(row.base_color, row.metallic, row.specular)
    assert float(dark) < 0.94
    unsaturated = finished(flying(saturation=0.95 * base.min()), 0.0, 1.8).points.intensity
    np.testing.assert_allclose(unsaturated[~bright], dark * base[~bright], rtol=1e-6)


@pytest.mark.parametrize("most", [5, 1])
def test_what_passes_is_numbered_anew(most: int) -> None:
    """A dark strip above the ground takes a part of each footprint, and is lost for its own darkness.

    It takes no place among the returns that the device can tell apart.
    """
    x = (-40.0, 0.0)
    strip = [(a, b, 3.0) for a in x for b in np.arange(-30.0, 30.0, 0.1)]
    count = len(strip) // 2
    faces = [(i, i + 1, count + i) for i in range(0, count - 1, 2)]
    ground = [(a, b, 0.0) for a in (-99.0, 99.0) for b in (-99.0, 99.0)]
    first = len(strip)
    mesh = mesh_of(strip + ground, [*faces, (first, first + 2, first + 3), (first, first + 3, first + 1)])
    scan = altered(scan_of(mesh, rays=19), seen_points=True, after_layers=True)
    scan.path.pose = lambda strip, time: (  # type: ignore[method-assign]
        np.tile([-10.0, 0.0, 60.0], (len(time), 1)),
        np.broadcast_to(np.eye(3), (len(time), 3, 3)),
    )

    class HighIsDark(Striped):
        def sample(self, points, names):
            values = super().sample(points, names)
            for name in ("base_color", "specular"):
                values.arrays[name][points.position[:, 2] > 1.0] = 0.0
            return values

    raw = middle_pulses(scan, 300)
    assert (raw.points.number_of_returns == 2).sum() > 50
    device = scan.setting.device.model_copy(update={"maximum_returns": most})
    setting = replace(scan.setting, threshold=1e-3 * raw.points.intensity.min(), device=device)
    scan = altered(scan, setting=setting)
    result = finish_of(scan, HighIsDark("asphalt", 1.0, 1.0))(middle_pulses(scan, 300))
    assert result.below_threshold == len(raw.points) - len(result.points) > 50
    assert (result.points.number_of_returns == 1).all()
    assert (result.points.return_number == 1).all()
    assert result.points.true_xyz is not None
    assert (result.points.true_xyz[:, 2] < 181.0).all()


def test_what_dims_a_surface_dims_its_beads_as_well() -> None:
    """A retro-reflecting surface sends as much less back as its layers are darker, beads and all."""
    name = next(name for name, row in materials().items() if row.retroreflection > 0.0)
    scan = scan_of(replace(plane(), materials=(name,)))
    row = materials()[name]
    dirty = reflectivity(tuple(0.3 * part for part in row.base_color), row.metallic, row.specular)
    plain, found = middle_pulses(scan, 200).points.intensity, finished(scan, 0.3, 0.3, name).points.intensity
    assert found / plain == pytest.approx(float(dirty) / row.reflectivity, rel=1e-5)


def test_corrected_intensities_do_not_depend_on_the_range() -> None:
    """A plane from far and from near: as received they differ by the squares, corrected they are the same."""
    found = {}
    for height in (20.0, 60.0):
        scan = flying()
        pose = scan.path.pose
        scan.path.pose = lambda strip, time, pose=pose, height=height: (  # type: ignore[method-assign]
            pose(strip, time)[0] * [1.0, 1.0, height / 60.0],
            pose(strip, time)[1],
        )
        later = detected_later(scan)
        source = Striped("asphalt", 0.2, 0.2)
        both = [finish_of(later, source, corrected=corrected)(middle_pulses(later, 200)) for corrected in (False, True)]
        received, corrected = (result.points for result in both)
        np.testing.assert_allclose(corrected.intensity, received.intensity * received.range**2, rtol=1e-12)
        found[height] = [float(np.median(points.intensity)) for points in (received, corrected)]
    assert found[20.0][0] == pytest.approx(9.0 * found[60.0][0], rel=0.01)
    assert found[20.0][1] == pytest.approx(found[60.0][1], rel=0.01)
