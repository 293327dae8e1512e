"""Certificates of recipes: what they say of a comparison, and the table over several."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import pytest

from synthroads_addon.comparison.job import CloudComparison
from tools.certify_recipes import certificate, table


@dataclass(frozen=True)
class Compared:
    """A comparison that says what it is given."""

    ours: tuple[float, ...]

    def to_dict(self) -> dict[str, Any]:
        return {
            "realism": {"all": 0.5},
            "giveaways": {"residual_mm": [0.8, 0.6], "level_db": [0.6, 0.6], "x": [0.5, 0.5], "y": [0.5, 0.5]},
            "synthetic": [{"patches": 100, "auc": {"all": 0.9}, "medians": {"residual_mm": one}} for one in self.ours],
            "real": [{"auc": {"all": 0.8}, "medians": {"residual_mm": one}} for one in (20.0, 30.0)],
        }


def made(*ours: float) -> dict[str, Any]:
    return certificate("sweeps", cast(CloudComparison, Compared(ours)), "two roads")


def test_a_certificate_counts_statistics_within_half_as_much_again_as_the_real_range() -> None:
    data = made(17.4, 17.6, 25.0, 32.4, 32.6)
    assert data["statistics"]["residual_mm"] == {
        "synthetic": [17.4, 25.0, 32.6],
        "real": [20.0, 25.0, 30.0],
        "within": 3,
    }
    assert (data["clouds"], data["patches"]) == (5, 500)
    assert list(data["giveaways"]) == ["residual_mm", "level_db", "x"]
    assert data["auc"] == {"all": [0.9, pytest.approx(0.9), 0.9]}


def test_the_table_has_a_row_for_each_recipe() -> None:
    text = table([made(25.0), made(99.0) | {"recipe": "standin"}], "certificates")
    assert "| [`sweeps`](certificates/sweeps.json) | 1 | 0.90 (0.50) | 1 of 1 | residual_mm 0.80, level_db 0.60" in text
    assert "| [`standin`](certificates/standin.json) | 1 | 0.90 (0.50) | 0 of 1 |" in text
