"""The files of the reader's own that the pages take for granted, made small by the project itself.

Each function writes one file into a folder in which `synthroads generate --output out/mine` was run before, by the
interpreter of the environment that is tried.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

from tests.doors.documented import ROOT

_RECIPES = ROOT / "synthroads_addon" / "presets" / "recipes"
_SCENARIOS = ROOT / "synthroads_addon" / "presets" / "scenarios"


def _axis(python: Path, folder: Path) -> None:
    """Write the first road's centreline as CSV with x, y, z."""
    line = json.loads((folder / "out/mine/centerline.geojson").read_text(encoding="utf-8"))
    rows = [",".join(map(str, point)) for point in line["features"][0]["geometry"]["coordinates"]]
    (folder / "axis.csv").write_text("\n".join(["x,y,z", *rows, ""]), encoding="utf-8")


def _xodr(python: Path, folder: Path) -> None:
    """Write a road of OpenDRIVE: a line and an arc that rise."""
    plan = '<geometry s="0" x="500000" y="5600000" hdg="0" length="60"><line/></geometry>'
    plan += '<geometry s="60" x="500060" y="5600000" hdg="0" length="90"><arc curvature="0.002"/></geometry>'
    heights = '<elevationProfile><elevation s="0" a="100" b="0.02" c="0" d="0"/></elevationProfile>'
    header = '<header revMajor="1" revMinor="8"><geoReference>EPSG:25832</geoReference></header>'
    road = f'<road name="mine" id="1" junction="-1" length="150"><planView>{plan}</planView>{heights}</road>'
    (folder / "road.xodr").write_text(f"<OpenDRIVE>{header}{road}</OpenDRIVE>", encoding="utf-8")


def _osm(python: Path, folder: Path) -> None:
    """Write a map of OpenStreetMap with the two carriageways of a motorway, 13 m apart, 300 m long."""
    sides = ((50.0, 1, (1, 2, 3)), (50.000117, 4, (6, 5, 4)))
    nodes = [
        f'<node id="{first + n}" lon="{9.0 + 0.0021 * n}" lat="{north}"/>'
        for north, first, _ in sides
        for n in range(3)
    ]
    tags = '<tag k="highway" v="motorway"/><tag k="ref" v="A 9"/><tag k="lanes" v="2"/>'
    ways = []
    for _, first, order in sides:
        inner = "".join(f'<nd ref="{number}"/>' for number in order)
        ways.append(f'<way id="{first}">{inner}{tags}</way>')
    (folder / "map.osm").write_text(f'<osm version="0.6">{"".join([*nodes, *ways])}</osm>', encoding="utf-8")


def empty_binary_map() -> bytes:
    """Return a binary map of OpenStreetMap that holds a header alone."""
    header = b"\x22\x0eOsmSchema-V0.6\x22\x0aDenseNodes"
    blob = b"\x0a" + bytes([len(header)]) + header
    head = b"\x0a\x09OSMHeader\x18" + bytes([len(blob)])
    return len(head).to_bytes(4, "big") + head + blob


def _scan(python: Path, folder: Path) -> None:
    """Scan a road that is long enough to be found again, thinly, as if by somebody else."""
    options = ["--set", "road.length=180", "--set", "road.half_width=20", "--set", "scan.platform.speed=20"]
    options += ["--set", 'outputs=["parameters", "cloud"]', "--fidelity", "draft", "--seed", "3", "--quiet"]
    _run(python, folder, "-m", "headless.generate", "--output", "out/of-others", *options)
    shutil.copy(folder / "out/of-others/cloud.laz", folder / "scan.laz")


def _scene(python: Path, folder: Path) -> None:
    _run(python, folder, str(ROOT / "tools" / "example_scene.py"), "scene.glb")


def _real(python: Path, folder: Path) -> None:
    """Write a list of two clouds that stand in for real ones."""
    text = "type: CloudList\nclouds:\n  - cloud: out/wide/cloud.laz\n  - cloud: out/real/cloud.laz\n"
    (folder / "real.yaml").write_text(text, encoding="utf-8")


def _road(python: Path, folder: Path) -> None:
    """Write what the panel's Save Set writes: a parameter set."""
    shutil.copy(folder / "out/mine/parameters.json", folder / "road.json")


def _scenario(python: Path, folder: Path) -> None:
    """Write a scenario of a short road."""
    scenario = json.loads((_SCENARIOS / "rq31-600m.json").read_text(encoding="utf-8"))
    scenario["fidelity"] = "draft"
    scenario["road"] |= {"length": 60.0, "half_width": 20.0}
    (folder / "small.json").write_text(json.dumps(scenario), encoding="utf-8")


def _recipe(name: str, scenes: dict[str, str], file: str = "") -> Callable[[Path, Path], None]:
    """Return what writes a shipped recipe with fewer scenes; groups that aren't named are left out.

    Args:
        name: of the recipe.
        scenes: name of a group -> its splits, as the recipe writes them, with one scene each.
        file: that is written; NAME.yaml if empty.
    """

    def write(python: Path, folder: Path) -> None:
        head, *groups = re.split(r"(?m)^  - name: ", (_RECIPES / f"{name}.yaml").read_text(encoding="utf-8"))
        kept = [head]
        for group in groups:
            called = group.partition("\n")[0]
            if called in scenes:
                count = len(scenes[called].split(","))
                text = re.sub(r"(?m)^(    scenes:) .*$", rf"\1 {count}", group, count=1)
                kept.append(re.sub(r"(?m)^(    split:) .*$", rf"\1 {scenes[called]}", text, count=1))
        if len(kept) != len(scenes) + 1:
            raise ValueError(f"{name}: its groups are others than {', '.join(scenes)}")
        (folder / (file or f"{name}.yaml")).write_text("  - name: ".join(kept), encoding="utf-8")

    return write


INPUTS: dict[str, Callable[[Path, Path], None]] = {
    "axis.csv": _axis,
    "road.xodr": _xodr,
    "map.osm": _osm,
    "scan.laz": _scan,
    "scene.glb": _scene,
    "real.yaml": _real,
    "road.json": _road,
    "small.json": _scenario,
    "reference.yaml": _recipe("reference", {"plain-600": "{train: 1, test: 1}", "gantries-600": "{train: 1}"}),
    "one-scene.yaml": _recipe("reference", {"plain-600": "{train: 1}"}, "one-scene.yaml"),
    "standin.yaml": _recipe("standin", {"roads": "{train: 1}", "gantries": "{test_gantries: 1}"}),
    "small-roads.yaml": _recipe("small-roads", {"roads": "{train: 1, validation: 1, test: 1}"}),
}
"""Name of a file -> what writes it, given the environment's interpreter and the folder."""
MADE_FROM = {
    **dict.fromkeys(("axis.csv", "road.json"), ("out/mine",)),
    "real.yaml": ("out/wide", "out/real"),
}
"""Name of a file -> what lines write that it is made from, or that it names."""


def _run(python: Path, folder: Path, *words: str) -> None:
    answer = subprocess.run([str(python), *words], cwd=folder, capture_output=True, text=True, check=False)
    if answer.returncode:
        raise RuntimeError(f"{' '.join(words)}: {answer.stderr}")
