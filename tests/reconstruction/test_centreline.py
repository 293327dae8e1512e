"""A centreline is found by several views, or doubted: on thrown clouds that are roads, parts of roads, or none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.errors import InputError
from synthroads_addon.reconstruction.centreline import Centreline, find_centreline
from synthroads_addon.reconstruction.cloud import RoadCloud, read_road_cloud
from tests.helpers.clouds import foreign_clouds
from tests.helpers.clouds.foreign_clouds import DAMAGED, FOREIGN, NORTH, SOUND, Across, axis_north, throw


def found_in(path: Path, across: Across, seed: int = 1, slant: float = 3.0) -> tuple[Centreline | None, RoadCloud]:
    """Return the centreline of a thrown cloud, None where no road can be made out, and the cloud."""
    cloud = read_road_cloud(throw(path / f"{across.__name__}.laz", across, seed, slant))
    try:
        return find_centreline(cloud), cloud
    except InputError:
        return None, cloud


def errors(found: Centreline, cloud: RoadCloud, slant: float = 3.0, trusted: bool = False) -> np.ndarray:
    """Return how far a centreline's vertices are north of the cloud's axis, m; perhaps only of what is trusted."""
    points = found.path.points + cloud.origin[:2]
    station = points[:, 0] - foreign_clouds.EAST
    keep = (station > 10.0) & (station < foreign_clouds.LENGTH - 10.0)
    if trusted:
        for doubt in found.judgement.doubts:
            keep &= (found.path.stations < doubt.start) | (found.path.stations > doubt.end)
    return (points[:, 1] - NORTH - axis_north(station, slant))[keep]


def test_a_sound_road_is_found_and_trusted(tmp_path: Path) -> None:
    found, cloud = found_in(tmp_path, foreign_clouds.rural)
    assert found is not None
    off = errors(found, cloud)
    assert np.abs(off).max() < 0.25
    assert found.judgement.doubts == []
    used = {view.name for view in found.axis.views if found.axis.members[view.name].mean() > 0.5}
    assert {"lines", "marking period", "brightness", "cross-profile"} <= used


def test_a_road_without_markings_is_found_by_what_else_is_seen(tmp_path: Path) -> None:
    found, cloud = found_in(tmp_path, foreign_clouds.unmarked)
    assert found is not None
    assert np.abs(errors(found, cloud)).max() < 0.35
    assert found.judgement.trusted > 0.9


@pytest.mark.parametrize("across", [foreign_clouds.car_park, foreign_clouds.field], ids=lambda one: one.__name__)
def test_where_no_road_is_nothing_is_trusted(tmp_path: Path, across: Across) -> None:
    found, _ = found_in(tmp_path, across)
    assert found is None or found.judgement.trusted < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("across", [*FOREIGN, *DAMAGED, *SOUND], ids=lambda one: one.__name__)
def test_no_confident_answer_is_wrong(tmp_path: Path, across: Across, seed: int) -> None:
    found, cloud = found_in(tmp_path, across, seed)
    if across in FOREIGN:
        assert found is None or found.judgement.trusted < 0.05
    elif found is not None:  # a damaged one may be refused
        off = errors(found, cloud, trusted=True)
        assert not len(off) or np.abs(off).max() < 1.0
    if across in SOUND:
        assert found is not None
        assert found.judgement.trusted > 0.95


def test_the_command_writes_line_and_report_and_says_its_doubts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = throw(tmp_path / "half.laz", foreign_clouds.half_road, 1)
    output = tmp_path / "line.geojson"
    assert main(["centerline", str(cloud), "--run", "none", "--output", str(output)]) == 3
    said = capsys.readouterr().out
    assert "doubtful from" in said
    assert "extent: seen on" in said
    line = json.loads(output.read_text())["features"][0]
    count = len(line["geometry"]["coordinates"])
    for name in ("stations", "std", "interval_68", "interval_95"):
        assert len(line["properties"][name]) == count
    report = json.loads(output.with_suffix(".json").read_text())
    assert report["judgement"]["doubtful"] == line["properties"]["doubtful"]
    assert report["judgement"]["doubtful"][0]["why"]
    assert main(["centerline", str(cloud), "--output", str(output)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert main(["centerline", str(cloud), "--output", str(tmp_path / "line.txt")]) == 2
    assert "must end in .geojson" in capsys.readouterr().err
