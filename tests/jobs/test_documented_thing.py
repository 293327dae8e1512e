"""The page on adding a thing, followed to the letter: three files, and salt bins are everywhere where they belong."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.page_modules import ROOT

PAGE = ROOT / "docs" / "extend" / "thing.md"
LOOK = """
import json, os, sys
from pathlib import Path
from xml.etree import ElementTree

import bpy, ifcopenshell, numpy as np
from ifcopenshell.util.element import get_pset

import synthroads_addon
from synthroads_addon.checking.checker import check
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.road.parameters import RoadParameters, read_parameters
from synthroads_addon.scenario.scenario import load_scenario

out = Path(sys.argv[1])
changes = ["road.length=60", "road.half_width=30", "scan.platform.speed=40", 'cloud.formats=["npz"]']
changes += [f"road.furniture.salt_bins_per_km.{end}=50" for end in ("minimum", "maximum")]
changes += ['outputs=["parameters","cloud","scene"]', 'twin=["cityjson","ifc","opendrive"]']
generate(Job(load_scenario("mobile-mapping-300m", changes), out))
road = read_parameters(out / "parameters.json")
bins = {name: item.instance for name, item in road.objects.items() if item.type == "SaltBin"}
with open_cloud(out / "cloud.npz") as cloud:
    points = np.concatenate([block.instance_id for block in cloud.blocks()])
city = json.loads((out / "twin.city.json").read_text())["CityObjects"]
file = ifcopenshell.open(str(out / "twin.ifc"))
elements = {item.Name: get_pset(item, "SynthRoads")["instance"] for item in file.by_type("IfcFurniture")}
drive = {item.get("name"): int(item.get("id")) for item in ElementTree.parse(out / "twin.xodr").iter("object")}
data = road.to_dict()
first = next(iter(bins))
data["objects"][first]["offset"] = -6.0
print("SEEN " + json.dumps({
    "package": synthroads_addon.__file__,
    "set": bins,
    "model": sorted(item.name for item in bpy.data.objects if item.name in bins),
    "cloud": {name: int((points == number).sum()) for name, number in bins.items()},
    "cityjson": {name: city[name]["attributes"]["instance"] for name in bins},
    "ifc": {name: elements[name] for name in bins},
    "opendrive": {name: drive[name] for name in bins},
    "checker": [finding.object for finding in check(RoadParameters.from_dict(data))],
    "moved": first,
}), flush=True)
os._exit(0)
"""
"""Program that makes a road with the page's salt bins and prints where they are."""


@pytest.mark.slow
@pytest.mark.any_blender
def test_three_files_make_salt_bins(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "synthroads_addon", tmp_path / "synthroads_addon")
    shutil.copy(ROOT / "blender_manifest.toml", tmp_path)
    blocks = re.findall(r"Save this as `([^`]+)`:\n\n```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 3
    for path, code in blocks:
        assert not (tmp_path / path).exists()
        (tmp_path / path).write_text(code, encoding="utf-8")
    seen = run(tmp_path)
    assert Path(seen["package"]).is_relative_to(tmp_path)
    bins = seen["set"]
    assert len(bins) >= 2
    assert seen["model"] == sorted(bins)
    assert min(seen["cloud"].values()) > 20
    assert seen["cityjson"] == seen["ifc"] == seen["opendrive"] == bins
    assert seen["moved"] in seen["checker"]


def run(folder: Path) -> dict[str, Any]:
    """Run `LOOK` with the package of a folder."""
    arguments = [sys.executable, "-c", LOOK, str(folder / "out")]
    done = subprocess.run(
        arguments,
        check=False,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("SEEN ")]
    assert lines, done.stderr[-2000:]
    return dict(json.loads(lines[0].removeprefix("SEEN ")))
