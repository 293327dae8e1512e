"""Commands on roads and clouds with what is given beside the cloud made wrong: axes, truths, lists, tables, schemes."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import strategies as st
from PIL import Image

from synthroads_addon.base.files import PRESETS
from synthroads_addon.base.schema import read_json
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.devices.device import DEVICES
from synthroads_addon.scenario.assets import LIBRARIES
from synthroads_addon.scenario.road import RoadScenario
from tests.fuzz.test_bytes import SHORT, cloud
from tests.helpers.clouds.calibration_cloud import labelled
from tests.helpers.clouds.road_clouds import block_of, write
from tests.helpers.files.command_runs import IN, OUT, Case, MakeWorkplace, fuzz_commands, wrong_file, wrong_words
from tests.helpers.files.mutations import damaged, json_files, yaml_files

STRIP = 90.0
"""Length of the road, m."""
NAMES = (
    "",
    ".",
    "/dev/null",
    "/",
    "nowhere",
    "\udcff",
    "x" * 300,
    f"{IN}/words.txt",
    f"{IN}/road.las",
    f"{IN}/axis.csv",
)
"""Names that point elsewhere than a file of the wanted kind."""
NUMBERS = ("nan", "inf", "-1", "0", "1e300", "-1e300", "1e-300", "x", "", "99999999999999999999", "1,2", "é")
LISTED = {
    "type": "CloudList",
    "version": "1.0",
    "clouds": [
        {"cloud": "road.las", "class_field": "label", "road": "40", "marking": "60", "decibels": 30.0},
        {"cloud": "road.las", "axis": "axis.csv", "paved": [[-3.5, 3.5]], "lines": [0.0], "scanner": [0, 0, 10]},
    ],
}
RECIPE = {
    "title": "t",
    "set": {"fidelity": "draft", "road.length": 40},
    "layouts": ["pointcept"],
    "groups": [{"name": "a", "scenes": 3, "split": {"train": 2, "val": 1}, "variants": [{"seed": 1}, {"seed": 2}]}],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which commands work."""
    folder = tmp_path_factory.mktemp("commands")
    write_inputs(folder / "in")
    return folder


def write_inputs(folder: Path) -> None:
    """Write all inputs into a folder that isn't there yet."""
    folder.mkdir()
    rng = np.random.default_rng(3)
    count = 20_000
    xyz = np.column_stack([rng.uniform(0.0, STRIP, count), rng.uniform(-9.0, 9.0, count), rng.normal(0.0, 0.01, count)])
    paved, line = np.abs(xyz[:, 1]) < 3.5, np.abs(np.abs(xyz[:, 1]) - 3.2) < 0.1
    xyz[~paved, 2] += rng.uniform(0.0, 0.1, np.count_nonzero(~paved))
    bright = np.where(line, 0.6, np.where(paved, 0.2, 0.4)) + rng.normal(0.0, 0.02, count)
    labels = np.where(line, 2, np.where(paved, 1, 0)).astype(np.uint8)
    write(folder / "strip.laz", block_of(xyz + [294_000.0, 5_628_000.0, 100.0], np.clip(bright, 0.0, 1.0), labels))
    steps = np.arange(0.0, STRIP, 5.0)
    axis = np.column_stack([steps + 294_000.0, 0.0 * steps + 5_628_000.0, 0.0 * steps + 100.0])
    np.savetxt(folder / "strip.csv", axis, delimiter=",", header="x,y,z", comments="", fmt="%.3f")
    line_string = {"type": "LineString", "coordinates": axis.round(3).tolist()}
    (folder / "strip.geojson").write_text(json.dumps(line_string))
    labelled(folder / "road.las", 30.0, 9000.0)
    straight = np.column_stack([steps, 50.0 + 0.0 * steps, 0.0 * steps])
    np.savetxt(folder / "axis.csv", straight, delimiter=",", header="x,y,z", comments="", fmt="%.3f")
    cloud(folder / "cloud.laz", 800)
    (folder / "truth.json").write_text(json.dumps(sample_road(RoadScenario(length=90.0), 1).to_dict()))
    shutil.copy(PRESETS / "classes_5.json", folder / "classes.json")
    shutil.copy(PRESETS / "materials.json", folder / "materials.json")
    shutil.copy(DEVICES / "riegl-vux-1uav22.json", folder / "device.json")
    Image.fromarray(rng.integers(0, 256, (20, 30, 3), np.uint8)).save(folder / "texture.png")
    shutil.copytree(next(path for path in LIBRARIES.iterdir() if path.is_dir()), folder / "assets")
    (folder / "clouds.yaml").write_text(yaml.safe_dump(LISTED))
    (folder / "recipe.yaml").write_text(yaml.safe_dump(RECIPE))
    (folder / "words.txt").write_text("no file of any kind")


def files(folder: Path, words: Case | tuple[str, ...], *names: str) -> st.SearchStrategy[Case]:
    """Return cases of a command in which one of some inputs is made wrong in a way that fits its kind."""
    cases = []
    for name in names:
        path = folder / "in" / name
        if path.suffix in (".json", ".geojson"):
            wrong = json_files([read_json(path)])
        elif path.suffix == ".yaml":
            wrong = yaml_files([yaml.safe_load(path.read_text())])
        else:
            wrong = damaged([path.read_bytes()], SHORT, head=900)
        cases.append(wrong_file(words, name, wrong))
    return st.one_of(*cases)


CENTRELINE = ("centerline", f"{IN}/strip.laz", "--run", "none", "--output", f"{OUT}/a.geojson")
RECONSTRUCT = ("reconstruct", f"{IN}/strip.laz", "--no-picture", "--output", f"{OUT}/road")
COMPARE = ("compare", f"{IN}/clouds.yaml", f"{IN}/clouds.yaml", "--output", f"{OUT}/compared")
CALIBRATE = (
    *("calibrate", "--real", f"{IN}/road.las", "--class-field", "label", "--decibels", "30"),
    *("--material", "asphalt=40", "--material", "paint_white=60", "--save", f"{OUT}/table.json"),
)
BESIDE_AN_AXIS = (
    *("calibrate", "--real", f"{IN}/road.las", "--axis", f"{IN}/axis.csv", "--paved=-30,30"),
    *("--material", "asphalt=paved", "--save", f"{OUT}/table.json"),
)
CONVERT = ("cloud", "convert", f"{IN}/cloud.laz", "--output", f"{OUT}/a.ply")
PARAMETERS = ("parameters", "--length", "60")


@pytest.mark.parametrize(
    "words", [CENTRELINE, RECONSTRUCT, CALIBRATE, BESIDE_AN_AXIS, CONVERT], ids=lambda words: words[0]
)
def test_sound_ones_are_taken(words: tuple[str, ...], folder: Path, workplace: MakeWorkplace) -> None:
    """Else the tests below would show nothing."""
    assert workplace(folder, f"{words[0]}: sound").run((words, {})) in (0, 3)


@fuzz_commands(2, 100)
def test_centrelines(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    cases = [
        files(folder, (*CENTRELINE, option, f"{IN}/{name}"), name)
        for option in ("--path", "--truth")
        for name in ("strip.csv", "strip.geojson")
    ]
    more = [(option, name) for option in ("--path", "--truth", "--run", "--output") for name in NAMES]
    workplace(folder, "centerline: path, truth, words").run_all(st.one_of(*cases, wrong_words(CENTRELINE, more)), count)


@fuzz_commands(2, 100)
def test_reconstructions(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    cases = [
        files(folder, (*RECONSTRUCT, option, f"{IN}/{name}"), name)
        for option, name in (("--path", "strip.csv"), ("--truth", "truth.json"), ("--truth", "strip.geojson"))
    ]
    more = [
        *((option, name) for option in ("--path", "--truth", "--run", "--output", "--twin") for name in NAMES),
        *((f"--fit-tolerance={number}",) for number in NUMBERS),
    ]
    workplace(folder, "reconstruct: path, truth, words").run_all(
        st.one_of(*cases, wrong_words(RECONSTRUCT, more)), count
    )


@fuzz_commands(3, 200)
def test_comparisons(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    more = [*((f"--seed={number}",) for number in NUMBERS), *(("--output", name) for name in NAMES)]
    places = [("compare", *pair, "--output", f"{OUT}/c") for name in NAMES for pair in ((name, f"{IN}/road.las"),)]
    cases = [files(folder, COMPARE, "clouds.yaml", "clouds.yaml", "axis.csv"), wrong_words(COMPARE, more)]
    cases.append(st.sampled_from(places).map(lambda words: (words, {})))
    workplace(folder, "compare: list, axis, words").run_all(st.one_of(*cases), count)


@fuzz_commands(3, 350)
def test_calibrations(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    textured = (*CALIBRATE, "--texture", f"asphalt={IN}/texture.png@2")
    table, device = (*CALIBRATE, "--table", f"{IN}/materials.json"), (*CALIBRATE, "--device", f"{IN}/device.json")
    numbers = (
        "--line-width",
        "--attenuation",
        "--decibels",
        "--gain",
        "--range",
        "--incidence-deg",
        "--scanner",
        "--paved",
        "--line",
    )
    names = (
        "--table",
        "--device",
        "--save",
        "--save-device",
        "--save-recipe",
        "--plot",
        "--axis",
        "--real",
        "--class-field",
        "--hold",
    )
    more = [
        *((f"{option}={number}",) for option in numbers for number in NUMBERS),
        *((option, name) for option in names for name in NAMES),
        *(
            ("--material", text)
            for text in ("", "=", "asphalt=", "=40", "nothing=40", "asphalt=99999999999", "asphalt=nan")
        ),
        *(("--texture", text) for text in ("", "=", "asphalt=", "asphalt=nowhere.png", f"asphalt={IN}/texture.png@0")),
        *(("--fit", text) for text in ("", "none", "x", "spread,spread", ",")),
    ]
    cases = [
        files(folder, table, "materials.json"),
        files(folder, device, "device.json"),
        files(folder, textured, "texture.png"),
        files(folder, BESIDE_AN_AXIS, "axis.csv"),
        wrong_words(CALIBRATE, more),
        wrong_words(BESIDE_AN_AXIS, more),
    ]
    workplace(folder, "calibrate: table, device, texture, words").run_all(st.one_of(*cases), count)


@fuzz_commands(3, 350)
def test_tools_of_clouds(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    one = f"{IN}/cloud.laz"
    tools = {
        CONVERT: ("--classes",),
        ("cloud", "subsample", one, "--output", f"{OUT}/a.laz", "--grid", "1"): ("--classes", "--grid"),
        ("cloud", "map-intensity", one, "--target", one, "--output", f"{OUT}/a.laz"): ("--target",),
        ("cloud", "crop", one, "--output", f"{OUT}/a.laz", "--heights", "-1e4", "1e4"): ("--polygon", "--heights=0"),
        ("cloud", "tile", one, "--output", f"{OUT}/tiles"): ("--size", "--grid", "--fewest", "--format"),
        ("cloud", "merge", one, one, "--output", f"{OUT}/a.laz"): ("--output",),
        ("cloud", "preview", one, "--output", f"{OUT}/p", "--picture", "section"): (
            "--centerline",
            "--station",
            "--depth",
        ),
    }
    more = [
        wrong_words(words, [(f"{option}={value}",) for option in options for value in (*NUMBERS, *NAMES)])
        for words, options in tools.items()
    ]
    scheme = [(*words, "--classes", f"{IN}/classes.json") for words, options in tools.items() if "--classes" in options]
    cases = [*more, *(files(folder, words, "classes.json") for words in scheme)]
    workplace(folder, "cloud: scheme, words").run_all(st.one_of(*cases), count)


@fuzz_commands(3, 300)
def test_lists_and_roads_with_assets(folder: Path, workplace: MakeWorkplace, count: int) -> None:
    """Recipes, schemes and libraries as `list` reads them; assets, and a texture's folder, as a road takes them."""
    with_assets = (*PARAMETERS, "--set", f'road.assets=["{IN}/assets/library.json"]')
    cases = [
        files(folder, ("list", "recipes", f"{IN}/recipe.yaml"), "recipe.yaml"),
        files(folder, ("list", "classes", f"{IN}/classes.json"), "classes.json"),
        files(folder, ("list", "material-tables", f"{IN}/materials.json"), "materials.json"),
        files(folder, ("list", "assets", f"{IN}/assets/library.json"), "assets/library.json"),
        files(folder, ("list", "devices", f"{IN}/device.json"), "device.json"),
        files(folder, with_assets, "assets/library.json", "assets/library.json", "assets/windsock.mtl"),
        wrong_words(
            PARAMETERS,
            [
                ("--set", f"road.{name}={json.dumps(value)}")
                for name in ("assets", "textures")
                for value in (*NAMES[:5], [], [1], ["nowhere"], {"a": 1})
            ],
        ),
        *(
            wrong_words(("list", kind), [(name,) for name in NAMES])
            for kind in ("recipes", "classes", "assets", "devices", "trainings", "models")
        ),
    ]
    workplace(folder, "list, parameters: recipe, scheme, assets", writes=False).run_all(st.one_of(*cases), count)
