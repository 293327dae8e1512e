"""Certificates of recipes: what they say of a comparison, and the table over several."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from studies.realism.certificates import WITHOUT, certificate, pages, sweep_certificate, table
from synthroads_addon.base.errors import InputError
from synthroads_addon.comparison.job import CloudComparison
from synthroads_addon.dataset.recipe import recipe_names
from tests.comparison.test_sweeps import made_up


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

    def realism_left_out(self) -> dict[str, dict[str, float]]:
        return {"a": {"all": 0.4}, "b": {"all": 0.7}}


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
    assert "| `sweeps` | a | 0.40 |\n| `sweeps` | b | 0.70 |\n| `sweeps` | mean | 0.55 |\n" in text
    old = {key: value for key, value in made(25.0).items() if key != "realism_left_out"}
    assert "left out" not in table([old], "certificates")


def test_clouds_of_a_scenario_have_its_title() -> None:
    data = certificate("airborne-1000m", cast(CloudComparison, Compared((25.0,))), "two roads")
    assert data["title"] == "1000 m of motorway RQ 31, surveyed from an aircraft in two strips"


def test_a_road_left_out_is_compared_with_the_half_that_is_most_like_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The clouds stand for themselves; the table has the AUC of each against each real one."""
    aucs = {
        "one": {"a": 0.6, "b": 0.9, "c": 0.9},
        "two": {"a": 0.9, "b": 0.7, "c": 0.8},
        "a": {"b": 0.8, "c": 0.9},
        "b": {"a": 0.8, "c": 0.75},
        "c": {"a": 0.6, "b": 0.3},
    }

    def looked_up(patches: str, others: str, seed: int, name: str) -> dict[str, float]:
        assert (patches, seed) == (name, 5)
        return {"all": aucs[name].get(others, 0.5)}

    def cloud(name: str) -> Any:
        return SimpleNamespace(patches=name, cloud=SimpleNamespace(name=name))

    monkeypatch.setattr("synthroads_addon.comparison.job.classifier_auc", looked_up)
    result = CloudComparison((cloud("one"), cloud("two")), (cloud("a"), cloud("b"), cloud("c")), (), ())
    found = {road: groups["all"] for road, groups in result.realism_left_out(5).items()}
    # Without a "two" is more like the others (0.3 + 0.2 against 0.1 + 0.1), without b and c "one" and "two":
    # 0.4 + 0.1 against 0.1 + 0.2, and 0.4 + 0.1 against 0.1 + 0.3. An AUC below 0.5 counts as 0.5.
    assert found == pytest.approx({"a": 0.1 / 0.3, "b": 0.1 / 0.35, "c": 0.1 / 0.175})


def test_sweeps_are_certified_by_the_figures_that_all_have() -> None:
    real = [made_up(noise=0.2, zeros=0.1), made_up(noise=0.3, zeros=np.nan)]
    # Within 0.175 and 0.325, half as much again as the real range.
    ours = [made_up(noise=noise) for noise in (0.17, 0.18, 0.32, 0.33)]
    data = sweep_certificate("sweeps", ours, real, "halves")
    assert data["statistics"]["noise"] == {"synthetic": [0.17, 0.25, 0.33], "real": [0.2, 0.25, 0.3], "within": 2}
    assert "zeros" not in data["statistics"]
    assert "road points/m², 4 to 6 m" not in data["statistics"]
    with pytest.raises(InputError, match="two real sweeps or parts of one"):
        sweep_certificate("sweeps", ours, real[:1], "one")
    text = pages([made(25.0), data | {"recipe": "centerline-airborne"}], "certificates")
    total = 4 * len(data["statistics"])
    assert f"| [`centerline-airborne`](certificates/centerline-airborne.json) | 4 | {total - 2} of {total} |  |" in text
    assert "- `reference`: no real cloud of a road, recorded by a UAV, was available.\n" in text


DEFAULTS = {"rq31-600m", "mobile-mapping-300m", "tripod-200m", "airborne-1000m"}
"""Scenarios that somebody starts with, one for each kind of platform."""


def test_every_shipped_recipe_and_default_scenario_has_a_certificate_or_a_reason() -> None:
    folder = Path(__file__).parents[2] / "docs" / "certificates"
    certified = {path.stem for path in folder.glob("*.json")}
    assert certified.isdisjoint(WITHOUT)
    assert certified | set(WITHOUT) == set(recipe_names()) | DEFAULTS
    page = folder.with_suffix(".md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in page for name in {*recipe_names(), *DEFAULTS})
