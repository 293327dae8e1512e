"""The per-point layer that the documentation has its readers add."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.cloud import layers
from synthroads_addon.scanning import point_layers
from tests.helpers.page_modules import block_of_page
from tests.helpers.scenes.scan_scenes import altered, middle_pulses, plane, scan_of

PAGE = "extend/layer.md"


def test_the_row_of_the_page_is_a_layer() -> None:
    row = eval(f"{{{block_of_page(PAGE, 'text')}}}", vars(layers))["footprint"]
    assert (row.types, row.filler) == ({"footprint": "float64"}, "scan")
    assert [(column.name, column.array, column.unit) for column in row.columns] == [("footprint", "footprint", "m")]
    assert len(row.columns[0].description) <= 31


def test_the_function_of_the_page_fills_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(point_layers, "FILLERS", dict(point_layers.FILLERS))
    exec(block_of_page(PAGE, "python"), dict(vars(point_layers)))
    scan = scan_of(plane(), divergence=(1e-3, 2e-3))
    points = middle_pulses(altered(scan, measured=scan.layers.measured | {"footprint"})).points
    np.testing.assert_allclose(points.more["footprint"], 2e-3 * points.true_range)
