"""Tilts of normals by images: where they lie, which way their sides run, and how beams average them."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway
from synthroads_addon.scanning.relief.normal_images import NormalImage, NormalImages
from synthroads_addon.scanning.relief.pavement import PavementRelief
from tests.helpers.effects.road_cases import base_road

TILE, PIXELS, HEIGHT = 2.0, 256, 0.02
LEAN = (0.3, -0.2)
"""Tilt to an image's right and upwards."""


def encoded(slope: Float) -> Float:
    """Return pixels (H, W, 3), 0 to 1, of normals with slopes (H, W, 2) of the surface."""
    normal = np.dstack([-slope, np.ones(slope.shape[:2])])
    return np.asarray((normal / np.linalg.norm(normal, axis=2)[..., None] + 1.0) / 2.0)


def waves() -> NormalImage:
    """Return the image of a surface that is HEIGHT sin(2 pi x / TILE) high."""
    x = (np.arange(PIXELS) + 0.5) / PIXELS * TILE
    slope = np.zeros((PIXELS, PIXELS, 2))
    slope[..., 0] = slope_at(x)
    return NormalImage.of(encoded(slope), TILE, False)


def slope_at(x: Float) -> Float:
    return np.asarray(HEIGHT * 2.0 * np.pi / TILE * np.cos(2.0 * np.pi * x / TILE))


def leaning(along: bool) -> NormalImage:
    """Return an image of one normal, which leans by LEAN."""
    return NormalImage.of(encoded(np.tile(-np.array(LEAN), (4, 4, 1))), TILE, along)


def test_tilts_are_the_falls_of_the_surface_and_repeat() -> None:
    place = np.random.default_rng(1).uniform(-7.0, 7.0, (5000, 2))
    tilts = waves().tilts(place, np.zeros(len(place)))
    assert tilts[:, 0] == pytest.approx(-slope_at(place[:, 0]), abs=1e-4)
    assert tilts[:, 1] == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize(("footprint", "least", "most"), [(0.25, 0.9, 1.0), (0.5, 0.6, 0.9), (2.0, 0.0, 1e-3)])
def test_a_wide_beam_sees_their_mean(footprint: float, least: float, most: float) -> None:
    place = np.random.default_rng(2).uniform(0.0, TILE, (4000, 2))
    tilts = waves().tilts(place, np.full(len(place), footprint))
    share = np.std(tilts[:, 0]) / np.std(slope_at(place[:, 0]))
    assert least <= share <= most


@pytest.mark.parametrize(
    ("normal", "width", "height"),
    [
        ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((0.1, -0.2, -0.97), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((0.9, 0.2, 0.1), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        ((0.2, -0.9, 0.1), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ],
)
def test_off_the_road_sides_run_along_the_worlds_axes(
    normal: tuple[float, ...], width: tuple[float, ...], height: tuple[float, ...]
) -> None:
    images = NormalImages({3: leaning(True)}, None)
    material, place = np.array([0, 3, 3, 65535]), np.random.default_rng(3).uniform(-9.0, 9.0, (4, 3))
    turned = np.tile(np.array(normal) / np.linalg.norm(normal), (4, 1))
    rows, tilts = images.tilts(material, np.zeros(4, np.int64), place, place, turned, np.zeros(4))
    assert rows.tolist() == [1, 2]
    assert tilts == pytest.approx(np.tile(LEAN[0] * np.array(width) + LEAN[1] * np.array(height), (2, 1)), abs=1e-6)


def test_on_the_road_they_run_along_station_and_offset() -> None:
    parameters = RoadParameters.from_dict(base_road({}))
    geometry, random = RoadGeometry(parameters), np.random.default_rng(4)
    right = parameters.carriageway("right")
    assert isinstance(right, Carriageway)
    station = random.uniform(5.0, geometry.length - 5.0, 400)
    offset = random.uniform(-8.0, -4.0, 400)
    place = geometry.point(station, offset)
    heading = geometry.alignment.heading(station)
    forwards = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(400)])
    left = np.column_stack([-np.sin(heading), np.cos(heading), np.zeros(400)])
    up = np.tile([0.0, 0.0, 1.0], (400, 1))
    instance = np.where(np.arange(400) % 2, right.instance, 0)
    images = NormalImages({0: leaning(True)}, PavementRelief(geometry))
    at = place + parameters.transform.translate
    rows, tilts = images.tilts(np.zeros(400, np.int64), instance, at, place, up, np.zeros(400))
    assert len(rows) == 400
    assert tilts[1::2] == pytest.approx((LEAN[0] * forwards + LEAN[1] * left)[1::2], abs=1e-6)
    assert tilts[::2] == pytest.approx(np.tile([*LEAN, 0.0], (200, 1)), abs=1e-6), (
        "on nothing of the road: by the world"
    )
    # And where they lie: a wave along the road.
    wave = NormalImages({0: NormalImage(waves().levels, TILE, True)}, PavementRelief(geometry))
    _, tilts = wave.tilts(np.zeros(400, np.int64), np.full(400, right.instance), at, place, up, np.zeros(400))
    assert np.einsum("ij,ij->i", tilts, forwards) == pytest.approx(-slope_at(station), abs=1e-3)
