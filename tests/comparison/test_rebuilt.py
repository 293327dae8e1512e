"""The study that rebuilds real roads: which points it cuts out, what it refuses, and what it compares a road with."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import laspy
import numpy as np
import pytest

from studies.realism.rebuilt import Stretch, cut, find_stretches, realism_of_own_road, road_row
from synthroads_addon.base.errors import InputError
from synthroads_addon.comparison.clouds import find_clouds
from synthroads_addon.comparison.job import CloudComparison
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario


def made_list(folder: Path) -> Path:
    """Write a straight road along the x axis, every metre a point 3 m to both sides, its axis and a list of both."""
    station = np.arange(100.0)
    file = laspy.LasData(laspy.LasHeader(version="1.4", point_format=6))
    file.header.scales = (1e-3,) * 3
    file.x, file.y, file.z = np.tile(station, 2), np.repeat([3.0, -3.0], 100), np.zeros(200)
    file.write(str(folder / "road.laz"))
    rows = "\n".join(f"{one + 500:g},{one:g},0,0,1" for one in station)
    (folder / "axis.csv").write_text(f"s,x,y,z,tile\n{rows}\n", encoding="utf-8")
    text = "type: CloudList\nclouds:\n  - {cloud: road.laz, axis: axis.csv, paved: [[-3, 3]]}\n  - {cloud: other.laz}\n"
    (folder / "real.yaml").write_text(text, encoding="utf-8")
    return folder / "real.yaml"


def test_a_stretch_has_the_points_between_its_lengths_along_the_axis(tmp_path: Path) -> None:
    rows = find_clouds(made_list(tmp_path))
    (stretch,) = find_stretches(rows, [["road", "520", "560"]])
    assert stretch == Stretch(tmp_path / "road.laz", tmp_path / "axis.csv", 520.0, 560.0)
    cut(stretch, tmp_path / "out" / "road.laz")
    x = np.asarray(laspy.read(tmp_path / "out" / "road.laz").x)
    assert sorted(x) == sorted(np.tile(np.arange(20.0, 60.0), 2))


def test_a_stretch_of_no_cloud_beside_an_axis_and_one_without_length_are_refused(tmp_path: Path) -> None:
    rows = find_clouds(made_list(tmp_path))
    with pytest.raises(InputError, match="must be a cloud beside an axis: road"):
        find_stretches(rows, [["other", "0", "10"]])
    with pytest.raises(InputError, match="must end behind its beginning"):
        find_stretches(rows, [["road", "10", "10"]])


def test_a_rebuilt_road_is_held_against_its_own_real_cloud_and_the_others_are_the_yardstick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    aucs = {("new", "a"): 0.9, ("b", "a"): 0.8, ("c", "a"): 0.4, ("new", "b"): 0.99, ("a", "b"): 0.6, ("c", "b"): 0.6}

    def looked_up(patches: str, others: str, seed: int, name: str) -> dict[str, float]:
        return dict.fromkeys(("all", "pattern", "geometry", "intensity"), aucs[patches, others])

    def cloud(name: str) -> Any:
        return SimpleNamespace(patches=name, cloud=SimpleNamespace(name=name))

    monkeypatch.setattr("studies.realism.rebuilt.classifier_auc", looked_up)
    result = cast(CloudComparison, SimpleNamespace(synthetic=[cloud("new")], real=[cloud("a"), cloud("b"), cloud("c")]))
    # The mean of 0.2 and, as an AUC below 0.5 is chance, 0.5; and of 0.4 twice.
    assert realism_of_own_road(result, 0, "a")["geometry"] == pytest.approx(0.1 / 0.35)
    assert realism_of_own_road(result, 0, "b")["all"] == pytest.approx(0.01 / 0.4)


def test_the_row_of_a_road_names_lanes_class_and_broken_rules() -> None:
    road = sample_road(load_scenario("country-600m").road, seed=2)
    assert road_row("x", road) == "| x | 600 | EKL3 | right 3.50, left 3.50 | none |"
    first, *rest = road.alignment.horizontal
    short = first.model_copy(update={"length": 1.0})
    alignment = road.alignment.model_copy(update={"horizontal": (short, *rest)})
    broken = road.model_copy(update={"objects": road.objects | {"alignment": alignment}})
    assert road_row("x", broken).startswith("| x | 570 | EKL3 | right 3.50, left 3.50 | delineator-missing (2), ")
