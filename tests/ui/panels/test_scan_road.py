"""A road from a scan: the button builds what the command finds, and says where it isn't to be trusted, and why."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.base.errors import Cancelled
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model.roads import FRAME, ORIGIN
from synthroads_addon.blender.model.store import FOUND, find_road, recall, roads
from synthroads_addon.reconstruction.report import (
    ReconstructedRoad,
    ReconstructionJob,
    measure_lines,
    run_reconstruction,
)
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.panels import panels, scan_road
from synthroads_addon.ui.panels.road_files import source_file_name
from synthroads_addon.ui.work.build import shown_place
from synthroads_addon.ui.work.job import PanelJob, running_job
from tests.helpers.clouds.road_clouds import block_of, cloud_of, road, write
from tests.helpers.scenes.fake_layout import drawn
from tests.helpers.scenes.panel_road import block_counts, settings, wait_for_end

__all__ = ["settings"]

pytestmark = pytest.mark.any_blender
ROUGH = (50.0, 110.0)
"""Stations, m, between which the ground of a cloud is too rough for a pavement."""


@pytest.fixture(scope="module")
def cloud(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cloud of a dual carriageway that is seen well."""
    truth = road("RQ31", "EKA1A", 100.0, 3)
    return write(tmp_path_factory.mktemp("cloud") / "scan.laz", cloud_of(truth, 15.0, 3))


@pytest.fixture(scope="module")
def rough_cloud(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cloud of a dual carriageway of which a stretch is as rough as a field."""
    truth = road("RQ31", "EKA1A", 160.0, 3)
    block = cloud_of(truth, 15.0, 3)
    station, _ = RoadGeometry(truth).alignment.project(block.xyz[:, :2] - np.array(truth.transform.translate)[:2])
    rough = (station > ROUGH[0]) & (station < ROUGH[1])
    block.xyz[rough, 2] += np.random.default_rng(1).normal(0.0, 0.15, int(rough.sum()))
    return write(tmp_path_factory.mktemp("rough") / "rough.laz", block)


@pytest.fixture(scope="module")
def found(cloud: Path, rough_cloud: Path) -> dict[Path, ReconstructedRoad]:
    """Return the road that the command finds in each cloud."""
    return {file: run_reconstruction(ReconstructionJob(file)) for file in (cloud, rough_cloud)}


@pytest.fixture
def found_before(found: dict[Path, ReconstructedRoad], monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the button take what the command has found, as finding it again takes seconds."""
    monkeypatch.setattr(scan_road, "run_reconstruction", lambda job, progress: found[job.cloud])


def lines(panel: type) -> list[str]:
    return drawn(panel, bpy.context).lines


def test_it_is_the_road_that_the_command_finds(
    settings: Any, cloud: Path, found: dict[Path, ReconstructedRoad]
) -> None:
    assert bpy.ops.synthroads.road_from_scan(filepath=str(cloud)) == {"FINISHED"}
    root = find_road(bpy.context.scene)
    road = found[cloud].reconstruction
    assert recall(root) == (road.parameters, settings.scenario())
    assert source_file_name(root) == "scan.laz"
    assert np.allclose(np.array(root[FRAME]) - np.array(root[ORIGIN]), root.location)
    kept = scan_road.found_road(root)
    assert kept["judgement"] == {**road.judgement.to_dict(), "other_sections": []}
    assert kept["cloud"] == str(cloud)


def test_its_options_are_the_commands(
    settings: Any, cloud: Path, found: dict[Path, ReconstructedRoad], tmp_path: Path
) -> None:
    truth = road("RQ31", "EKA1A", 100.0, 3)
    middle = RoadGeometry(truth).alignment.frame(np.linspace(0.0, 100.0, 21))[0] + truth.transform.translate[:2]
    np.savetxt(tmp_path / "course.csv", middle, delimiter=",", header="x,y", comments="")
    options = {"road": "dual", "course": str(tmp_path / "course.csv"), "snap": True, "tolerance": 0.1}
    bpy.ops.synthroads.road_from_scan(filepath=str(cloud), **options)
    job = ReconstructionJob(cloud, "dual", tmp_path / "course.csv", 0.1, True)
    given = run_reconstruction(job).reconstruction.parameters
    assert recall(find_road(bpy.context.scene))[0] == given != found[cloud].reconstruction.parameters


@pytest.mark.usefixtures("found_before")
def test_what_is_not_doubtful_is_said(
    settings: Any, cloud: Path, found: dict[Path, ReconstructedRoad], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "sidebar_width", lambda: 900.0)
    assert not scan_road.SYNTHROADS_PT_scan_road.poll(bpy.context)
    bpy.ops.synthroads.road_from_scan(filepath=str(cloud))
    assert scan_road.SYNTHROADS_PT_scan_road.poll(bpy.context)
    shown = lines(scan_road.SYNTHROADS_PT_scan_road)
    assert shown[0] == "label 'No part of it is doubtful' <CHECKMARK>"
    text = "\n".join(shown)
    report = found[cloud].report
    for line in ("dual carriageway of", "cm rms from the measured axis (std", *measure_lines(report)):
        assert line in text
    assert "right: points 1.0 cm rms from the surface" in text
    assert "ERROR" not in text
    assert shown[-1] == "button 'Show Cloud' synthroads.show_cloud <POINTCLOUD_DATA>"
    assert bpy.ops.synthroads.show_cloud(filepath=scan_road.found_road(find_road(bpy.context.scene))["cloud"])


@pytest.mark.usefixtures("found_before")
def test_doubts_stand_in_the_panel_by_station_with_their_reasons(
    settings: Any,
    rough_cloud: Path,
    found: dict[Path, ReconstructedRoad],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(room, "sidebar_width", lambda: 900.0)
    bpy.ops.synthroads.road_from_scan(filepath=str(rough_cloud))
    judgement = found[rough_cloud].reconstruction.judgement
    (doubt,) = judgement.doubts
    assert doubt.start < ROUGH[1]
    assert doubt.end > ROUGH[0]
    assert "the ground on its lanes is too rough for a pavement" in doubt.reasons
    shown = lines(scan_road.SYNTHROADS_PT_scan_road)
    said = f"The result is doubtful at 1 place, the axis on {1.0 - judgement.trusted:.0%} of the length"
    assert shown[0] == f"label '{said}' <ERROR>"
    place = f"doubtful from {doubt.start:.0f} to {doubt.end:.0f} m: {doubt.reasons[0]}"
    row = next(line for line in shown if place in line)
    assert row.endswith("button '' synthroads.show_doubt <VIEWZOOM>")
    assert said in capfd.readouterr().out, "and in the message at the end"
    assert bpy.ops.synthroads.show_doubt(station=doubt.start) == {"FINISHED"}


@pytest.mark.usefixtures("found_before")
def test_a_road_that_was_built_otherwise_has_no_doubts(settings: Any, cloud: Path) -> None:
    bpy.ops.synthroads.road_from_scan(filepath=str(cloud))
    root = find_road(bpy.context.scene)
    set_modifier_input(bpy.data.objects["Road"].modifiers[0], "Right Lane 1 Width", 4.5)
    bpy.ops.synthroads.build_edited()
    assert recall(root)[0].carriageway("right").lanes[0].width == 4.5, "it is edited as any other road"
    assert FOUND in root
    settings.road.length, settings.road.half_width = 60.0, 20.0
    bpy.ops.synthroads.build()
    assert find_road(bpy.context.scene) == root
    assert FOUND not in root
    with pytest.raises(RuntimeError, match="Make a road from a scan first"):
        bpy.ops.synthroads.show_doubt()


@pytest.mark.usefixtures("found_before")
def test_it_lies_where_its_cloud_lies(settings: Any, cloud: Path) -> None:
    settings.road.length, settings.road.half_width = 60.0, 20.0
    bpy.ops.synthroads.build()
    bpy.ops.synthroads.build(beside=True)
    second = find_road(bpy.context.scene)
    assert second.location.length > 1.0
    bpy.ops.synthroads.road_from_scan(filepath=str(cloud))
    assert find_road(bpy.context.scene) == second
    assert len(roads(bpy.context.scene)) == 2
    assert np.allclose(np.array(second[FRAME]) - np.array(second[ORIGIN]), second.location)


def bad_clouds(folder: Path) -> dict[str, Path]:
    """Write clouds that no road can be made of, by what is said of them."""
    (folder / "text.laz").write_text("no cloud")
    (folder / "notes.txt").write_text("x,y,z")
    rng = np.random.default_rng(1)
    few = write(folder / "few.laz", cloud_of(road("RQ31", "EKA1A", 20.0, 3), 0.5, 1))
    noise = rng.uniform(0.0, 60.0, (20_000, 3))
    blob = write(folder / "blob.laz", block_of(noise, rng.uniform(size=20_000), np.full(20_000, 2)))
    return {
        "no such file": folder / "none.laz",
        "must end in": folder / "notes.txt",
        "text.laz": folder / "text.laz",
        "at least 2000 points of ground or road are needed": few,
        "road": blob,
    }


def test_what_is_no_road_is_refused_in_a_sentence(settings: Any, tmp_path: Path) -> None:
    before = block_counts()
    for said, path in bad_clouds(tmp_path).items():
        with pytest.raises(RuntimeError, match=said) as caught:
            bpy.ops.synthroads.road_from_scan(filepath=str(path))
        text = str(caught.value).strip()
        assert text.startswith("Error: "), text
        assert "\n" not in text, text
        assert "--" not in text, "options are the command line's"
    with pytest.raises(RuntimeError, match="File: choose a file"):
        bpy.ops.synthroads.road_from_scan()
    assert block_counts() == before


def test_an_axis_file_that_is_none_is_refused(settings: Any, cloud: Path, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"none.csv: must be a readable axis file \(No such file"):
        bpy.ops.synthroads.road_from_scan(filepath=str(cloud), course=str(tmp_path / "none.csv"))
    (tmp_path / "far.csv").write_text("x,y\n0,0\n100,0\n200,0\n")
    with pytest.raises(RuntimeError, match="no point of the road lies within 45 m of it"):
        bpy.ops.synthroads.road_from_scan(filepath=str(cloud), course=str(tmp_path / "far.csv"))


def test_cancelling_leaves_everything_as_it_was(settings: Any, cloud: Path) -> None:
    before = block_counts()
    place = replace(shown_place(bpy.context.scene), keep_moves=False)
    job = PanelJob("Road from a Scan", scan_road.find_and_build(ReconstructionJob(cloud), settings.scenario(), place))
    job.start()
    shares = []
    begun = time.thread_time()  # of this thread alone: not of what runs aside, nor of what else the machine does
    while job.tick(0.0) and not shares[-1:] > [0.3]:
        assert time.thread_time() - begun < 0.5, "the window waits for no step of what is computed aside"
        shares.append(job.share)
        time.sleep(0.005)
        begun = time.thread_time()
    assert "Finding the road" in job.state
    job.stop()
    wait_for_end(job)
    assert isinstance(job.error, Cancelled)
    assert shares == sorted(shares)
    assert len(set(shares)) > 3
    assert running_job() is None
    assert block_counts() == before


def test_progress_never_goes_back(settings: Any, cloud: Path) -> None:
    place = shown_place(bpy.context.scene)
    job = PanelJob("Road from a Scan", scan_road.find_and_build(ReconstructionJob(cloud), settings.scenario(), place))
    job.start()
    shares = [job.share]
    while job.tick(0.0):
        shares.append(job.share)
        time.sleep(0.002)
    assert shares == sorted(shares)
    assert job.result.startswith("Built ")


def test_its_button_stands_with_the_files_of_a_road(settings: Any) -> None:
    cls = next(c for c in panels.CLASSES if c.bl_idname == "SYNTHROADS_PT_road")
    buttons = [line.strip() for line in lines(cls) if "synthroads." in line]
    assert "button 'Road from a Scan' synthroads.road_from_scan <POINTCLOUD_DATA>" in buttons
