"""The command `synthroads twin`, and the scenario's `twin`."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from headless import cli
from headless.twin import forecast
from synthroads_addon.base.errors import InputError
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from synthroads_addon.twin import formats as twin
from tests.helpers.roads.twin_roads import one_of_many
from tests.judges.registry import require

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def parameters(tmp_path: Path) -> Path:
    path = tmp_path / "parameters.json"
    path.write_text(one_of_many(3).to_json(), encoding="utf-8")
    return path


def run(*arguments: object) -> int:
    return cli.main(["twin", *(str(argument) for argument in arguments)])


def test_command_writes_what_is_asked_for(parameters: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert run(parameters, "--output", out, "--twin", "cityjson,geojson,cityjson", "--json") == 0
    assert sorted(path.name for path in out.iterdir()) == [
        "twin-cityjson-report.json",
        "twin-geojson-report.json",
        "twin.city.json",
        "twin.geojson",
    ]
    assert json.loads(capsys.readouterr().out)["files"]["geojson"] == str(out / "twin.geojson")
    assert run(parameters, "--output", out, "--twin", "geojson") == 2
    assert "already holds twin.geojson; --overwrite replaces it" in capsys.readouterr().err
    assert run(parameters, "--output", out, "--twin", "geojson", "--overwrite") == 0


def test_command_needs_no_blender(parameters: Path, tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['bpy'] = None; from headless.commands import command\n"
        f"raise SystemExit(command('twin', [{str(parameters)!r}, '--output', {str(tmp_path / 'o')!r}, "
        "'--twin', 'cityjson,geojson']))"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (("--twin", "cityjsn"), f"twin is 'cityjsn': must be one of {', '.join(twin.TWIN_FORMATS)} (did you mean"),
        (("--twin", ""), "twin is '': must be one of"),
        (("--max-deviation", "0"), "--max-deviation is 0.0: must be from 0.0001 to 1 m"),
        (("--max-deviation", "nan"), "--max-deviation is nan: must be from 0.0001 to 1 m"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    arguments: tuple[str, ...], wanted: str, parameters: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(parameters, "--output", tmp_path / "out", *arguments) == 2
    said = capsys.readouterr().err
    assert wanted in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_missing_package_is_named_with_its_extra(
    parameters: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(twin.FORMATS, "geojson", replace(twin.FORMATS["geojson"], package="no_such_package"))
    assert twin.missing_package("geojson") == "no_such_package"
    assert twin.missing_package("cityjson") is None
    assert run(parameters, "--output", tmp_path / "out", "--twin", "cityjson,geojson") == 2
    assert "needs the package no_such_package: pip install 'synthroads[twin]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_every_format_has_a_file_of_its_own() -> None:
    names = twin.twin_file_names(twin.TWIN_FORMATS)
    assert names[::2] == (
        "twin.city.json",
        "twin.ifc",
        "twin.xodr",
        "twin.osm",
        "twin.geojson",
        "twin.gpkg",
        "inventory.csv",
        "twin.crg",
    )
    assert names[1::2] == tuple(f"twin-{name}-report.json" for name in twin.TWIN_FORMATS)
    assert len(set(names)) == 2 * len(twin.TWIN_FORMATS)
    with pytest.raises(InputError, match="did you mean 'opendrive'"):
        twin.twin_file_names(["opendriv"])


def test_scenario_says_which_twins_are_wanted() -> None:
    assert Scenario().twin == ()
    assert load_scenario("rq31-600m", ['twin=["cityjson","geojson"]']).twin == ("cityjson", "geojson")
    with pytest.raises(InputError, match=r"twin.*cityjsn"):
        load_scenario("rq31-600m", ['twin=["cityjsn"]'])


def test_generate_writes_the_twin_without_a_scene(tmp_path: Path) -> None:
    pytest.importorskip("laspy")
    from synthroads_addon.jobs.generate import Job, generate

    scenario = load_scenario("rq31-600m", ["outputs=[]", 'twin=["cityjson"]', "road.length=60"])
    report = generate(Job(scenario, tmp_path))
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "report.json",
        "twin-cityjson-report.json",
        "twin.city.json",
    ]
    assert "twin" in report["stages"]


def test_long_models_are_announced_with_time_and_size() -> None:
    assert forecast(1000.0, ["ifc", "geojson"]) == ""
    said = forecast(50_000.0, ["ifc"])
    assert said.startswith("models of 50 km (ifc) take about 3 min and 215 MB")


def test_the_progress_of_an_ifc_model_grows_in_small_steps(tmp_path: Path) -> None:
    require("ifcopenshell")
    told: list[tuple[str, float]] = []
    twin.write_twin(
        sample_road(RoadScenario(length=300.0), 1),
        tmp_path,
        ["geojson", "ifc"],
        0.02,
        progress=lambda stage, share: told.append((str(stage), share)),
    )
    shares = np.array([share for _, share in told])
    assert {stage for stage, _ in told} == {"GeoJSON", "IFC"}
    assert (np.diff(shares) >= -1e-9).all()
    assert len(set(shares.round(3).tolist())) > 30
    assert np.diff(shares[:-1]).max() < 0.2
    assert shares[-1] > 0.75


def test_a_job_tells_how_far_its_models_are(tmp_path: Path) -> None:
    require("ifcopenshell")
    from synthroads_addon.jobs.generate import Job, generate

    told: list[tuple[str, str, float]] = []

    def tell(stage: str, share: float) -> None:
        told.append((str(stage), getattr(stage, "detail", ""), share))

    scenario = load_scenario("rq31-600m", ["outputs=[]", 'twin=["geojson","ifc"]', "road.length=300"])
    generate(Job(scenario, tmp_path), tell)
    shares = [share for stage, _, share in told if stage == "twin"]
    assert {detail for stage, detail, _ in told if stage == "twin"} >= {"GeoJSON", "IFC"}
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len({round(share, 3) for share in shares}) > 30


def test_reconstruction_tells_how_far_its_models_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of the road that was found, after the stages of finding it."""
    from headless import reconstruct
    from tests.helpers.clouds.road_clouds import cloud_of, road, write

    told: list[tuple[str, str]] = []
    monkeypatch.setattr(
        reconstruct,
        "progress_bar",
        lambda _: lambda stage, share: told.append((str(stage), getattr(stage, "detail", ""))),
    )
    cloud = write(tmp_path / "cloud.laz", cloud_of(road("RQ31", "EKA1A", 120.0, 4), 4.0, 4))
    words = ["--output", str(tmp_path / "out"), "--twin", "geojson", "--no-picture"]
    assert cli.main(["reconstruct", str(cloud), *words]) in (0, 3)
    assert told[-1] == ("twin", "GeoJSON")
