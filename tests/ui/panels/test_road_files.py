"""Roads from and to files: the buttons do what the library does, and bad files are messages."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model.store import find_road, recall
from synthroads_addon.jobs.axis_points import PathPlace
from synthroads_addon.jobs.generate import Job, RoadSource, generate
from synthroads_addon.road.parameters import RoadParameters, read_parameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from synthroads_addon.ui.fields.room import text_width
from synthroads_addon.ui.panels.road_files import SYNTHROADS_OT_load_axis, source_file_name
from synthroads_addon.ui.work.long_operator import LongOperator
from tests.helpers.roads.written_lines import opendrive, xodr_road
from tests.helpers.roads.written_maps import motorway
from tests.helpers.scenes.fake_layout import FakeLayout
from tests.helpers.scenes.panel_road import SAME, cheap, road, road_file, settings, small_pictures

__all__ = ["cheap", "road", "road_file", "settings", "small_pictures"]

pytestmark = [pytest.mark.usefixtures("small_pictures"), pytest.mark.any_blender]


def set_file(folder: Path) -> Path:
    """Write a set that the panel's settings would not make."""
    wanted = load_scenario("rq31-600m", [*SAME, "road.length=130", "seed=11", "road.cross_section=RQ36"])
    path = folder / "road.json"
    path.write_text(sample_road(wanted.road, wanted.seed, "Mine").to_json(), encoding="utf-8")
    return path


def axis_file(folder: Path) -> Path:
    """Write points along a bend of 900 m radius, 200 m long, rising by 1 %."""
    angle = np.linspace(0.0, 200.0 / 900.0, 201)
    points = np.stack([294_000 + 900 * np.sin(angle), 5_628_000 + 900 * (1 - np.cos(angle)), 180 + 9 * angle], axis=1)
    path = folder / "axis.csv"
    path.write_text("x,y,z\n" + "\n".join(f"{x:.4f},{y:.4f},{z:.4f}" for x, y, z in points), encoding="utf-8")
    return path


def built() -> tuple[RoadParameters, Scenario]:
    collection = find_road(bpy.context.scene)
    assert collection
    return recall(collection)


def test_a_loaded_road_is_the_files_at_the_panels_fidelity(cheap: Any, tmp_path: Path) -> None:
    path = set_file(tmp_path)
    cheap.fidelity = "standard"
    assert bpy.ops.synthroads.load_road(filepath=str(path)) == {"FINISHED"}
    parameters, kept = built()
    assert parameters == read_parameters(path)
    assert kept == cheap.scenario()
    assert kept.fidelity == "standard"
    assert source_file_name(find_road(bpy.context.scene)) == "road.json"


def test_a_scan_of_a_loaded_road_is_the_librarys(cheap: Any, tmp_path: Path) -> None:
    path = set_file(tmp_path)
    cheap.output = str(tmp_path / "panel")
    bpy.ops.synthroads.load_road(filepath=str(path))
    bpy.ops.synthroads.scan()
    wanted = load_scenario("rq31-600m", [*SAME, 'outputs=["parameters","cloud"]'])
    generate(Job(wanted, tmp_path / "library", parameters=path, new_file=True))
    for name in ("parameters.json", "cloud.laz"):
        assert (tmp_path / "panel" / name).read_bytes() == (tmp_path / "library" / name).read_bytes(), name


def test_a_fitted_road_is_the_librarys(cheap: Any, tmp_path: Path) -> None:
    path = axis_file(tmp_path)
    cheap.road.epsg = 25833
    assert bpy.ops.synthroads.load_axis(filepath=str(path)) == {"FINISHED"}
    parameters, report = RoadSource(cheap.scenario(), axis=path).read()
    assert built()[0] == parameters
    assert report["axis"]["horizontal"]["worst"] < 0.01
    assert parameters.metadata.epsg == 25833
    assert parameters.alignment.length == pytest.approx(200.0, abs=0.01)
    assert source_file_name(find_road(bpy.context.scene)) == "axis.csv"


def test_a_map_is_a_road_where_it_lies(cheap: Any, tmp_path: Path) -> None:
    """In its zone of UTM, as the panel's EPSG code is the usual one; with the map's lanes."""
    written, walk = motorway(lanes="3", steps=(30.0, 30.0), length=150.0)
    path = written.xml(tmp_path / "map.osm")
    assert bpy.ops.synthroads.load_axis(filepath=str(path)) == {"FINISHED"}
    parameters, _ = built()
    assert parameters.metadata.epsg == 32632
    assert len(parameters.carriageway("right").lanes) == 3
    assert parameters.alignment.length == pytest.approx(150.0, abs=6.0)
    origin = np.array(parameters.transform.translate[:2])
    assert np.hypot(*(origin - walk.at(75.0)[:2])) < 3.0
    assert source_file_name(find_road(bpy.context.scene)) == "map.osm"


def test_the_axis_lies_where_the_panel_says_beside_the_points(cheap: Any, tmp_path: Path) -> None:
    path = axis_file(tmp_path)
    cheap.road.epsg = 25833
    for options, place in (
        ({"points_are": "BESIDE", "offset": 4.5}, PathPlace(4.5)),
        ({"points_are": "LANE", "lane": 1, "height": 1.5}, PathPlace(None, 1, 1.5)),
        ({"height": 1.5, "offset": 4.5, "lane": 1}, PathPlace(None, None, 1.5)),
    ):
        assert bpy.ops.synthroads.load_axis(filepath=str(path), **options) == {"FINISHED"}
        parameters, _ = RoadSource(cheap.scenario(), axis=path, axis_place=place).read()
        assert built()[0] == parameters
    with pytest.raises(RuntimeError, match=r"Lane is 7: the road has 2 lanes each way"):
        bpy.ops.synthroads.load_axis(filepath=str(path), points_are="LANE", lane=7)
    designed = road_file_of(tmp_path)
    with pytest.raises(RuntimeError, match=r"Offset is .*OpenDRIVE gives the axis itself"):
        bpy.ops.synthroads.load_axis(filepath=str(designed), points_are="BESIDE", offset=1.0)


def test_the_panel_takes_the_road_of_a_name(cheap: Any, tmp_path: Path) -> None:
    path = road_file_of(tmp_path)
    assert bpy.ops.synthroads.load_axis(filepath=str(path), axis_name="side") == {"FINISHED"}
    assert built()[0].alignment.length == pytest.approx(150.0)
    assert bpy.ops.synthroads.load_axis(filepath=str(path)) == {"FINISHED"}
    assert built()[0].alignment.length == pytest.approx(200.0)
    with pytest.raises(RuntimeError, match=r"'none': must be one of the roads in the file: 'main', 'side'"):
        bpy.ops.synthroads.load_axis(filepath=str(path), axis_name="none")


def road_file_of(folder: Path) -> Path:
    """Write two roads without lanes: ``main``, 200 m long, and ``side``, 150 m."""
    rows = [("main", 200.0, 20.0), ("side", 150.0, 220.0)]
    roads = [
        xodr_road([(0.0, length, (10.0, y, 0.3), "<line/>")], name=name, number=n)
        for n, (name, length, y) in enumerate(rows, 1)
    ]
    return opendrive(folder / "two.xodr", roads, "<geoReference>EPSG:25832</geoReference>")


def test_kinks_are_refused_or_rounded_as_the_panel_says(cheap: Any, tmp_path: Path) -> None:
    rows = [(0.0, 100.0, (10.0, 20.0, 0.3), "<line/>")]
    rows += [(100.0, 100.0, (10.0 + 100.0 * np.cos(0.3), 20.0 + 100.0 * np.sin(0.3), 0.31), "<line/>")]
    path = opendrive(tmp_path / "kink.xodr", [xodr_road(rows)], "<geoReference>EPSG:25832</geoReference>")
    with pytest.raises(RuntimeError, match=r"Round Kinks rounds those"):
        bpy.ops.synthroads.load_axis(filepath=str(path))
    assert bpy.ops.synthroads.load_axis(filepath=str(path), round_kinks=0.02) == {"FINISHED"}
    wanted, _ = RoadSource(cheap.scenario(), road=path, round_kinks=0.02).read()
    assert built()[0].alignment == wanted.alignment
    assert [row.kind for row in wanted.alignment.horizontal] == ["line", "clothoid", "clothoid", "line"]


@pytest.mark.parametrize(("points", "fields"), [("AXIS", ()), ("BESIDE", ("offset",)), ("LANE", ("lane",))])
def test_the_file_browser_shows_where_points_lie(settings: Any, points: str, fields: tuple[str, ...]) -> None:
    layout, known = FakeLayout(), bpy.ops.synthroads.load_axis.get_rna_type()
    values = {"axis_name": "", "points_are": points, "offset": 0.0, "lane": 0, "height": 0.0, "round_kinks": 0.0}
    stand_in = SimpleNamespace(layout=layout, bl_rna=known, **values)
    SYNTHROADS_OT_load_axis.draw(stand_in, bpy.context)  # type: ignore[arg-type]
    assert [name for _, name in layout.used] == ["axis_name", "points_are", *fields, "height", "round_kinks"]
    shown = known.properties
    for name in ("axis_name", "points_are", "offset", "lane", "height", "round_kinks"):
        assert text_width(shown[name].name) <= 200.0
        assert len(shown[name].description) > 20
    assert all(text_width(item.name) <= 200.0 for item in shown["points_are"].enum_items)


@pytest.mark.slow
def test_a_fit_that_leaves_its_points_is_refused_with_a_picture(cheap: Any, tmp_path: Path) -> None:
    along = np.arange(0.0, 200.0, 5.0)
    points = np.vstack([np.column_stack([along + begin, 0.0 * along]) for begin in (0.0, 400.0, 200.0)])
    np.savetxt(tmp_path / "axis.csv", points, delimiter=",", header="x,y", comments="")
    assert not bpy.ops.synthroads.show_fit.poll()
    with pytest.raises(RuntimeError, match=r"no road follows its points within 2 m.*Show Missed Axis"):
        bpy.ops.synthroads.load_axis(filepath=str(tmp_path / "axis.csv"))
    assert find_road(bpy.context.scene) is None
    assert tuple(bpy.data.images["SynthRoads Axis Fit"].size) == (1200, 648)
    with pytest.raises(InputError, match=r"axis-fit\.png shows it"):
        generate(Job(cheap.scenario(), tmp_path / "out", axis=tmp_path / "axis.csv", new_file=True))
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["axis-fit.png"]


def test_a_saved_set_has_the_bytes_of_a_scans(cheap: Any, tmp_path: Path) -> None:
    cheap.output = str(tmp_path)
    bpy.ops.synthroads.build()
    set_modifier_input(bpy.data.objects["Road"].modifiers[0], "Right Lane 1 Width", 4.5)
    assert bpy.ops.synthroads.save_road(filepath=str(tmp_path / "mine.json")) == {"FINISHED"}
    bpy.ops.synthroads.scan()
    assert (tmp_path / "mine.json").read_bytes() == (tmp_path / "parameters.json").read_bytes()
    assert read_parameters(tmp_path / "mine.json").carriageway("right").lanes[0].width == 4.5


def test_a_saved_set_comes_back(cheap: Any, tmp_path: Path) -> None:
    path = set_file(tmp_path)
    bpy.ops.synthroads.load_road(filepath=str(path))
    bpy.ops.synthroads.save_road(filepath=str(tmp_path / "again.json"))
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_the_panel_names_a_file_only_where_the_road_is_its(cheap: Any, tmp_path: Path) -> None:
    bpy.ops.synthroads.load_road(filepath=str(set_file(tmp_path)))
    bpy.ops.synthroads.build()
    assert source_file_name(find_road(bpy.context.scene)) is None


def test_the_users_own_things_stay(cheap: Any, tmp_path: Path) -> None:
    bpy.ops.mesh.primitive_cube_add(location=(1.0, 2.0, 3.0))
    cube, camera = bpy.context.object, bpy.data.cameras.new("Mine")
    render = bpy.context.scene.render
    render.resolution_x, render.engine = 333, "CYCLES"
    before = (tuple(cube.location), cube.data.name, [c.name for c in cube.users_collection], camera.name)
    bpy.ops.synthroads.load_road(filepath=str(set_file(tmp_path)))
    bpy.ops.synthroads.save_road(filepath=str(tmp_path / "mine.json"))
    assert before == (tuple(cube.location), cube.data.name, [c.name for c in cube.users_collection], camera.name)
    assert (render.resolution_x, render.engine) == (333, "CYCLES")


def test_saving_replaces_the_file_whole(cheap: Any, tmp_path: Path) -> None:
    bpy.ops.synthroads.load_road(filepath=str(set_file(tmp_path)))
    (tmp_path / "mine.json").write_text("old" * 100_000)
    bpy.ops.synthroads.save_road(filepath=str(tmp_path / "mine.json"))
    assert read_parameters(tmp_path / "mine.json") == built()[0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.json", "road.json"]


BAD = {
    "missing": (None, "no such file"),
    "empty": ("", "must be valid JSON"),
    "no JSON": ("x,y,z\n1,2,3\n", "must be valid JSON"),
    "another kind": (json.dumps({"type": "Scenario"}), "type is 'Scenario': must be 'RoadParameters'"),
    "a version to come": (json.dumps({"type": "RoadParameters", "version": "9"}), "reads version"),
    "not text": (b"\xff\xfe\x00", "must be JSON in UTF-8"),
}
BAD_AXES = {
    "missing": (None, "must be a readable axis file"),
    "empty": ("", "the file is empty"),
    "one point": ("x,y,z\n1,2,3\n", "at least two distinct points"),
    "a word": ("x,y,z\n1,2,3\n4,five,6\n", "five"),
}


@pytest.mark.parametrize(
    ("operator", "content", "message"),
    [("load_road", *case) for case in BAD.values()] + [("load_axis", *case) for case in BAD_AXES.values()],
)
def test_a_bad_file_is_a_message_and_the_road_stays(
    road: Any,
    tmp_path: Path,
    operator: str,
    content: str | bytes | None,
    message: str,
) -> None:
    before, path = built(), tmp_path / "bad.json"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(RuntimeError, match=message) as caught:
        getattr(bpy.ops.synthroads, operator)(filepath=str(path))
    assert "Traceback" not in str(caught.value)
    assert built() == before


def test_a_folder_that_cannot_be_written_is_a_message(cheap: Any, tmp_path: Path) -> None:
    bpy.ops.synthroads.load_road(filepath=str(set_file(tmp_path)))
    (tmp_path / "file").write_text("mine")
    with pytest.raises(RuntimeError, match="cannot be written") as caught:
        bpy.ops.synthroads.save_road(filepath=str(tmp_path / "file" / "mine.json"))
    assert "Traceback" not in str(caught.value)


def test_saving_needs_a_road(cheap: Any, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Build a road first"):
        bpy.ops.synthroads.save_road(filepath=str(tmp_path / "mine.json"))


def test_what_was_assumed_of_an_axis_is_told(cheap: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    say = LongOperator._say

    def note(self: LongOperator, message: str, remarks: list[str]) -> set[str]:
        told.extend(remarks)
        return say(self, message, remarks)

    monkeypatch.setattr(LongOperator, "_say", note)
    assert bpy.ops.synthroads.load_axis(filepath=str(axis_file(tmp_path))) == {"FINISHED"}
    assert ["axis.csv names no system: its coordinates are read as EPSG:25832" in text for text in told] == [True]
