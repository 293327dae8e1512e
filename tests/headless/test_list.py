"""`synthroads list`: what is shipped and one's own files, with their figures; and the fields that --set takes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from headless import cli
from headless.list import KINDS
from ml.configuration import SHIPPED
from synthroads_addon.base.changes import apply_values
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.field_list import FieldEntry, fields_of
from synthroads_addon.base.text.typed import alternatives
from synthroads_addon.dataset.recipe import load_recipe, recipe_names, scene_jobs
from synthroads_addon.scanning.devices.device import DEVICES, device_names, load_device
from synthroads_addon.scenario.scenario import Scenario, scenario_names

ROOT = Path(__file__).parents[2]
Capture = pytest.CaptureFixture[str]


def shown(capsys: Capture, *words: str) -> list[str]:
    """Return the lines that the command prints for people."""
    assert cli.main(["list", *words]) == 0
    return capsys.readouterr().out.splitlines()


def data(capsys: Capture, kind: str, *words: str) -> list[dict[str, Any]]:
    assert cli.main(["list", kind, *words, "--json"]) == 0
    found: list[dict[str, Any]] = json.loads(capsys.readouterr().out)[kind]
    return found


def refused(capsys: Capture, *words: str) -> str:
    assert cli.main(["list", *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


@pytest.mark.parametrize("kind", KINDS)
def test_everything_shipped_is_listed(kind: str, capsys: Capture) -> None:
    found = data(capsys, kind)
    assert [one["name"] for one in found] == KINDS[kind].names()
    for one in found:
        assert one["title"]
        assert Path(one["file"]).is_file()
    lines = shown(capsys, kind)
    assert lines[-1] == f"use: {KINDS[kind].use}"
    assert {line.split()[0] for line in lines[1:-2]} == set(KINDS[kind].names())


def test_the_kinds_are_those_that_there_are(capsys: Capture) -> None:
    rows = {line.split()[0]: line.split()[1] for line in shown(capsys)[1:]}
    assert rows == {name: str(len(kind.names())) for name, kind in KINDS.items()} | {
        "fields": str(len(list(fields_of(Scenario))))
    }
    assert {"scenarios": scenario_names(), "devices": device_names(), "recipes": recipe_names()} == {
        name: KINDS[name].names() for name in ("scenarios", "devices", "recipes")
    }
    assert KINDS["trainings"].names() == sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def test_figures_are_the_files(capsys: Capture) -> None:
    for one in data(capsys, "devices"):
        device = load_device(one["name"])
        assert one["wavelength_nm"] == device.wavelength_nm
        assert one["pulse_rates_khz"] == [mode.pulse_rate_khz for mode in device.modes]
    for one in data(capsys, "recipes"):
        jobs = scene_jobs(load_recipe(one["name"]))
        assert one["scenes"] == len(jobs)
        assert one["splits"] == {split: [job.split for job in jobs].count(split) for split in one["splits"]}
    for one in data(capsys, "classes"):
        assert [row["name"] for row in one["classes"]] == [row.name for row in class_scheme(one["name"]).rows]
    assert {one["name"]: one["epochs"] for one in data(capsys, "trainings")}["segmentation-small"] == 10
    (line,) = (line for line in shown(capsys, "devices") if line.startswith("riegl-minivux-3uav"))
    assert re.split(r"\s{2,}", line)[2:4] == ["905", "100, 200, 300"]


def test_names_can_be_chosen_by_their_beginning(capsys: Capture) -> None:
    assert [one["name"] for one in data(capsys, "devices", "velodyne", "generic-grid")] == [
        *(name for name in device_names() if name.startswith("velodyne")),
        "generic-grid",
    ]
    both_sides = ["list", "--json", "devices", "--quiet", "livox", "velodyne-vlp"]
    for argv in (both_sides, [*both_sides[:1], *both_sides[2:], "--json"]):
        assert cli.main(argv) == 0
        found = json.loads(capsys.readouterr().out)["devices"]
        assert [one["name"] for one in found] == ["livox-mid-70", "velodyne-vlp-16", "velodyne-vlp-32c"]
    assert "did you mean 'riegl-vq-450'" in refused(capsys, "devices", "rigel-vq-450")
    assert "fields is 'scan.x': no field of the scenario begins so" in refused(capsys, "fields", "scan.x")
    assert "--of is 'segmentation': is for fields only" in refused(capsys, "devices", "--of", "segmentation")
    assert "KIND is 'device': must be one of" in refused(capsys, "device")
    with pytest.raises(SystemExit, match="2"):
        cli.main(["list", "devices", "--jsn", "livox"])
    assert "unrecognized arguments: --jsn" in capsys.readouterr().err


def test_files_of_ones_own_are_described_or_refused(tmp_path: Path, capsys: Capture) -> None:
    own = json.loads((DEVICES / "riegl-vq-450.json").read_text()) | {"title": "Mine", "wavelength_nm": 700.0}
    for name in ("b.json", "a.json"):
        (tmp_path / name).write_text(json.dumps(own))
    (tmp_path / "notes.txt").write_text("not a device")
    found = data(capsys, "devices", str(tmp_path))
    assert [(one["name"], one["title"], one["wavelength_nm"]) for one in found] == [
        (str(tmp_path / name), "Mine", 700.0) for name in ("a.json", "b.json")
    ]
    assert data(capsys, "devices", str(tmp_path / "b.json")) == found[1:]
    (tmp_path / "b.json").write_text(json.dumps(own | {"wavelength_nm": -1}))
    assert "b.json: wavelength_nm is -1" in refused(capsys, "devices", str(tmp_path))
    training = tmp_path / "training.yaml"
    training.write_text("task: segmentation\ntitle: Mine\nschedule: {epochs: 3}\ndata: {real: [{path: here}]}\n")
    (made,) = data(capsys, "trainings", str(training))
    assert (made["title"], made["epochs"], made["data"]) == ("Mine", 3, ["here"])
    training.write_text("- a\n- b\n")
    assert "training.yaml: must be an object" in refused(capsys, "trainings", str(training))


def paths(kind: Any, above: str = "") -> Iterator[str]:
    """Yield the paths of all fields of a class, told from the classes themselves and not from their schema."""
    for name, info in kind.model_fields.items():
        if name in ("type", "version") and not above:
            continue
        yield f"{above}{name}"
        for inner in alternatives(info.annotation):
            if isinstance(inner, type) and issubclass(inner, BaseModel):
                yield from paths(inner, f"{above}{name}.")


def fault_of(field: FieldEntry) -> str:
    """Return why a scenario with nothing but this field's default is refused: a part of an object alone, say."""
    data = apply_values({"road": {"cross_section": {"lanes": [3.5, 3.5]}}}, {field.path: field.default})
    try:
        Scenario.from_dict(data)
    except InputError as error:
        return str(error)
    return ""


def test_every_field_is_listed_and_taken() -> None:
    found = list(fields_of(Scenario))
    assert sorted(one.path for one in found) == sorted(set(paths(Scenario)))
    assert [one.path for one in found if not one.description] == []
    faults = {one.path: fault_of(one) for one in found}
    assert {path for path, fault in faults.items() if "unknown key" in fault} == set()


def test_fields_say_all_that_is_to_be_known(capsys: Capture) -> None:
    by_path = {one["path"]: one for one in data(capsys, "fields")}
    assert by_path["scan.platform.height"] == {
        "path": "scan.platform.height",
        "type": "number, from 0.1 to 5000",
        "unit": "m",
        "allowed": None,
        "minimum": 0.1,
        "maximum": 5000,
        "required": False,
        "default": None,
        "description": "Height above the road.",
    }
    assert by_path["fidelity"]["allowed"] == ["draft", "standard", "high"]
    assert by_path["road.undulation.minimum"]["unit"] == "m"
    assert by_path["road.undulation.minimum"]["default"] == 0.05
    lines = shown(capsys, "fields", "road.undulation", "fidelity")
    assert [re.split(r"\s{2,}", line) for line in lines] == [
        ["path", "default", "meaning"],
        ["fidelity", "standard", "Speed against accuracy, as a preset. [one of draft, standard, high]"],
        [
            "road.undulation.{minimum,maximum}",
            "0.05 to 0.8 m",
            "Standard deviation of the ground. [two numbers, in m]",
        ],
    ]


def test_it_needs_neither_pytorch_nor_blender() -> None:
    code = (
        "import sys; sys.modules['torch'] = sys.modules['bpy'] = None; from headless.commands import command\n"
        f"raise SystemExit(max(command('list', [kind, '--quiet']) for kind in {[*KINDS, 'fields']!r}))"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


@pytest.mark.parametrize(("task", "path"), [("segmentation", "network.preset"), ("centerline", "slices.truth")])
def test_fields_of_trainings(task: str, path: str, capsys: Capture) -> None:
    pytest.importorskip("torch")
    found = {one["path"]: one for one in data(capsys, "fields", "--of", task)}
    assert found[path]["allowed"]
    assert found["schedule.epochs"]["default"] == 50
    if task == "segmentation":
        assert found["fine_tuning.epochs"]["default"] == 30, "the field's own default, not that of its class"
