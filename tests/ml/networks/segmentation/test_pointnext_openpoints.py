"""PointNeXt against its authors' implementation."""

from __future__ import annotations

import types
from collections.abc import Iterator

import pytest

from ml.networks.segmentation.pointnext import PointNeXtOptions
from tests.judges import learning, require
from tests.judges.pointnext_reference import (
    PUBLISHED,
    RADIUS,
    Theirs,
    compared,
    openpoints_modules,
    same_as_theirs,
)

pytestmark = pytest.mark.slow  # it is downloaded


@pytest.fixture
def theirs() -> Iterator[types.SimpleNamespace]:
    """Their modules, gone from memory afterwards."""
    require("openpoints")
    with openpoints_modules(learning.openpoints_folder()) as modules:
        yield modules


@pytest.mark.parametrize("name", PUBLISHED)
def test_has_as_many_parameters(theirs: types.SimpleNamespace, name: str) -> None:
    network = Theirs(theirs, PointNeXtOptions(preset=name))
    assert sum(weight.numel() for weight in network.parameters()) == PUBLISHED[name]


SIZES = ["S", "B", "L", "XL"]


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("name", SIZES)
def test_gives_the_same_outputs_and_gradients(theirs: types.SimpleNamespace, name: str, training: bool) -> None:
    found = compared(theirs, same_as_theirs(name), 1100, training=training)
    worst = max(found, key=lambda key: found[key])
    print(f"{name}, training {training}: largest of {len(found)} relative differences: {worst}, {found[worst]:.1e}")
    assert found[worst] < 1e-6


def test_a_radius_that_is_another_is_seen(theirs: types.SimpleNamespace) -> None:
    wider = same_as_theirs("S").model_copy(update={"radius": 1.1 * RADIUS})
    assert max(compared(theirs, wider, 1100, training=False).values()) > 1e-3
