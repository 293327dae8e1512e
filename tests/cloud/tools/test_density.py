"""Pictures from above whose cells follow the density of the points: surfaces, not stripes; and the same paint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from synthroads_addon.base.classes import class_id, class_scheme
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.cloud.tools.picture import PAPER, Axes, Raster
from synthroads_addon.cloud.tools.previews import TopView
from tests.helpers.clouds.random_points import make_points

LENGTH, WIDTH = 120.0, 24.0
ROAD, PAINT = class_id("road"), class_id("road_marking")


def road(along: float, across: float) -> PointBlock:
    """Return a flat road with a line of paint in its middle, of points so far apart (m) along it and across."""
    x, y = np.meshgrid(np.arange(0.0, LENGTH, along), np.arange(-WIDTH / 2, WIDTH / 2, across))
    points = make_points(x.size)
    label = np.where(np.abs(y.ravel()) < 0.15, PAINT, ROAD).astype(np.uint8)
    return replace(points, xyz=np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), class_id=label)


def view_of(points: PointBlock) -> TopView:
    view = TopView(np.zeros(2), np.array([LENGTH, 0.0]), -WIDTH / 2 - 1, WIDTH / 2 + 1)
    view.add(points)
    return view


@pytest.mark.parametrize(("along", "across", "most"), [(0.05, 0.05, 1), (0.4, 0.05, 6), (0.05, 0.4, 6), (0.5, 0.5, 8)])
def test_cells_are_as_wide_as_the_points_are_apart(along: float, across: float, most: int) -> None:
    view = view_of(road(along, across))
    pixel = view.raster.axes.across * view.raster.density_factor()
    assert view.raster.density_factor() <= most
    assert pixel >= 0.75 * max(along, across) or most == 1


@pytest.mark.parametrize(("along", "across"), [(0.4, 0.05), (0.05, 0.4)])
def test_a_striped_cloud_is_drawn_as_a_surface_with_its_paint(along: float, across: float, tmp_path: Path) -> None:
    (path,) = view_of(road(along, across)).save(tmp_path, None, ["class"])
    pixels = np.asarray(Image.open(path))
    colors = class_scheme("17").colors()
    is_road, is_paint = (np.all(pixels == colors[label], axis=2) for label in (ROAD, PAINT))
    rows = np.flatnonzero(is_road.sum(axis=1) > 400)  # without the legend
    columns = np.flatnonzero(is_road[rows].sum(axis=0) > 20)
    within = pixels[rows[0] : rows[-1], columns[0] : columns[-1]]
    assert np.all(within == PAPER, axis=2).mean() < 0.002
    line = is_paint[rows[0] : rows[-1], columns[0] : columns[-1]].any(axis=0)
    assert line.mean() > 0.99, "the line is seen all along the road"


def test_merging_cells_loses_no_point_and_keeps_the_foremost() -> None:
    points = road(1.0, 1.0)
    raster = Raster(Axes(0.0, -12.0, 0.5, 0.5), (241, 47))
    height = np.arange(len(points), dtype=np.float64)
    raster.add(points, (points.xyz[:, 0], points.xyz[:, 1]), height)
    merged, whole = raster.merged(4), Raster(Axes(0.0, -12.0, 2.0, 2.0), (61, 12))
    whole.add(points, (points.xyz[:, 0], points.xyz[:, 1]), height)
    inside = whole.count.reshape(12, 61)[1:], merged.count.reshape(12, 61)[1:]  # the raster ends in the highest row
    assert inside[0].tolist() == inside[1].tolist()
    assert merged.count.sum() == raster.count.sum()
    for quantity in ("intensity", "rgb"):
        ours, theirs = (getattr(one, quantity)().reshape(12, 61, -1)[1:] for one in (merged, whole))
        assert ours == pytest.approx(theirs)
    assert merged.label.reshape(12, 61)[1:].tolist() == whole.label.reshape(12, 61)[1:].tolist()
