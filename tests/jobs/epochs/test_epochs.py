"""Epochs made by the job: what each point's change says, what stays the same, and that every kind shows."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.jobs.epochs.epochs import EpochsJob, epoch_scenario, generate_epochs, plan_epochs
from synthroads_addon.jobs.generate import Job
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.materials.table import materials
from synthroads_addon.materials.variation import vary_material
from synthroads_addon.road.changes.change import Change, read_changes
from synthroads_addon.road.changes.edits import apply_changes
from synthroads_addon.road.changes.numbers import first_unused
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters, read_parameters
from synthroads_addon.road.pavement.surface import PavementSurface
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.sampling.changes import next_epoch
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.epochs.truth import CODES
from synthroads_addon.scenario.changes import DRAWN_KINDS, ChangeLimits
from synthroads_addon.scenario.scenario import Scenario, load_scenario

SETTINGS = [
    "fidelity=draft",
    "road.length=60",
    "colour.source=material",
    "colour.rgb=false",
    "vegetation_detail=0.1",
    "road.vehicles.per_km.maximum=0",
    "scan.relief=0",
    'outputs=["parameters","cloud"]',
    'cloud.formats=["npz"]',
    "seed=11",
]
OFTEN: dict[str, Any] = {
    "cut_back": 1.0,
    "settlements": 1.0,
    "overlays": 1.0,
    "marked_anew": 1.0,
    "construction_zones": 1.0,
    "years": 3.0,
    "worn_lines": 0.5,
    "hits_per_km": {"minimum": 20.0, "maximum": 20.0},
    "patches_per_km": {"minimum": 10.0, "maximum": 20.0},
    "cracks_per_km": {"minimum": 10.0, "maximum": 20.0},
    "things_per_km": {"minimum": 20.0, "maximum": 20.0},
    "parked_per_km": {"minimum": 30.0, "maximum": 30.0},
}


def scenario(*changes: str, limits: dict[str, Any] | None = None) -> Scenario:
    """Return a scenario of a short road and its changes."""
    settings = [*SETTINGS, f"road.changes={json.dumps(limits or OFTEN)}", *changes]
    return load_scenario("rq31-600m", settings)


def epochs(folder: Path, request: EpochsJob) -> list[dict[str, np.ndarray]]:
    """Run a job and return the arrays of each epoch's cloud."""
    generate_epochs(request)
    names = sorted(path for path in folder.glob("epoch-*/cloud.npz"))
    return [dict(np.load(path)) for path in names]


@pytest.fixture(scope="module")
def same(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, np.ndarray]]]:
    """Two epochs surveyed from the same path with the same seed."""
    folder = tmp_path_factory.mktemp("epochs") / "same"
    return folder, epochs(folder, EpochsJob(Job(scenario(), folder, new_file=True), same_survey=True))


def rows_by_pulse(cloud: dict[str, np.ndarray]) -> dict[tuple[float, ...], int]:
    """Return the row of each return by its pulse's time, its number and the number of returns."""
    columns = (cloud[name].tolist() for name in ("gps_time", "return_number", "number_of_returns"))
    keys = zip(*columns, strict=True)
    return {key: row for row, key in enumerate(keys)}


def test_unchanged_points_of_the_same_survey_have_identical_coordinates(same: Any) -> None:
    _, (first, second) = same
    rows = rows_by_pulse(first)
    pairs = [(rows[key], row) for key, row in rows_by_pulse(second).items() if key in rows]
    a, b = np.array(pairs).T
    still = (first["change"][a] == 0) & (second["change"][b] == 0)
    still &= (first["change_distance"][a] == 0) & (second["change_distance"][b] == 0)
    still &= first["instance_id"][a] == second["instance_id"][b]
    assert still.sum() > 0.5 * len(second["change"])
    assert (first["xyz"][a[still]] == second["xyz"][b[still]]).mean() > 0.99999


def test_the_clouds_say_what_changed(same: Any) -> None:
    folder, (first, second) = same
    changes = read_changes(folder / "epoch-2" / "changes.json")
    kinds = {change.number: CODES[change.kind] for change in changes.changes}
    for cloud in (first, second):
        numbers = np.unique(cloud["change_id"])
        assert len(numbers) > 8
        for number in numbers[numbers > 0].tolist():
            assert set(cloud["change"][cloud["change_id"] == number].tolist()) <= {kinds[number], CODES["mobile"]}
        assert ((cloud["change_id"] > 0) | (np.abs(cloud["change_distance"]) < 0.0005 + 1e-6)).mean() > 0.999
    lines = [change for change in changes.changes if change.kind == "worn" and change.things]
    assert lines
    for change in lines:
        assert 0.2 <= change.size <= 0.6 + 1e-6
        (edit,) = change.edits
        thinner = second["change_distance"][second["change_id"] == change.number]
        # A new course and a settlement lie over parts of the line.
        assert np.isclose(thinner, edit.after - edit.before, atol=1e-4).mean() > 0.2
    for kind in ("overlaid", "settled"):
        assert first["change_distance"][first["change"] == CODES[kind]].size > 100
    higher = second["change_distance"][second["change"] == CODES["overlaid"]]
    lower = first["change_distance"][first["change"] == CODES["overlaid"]]
    assert np.median(higher) > 0.015
    assert np.median(lower) < -0.015
    assert np.median(second["change_distance"][second["change"] == CODES["settled"]]) < -0.001


def test_surfaces_nearer_than_the_limit_are_unchanged(same: Any, tmp_path: Path) -> None:
    """Settlements are 0.04 m deep at most; as many points are theirs as lie lower by the usual limit."""
    limits = OFTEN | {"unchanged_below": 0.05}
    job = Job(scenario(limits=limits), tmp_path / "few", new_file=True)
    counts = []
    for clouds in (same[1], epochs(tmp_path / "few", EpochsJob(job, same_survey=True))):
        counts.append(int((clouds[1]["change"] == CODES["settled"]).sum()))
    assert counts[0] > 100
    assert counts[1] == 0


def test_the_files_of_the_epochs_belong_together(same: Any) -> None:
    folder, _ = same
    before = read_parameters(folder / "epoch-1" / "parameters.json")
    after = (folder / "epoch-2" / "parameters.json").read_text(encoding="utf-8")
    changes = read_changes(folder / "epoch-2" / "changes.json")
    assert apply_changes(before, changes).to_json() == after
    report = json.loads((folder / "epochs.json").read_text(encoding="utf-8"))
    assert all((folder / name).is_file() for name in report["files"])


def test_two_surveys_differ_and_say_what_was_not_seen(tmp_path: Path) -> None:
    request = EpochsJob(Job(scenario(limits={"kinds": []}), tmp_path / "two", new_file=True))
    clouds = epochs(tmp_path / "two", request)
    assert not np.array_equal(clouds[0]["xyz"][:100], clouds[1]["xyz"][:100])
    assert not clouds[0]["change_id"].any()
    assert not clouds[1]["change_id"].any()
    assert 0.0 <= clouds[1]["not_seen_before"].mean() < 0.2
    changes = read_changes(tmp_path / "two" / "epoch-2" / "changes.json")
    assert not changes.changes
    assert any(edit.path.startswith("environment") for edit in changes.circumstances)


def test_a_road_that_is_scanned_by_section_is_refused(tmp_path: Path) -> None:
    request = EpochsJob(Job(scenario("scan.section_length=20"), tmp_path / "long", new_file=True))
    with pytest.raises(InputError, match="epochs are scanned whole"):
        generate_epochs(request)
    assert not (tmp_path / "long").exists()


def test_each_epoch_has_its_own_seed_and_settings() -> None:
    job = Job(scenario(), None)
    request = EpochsJob(job, count=3, settings={2: ["scan.relief=0.5"]})
    scenarios = [epoch_scenario(request, number) for number in (1, 2, 3)]
    assert len({item.seed for item in scenarios}) == 3
    assert all("change" in item.cloud.attributes for item in scenarios)
    road = RoadGeometry(sample_road(job.scenario.road, job.scenario.seed))
    assert scenarios[1].scan.relief == 0.5
    planned = plan_epochs(request, road)
    assert [epoch.changes is None for epoch in planned] == [True, False, False]
    assert planned[2].road.parameters.metadata.identifier.endswith("+2")


@cache
def _road(construction: bool) -> RoadParameters:
    """Return a road with everything that changes can be about."""
    length = 170 if construction else 110
    hedges = 'road.roadside.hedges_per_km={"minimum":50,"maximum":50}'
    limits = scenario(f"road.length={length}", "road.barriers.noise_barrier=1", hedges)
    road = sample_road(limits.road, 11)
    sign = TrafficSign(
        instance=first_unused(road), station=40.0, offset=-17.0, code="274-120", shape="round", width=0.75, height=0.75
    )
    return road.model_copy(update={"objects": {**road.objects, "sign": sign}})


FORMS = [
    *(kind for kind in DRAWN_KINDS if kind != "damaged"),
    "bent",
    "leaning",
    "turned",
    "panel_missing",
    "worn line",
]


def is_of(change: Change, form: str) -> bool:
    """Return whether a change is of a kind or a detail of one; of worn paint, of all of it or of a line."""
    if change.kind == "worn":
        return form == ("worn line" if change.things else "worn")
    return form in (change.kind, change.detail)


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_every_kind_of_change_has_an_effect(form: str) -> None:
    before = _road(form == "construction_zone")
    kind = form if form in DRAWN_KINDS else "worn" if form == "worn line" else "damaged"
    limits = ChangeLimits.from_dict({**OFTEN, "kinds": [kind]})
    drawn = [next_epoch(before, limits, seed) for seed in range(6)]
    after, changes = next((item for item in drawn if any(is_of(change, form) for change in item[1].changes)), drawn[0])
    chosen = tuple(change for change in changes.changes if is_of(change, form))
    assert chosen
    after = apply_changes(before, changes.model_copy(update={"changes": chosen[:1]}))
    assert _looks(before) != _looks(after)


def _looks(road: RoadParameters) -> tuple[Any, ...]:
    """Return a road's mesh, the relief of its pavement and the materials that it is scanned with, to be compared."""
    geometry = RoadGeometry(road)
    scene = RoadScene.of(scenario(), geometry)
    from synthroads_addon.blender.files import empty_file

    empty_file()
    scene.build()
    mesh = scene.read().static
    station, offset = np.meshgrid(np.linspace(1.0, 59.0, 300), np.linspace(-12.0, 12.0, 200))
    relief = PavementSurface(geometry).height(station.ravel(), offset.ravel())
    table = materials()
    paint = [vary_material(item, road.materials, road.environment, table) for item in table]
    return mesh.vertices.tobytes(), mesh.triangles.tobytes(), relief.tobytes(), str(paint)
