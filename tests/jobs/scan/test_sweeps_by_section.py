"""Sweeps of a road that is scanned by sections: those of the road scanned whole, in their order."""

from __future__ import annotations

import gc
import json
import weakref
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.cloud.sweeps.registry import SWEEP_FORMATS, SWEEPS
from synthroads_addon.cloud.sweeps.spool import SweepSpool
from synthroads_addon.cloud.sweeps.sweep import Sweep
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.jobs.scan.awaited_sweeps import AwaitedSweeps
from synthroads_addon.jobs.scan.sweeps import SweepFiles, sight_of_sweeps
from synthroads_addon.scanning.blocks import Blocks
from synthroads_addon.scanning.scene.bodies import LONGEST
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import Scenario
from synthroads_addon.scenario.sweeps import SweepScenario
from tests.helpers.clouds.sweeps import sweeps
from tests.helpers.scenes.scan_scenes import ORIGIN, Standing, Strip, altered, plane, scan_of
from tests.helpers.scenes.sparse_scanner import sparse_scanner


def job(folder: Path, section: float, seed: int = 4, traffic: float = 0.0) -> Scenario:
    """Return a flight there and back along a road of 120 m, by sections of a length, m; sweeps of half a second."""
    return Scenario.from_dict(
        {
            "type": "Scenario", "version": "1.0", "seed": seed, "fidelity": "draft",
            "road": {"length": 120.0, "half_width": 30.0, "vehicles": {"per_km": {"minimum": 60.0, "maximum": 60.0}}},
            "scan": {
                "device": sparse_scanner(folder, kilohertz=2.0), "rays_per_pulse": 1, "section_length": section,
                "platform": {"speed": 10.0, "lateral_offsets": [-8.0, 8.0]}, "traffic_speed_factor": traffic,
            },
            "sweeps": {"formats": list(SWEEP_FORMATS), "duration": 0.5, "box_range": 90.0},
            "colour": {"source": "material"},
            "outputs": ["cloud", "parameters"],
        }
    )  # fmt: skip


def files_of(folder: Path) -> dict[str, bytes]:
    """Return the content of the files of sweeps in a folder by their places."""
    folders = [folder / name for name in ("kitti", "semantickitti", "nuscenes")]
    paths = [folder / SWEEPS, folder / "openlabel.json", *(path for one in folders for path in one.rglob("*"))]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths if path.is_file()}


@pytest.mark.any_blender
def test_sweeps_don_t_depend_on_the_sections(tmp_path: Path) -> None:
    whole = generate(Job(job(tmp_path, 100.0), tmp_path / "whole", new_file=True))["counts"]
    cut = generate(Job(job(tmp_path, 40.0), tmp_path / "cut", new_file=True))["counts"]
    assert "sections" not in whole
    assert cut["sections"] == 3
    assert cut["sweeps"] == whole["sweeps"]
    assert whole["sweeps"]["boxes"] > 100
    assert whole["sweeps"]["points_in_boxes"] > 100
    rows = json.loads((tmp_path / "cut" / SWEEPS).read_text())["sweeps"]
    assert {row["strip"] for row in rows} == {0, 1}
    assert sorted(rows, key=lambda row: (row["strip"], row["begin"])) == rows
    found, wanted = files_of(tmp_path / "cut"), files_of(tmp_path / "whole")
    assert found.keys() == wanted.keys()
    assert [name for name in wanted if found[name] != wanted[name]] == []
    assert not [path for path in (tmp_path / "cut").iterdir() if path.name.startswith(".")]


def test_what_is_kept_meanwhile_comes_back_as_it_was(tmp_path: Path) -> None:
    wanted = [replace(sweep, strip=strip) for strip in (0, 1) for sweep in sweeps(3)]
    empty = replace(wanted[4], boxes=())
    hidden = replace(wanted[0].boxes[0], seen=None, seen_centre=None, seen_size=None, points=0)
    wanted[4], wanted[0] = empty, replace(wanted[0], boxes=(hidden, *wanted[0].boxes[1:]))
    spool = SweepSpool(tmp_path)
    for index in (3, 0, 5, 1, 4, 2):
        spool.keep(wanted[index])
    found = list(spool.sweeps())
    assert [(sweep.strip, sweep.number_in_strip) for sweep in found] == [(s, n) for s in (0, 1) for n in range(3)]
    for one, other in zip(found, wanted, strict=True):
        assert same(one, other)
        assert all(same(box, there) for box, there in zip(one.boxes, other.boxes, strict=True))
    spool.close()
    assert list(tmp_path.iterdir()) == []


def same(one: Any, other: Any) -> bool:
    """Return whether all attributes of two sweeps or boxes are the same, boxes of sweeps aside."""
    values = {name: getattr(one, name) for name in vars(other) if name not in ("boxes", "points")}
    if isinstance(one, Sweep):
        found, wanted = one.points.attributes(), other.points.attributes()
        if found.keys() != wanted.keys() or not all(np.array_equal(found[name], wanted[name]) for name in wanted):
            return False
    else:
        values["points"] = one.points
    return all(type(value) is type(getattr(other, name)) for name, value in values.items()) and all(
        np.array_equal(value, getattr(other, name)) if value is not None else getattr(other, name) is None
        for name, value in values.items()
    )


def test_a_sweep_waits_for_all_blocks_that_have_pulses_of_it(tmp_path: Path) -> None:
    scan = job(tmp_path, 40.0).scan
    cut = Blocks(scanner_setting(scan), Flight(), 1)
    blocks = list(cut.all())
    assert len(blocks) == 8
    awaited = AwaitedSweeps(cut, duration=2.0)  # blocks take three seconds
    keys = np.array([[0, 0, 0, 0, 0, 0], [0, 1, 2, 3, 4, 5]])
    awaited.take(blocks[:1])
    assert awaited.is_complete(keys).tolist() == [True, False, False, False, False, False]
    awaited.take(blocks[2:3])
    assert awaited.is_complete(keys).tolist() == [True, False, False, True, False, False]
    awaited.take(blocks[1:2])
    assert awaited.is_complete(keys).tolist() == [True, True, True, True, False, False]
    awaited.take(blocks[3:])
    assert awaited.is_complete(keys).all()
    assert awaited.is_complete(np.array([[1], [3]])).all()


class Flight(Standing):
    """A scanner that hovers for twelve seconds, twice."""

    strips = (Strip(0, 0.0, 12.0), Strip(1, 20.0, 12.0))


def test_as_much_is_built_as_boxes_need() -> None:
    settings = SweepScenario(formats=("kitti",), box_range=80.0, duration=0.5)
    assert sight_of_sweeps(settings, Flight(20.0, 8.0)) == pytest.approx(80.0 + LONGEST + 4.0)
    assert sight_of_sweeps(SweepScenario(), Flight(20.0, 8.0)) == 0.0


def test_no_scene_is_held_between_two_sections(tmp_path: Path) -> None:
    scenario = job(tmp_path, 40.0)
    files = SweepFiles(scenario, ScenarioInputs.read(scenario), tmp_path, ORIGIN, 1.0)
    files.open()
    plan = altered(scan_of(plane(), path=Flight()), chosen_blocks=())
    files.begin(plan)
    held = weakref.ref(plan.target)
    files.end()
    del plan
    gc.collect()
    assert held() is None
    files.close()
