"""CIEDE2000 as the trade-off measures colours by it: the test data of Sharma, Wu and Dalal (2005), table 1."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.scanning.colour.difference import cie_lab, ciede2000

PAIRS = [
    ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
    ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
    ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
    ((50.0, 2.5, 0.0), (58.0, 24.0, 15.0), 19.4535),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((22.7233, 20.0904, -46.694), (23.0331, 14.973, -42.5619), 2.0373),
    ((2.0776, 0.0795, -1.135), (0.9033, -0.0636, -0.5514), 0.9082),
]


@pytest.mark.parametrize(("one", "other", "difference"), PAIRS)
def test_differences_are_the_published_ones(one: tuple, other: tuple, difference: float) -> None:
    a, b = np.array([one]), np.array([other])
    assert ciede2000(a, b)[0] == pytest.approx(difference, abs=5e-5)
    assert ciede2000(b, a)[0] == pytest.approx(difference, abs=5e-5)


def test_white_is_white() -> None:
    np.testing.assert_allclose(cie_lab(np.full((1, 3), 65535, np.uint16)), [[100.0, 0.0, 0.0]], atol=0.01)
