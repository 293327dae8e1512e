"""Set-up of tests of trainings: curves that aren't drawn, as drawing takes longer than a toy's training."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from ml import runs

_DRAW = runs._curves
NOT_DRAWN = b"\x89PNG, not drawn"


@pytest.fixture(scope="session", autouse=True)
def _no_curves() -> Iterator[None]:
    """Write a few bytes in place of each training's curves."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, "_curves", lambda history: NOT_DRAWN)
        yield


@pytest.fixture
def drawn_curves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw the curves of the trainings of one test."""
    monkeypatch.setattr(runs, "_curves", _DRAW)
