"""Node groups that builds keep for other processes."""

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.nodes import builder, kept_groups
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.roads.parameter_sets import SMALL_ROAD
from tests.helpers.scenes.described_group import describe

pytestmark = pytest.mark.new_groups
WIDE = json.loads(json.dumps(SMALL_ROAD))
WIDE["objects"]["road"]["lanes"].append({"width": 3.5})


Built = tuple[dict[str, str], dict[str, bytes]]


@dataclass(frozen=True)
class FirstBuild:
    """A road that was built where nothing was kept: folder of what it kept, what was built, number of groups made."""

    folder: Path
    built: Built
    made: int


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> FirstBuild:
    folder = tmp_path_factory.mktemp("first") / "groups"
    request.getfixturevalue("kept_groups").on = False
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kept_groups, "kept_file", lambda: folder / "kept.blend")
        names = noted(patch)
        kept_groups._State.made = 0
        return FirstBuild(folder, build(), len(names))


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "groups" / "kept.blend"
    monkeypatch.setattr(kept_groups, "kept_file", lambda: path)
    kept_groups._State.made_count = 0
    return path


@pytest.fixture
def kept(file: Path, first: FirstBuild) -> Path:
    """The file after a road was built."""
    shutil.copytree(first.folder, file.parent)
    return file


def noted(patch: pytest.MonkeyPatch) -> list[str]:
    """Return the names of the groups that are made from here on."""
    names: list[str] = []

    class Noted(builder.Tree):
        def __init__(self, group: bpy.types.NodeTree) -> None:
            names.append(group.name)
            super().__init__(group)

    patch.setattr(builder, "Tree", Noted)
    return names


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the names of the groups that are made from here on."""
    return noted(monkeypatch)


def build(data: dict = SMALL_ROAD) -> Built:
    """Build a road in an empty file; return its groups in words, by name and key, and its objects' vertices."""
    empty_file()
    model = build_road(BuildRequest(RoadParameters.from_dict(data), 0.02, 0.3, {"road", "guardrails"}))
    groups = {f"{group.name} {group[builder.KEY]} {group.users}": describe(group) for group in bpy.data.node_groups}
    vertices = {}
    for name, item in model.objects.items():
        mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        places = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", places)
        vertices[name] = places.tobytes()
    return groups, vertices


def test_what_is_read_is_what_would_be_made(kept: Path, made: list[str], first: FirstBuild) -> None:
    assert first.made > 0
    assert build() == first.built
    assert not made
    assert not bpy.data.libraries
    assert sorted(path.name for path in kept.parent.iterdir()) == ["kept.blend", "kept.json"]


@pytest.mark.usefixtures("kept")
def test_groups_of_another_road_are_made_and_kept_beside(made: list[str], first: FirstBuild) -> None:
    wide = build(WIDE)
    assert 0 < len(made) < first.made
    made.clear()
    assert build(WIDE) == wide
    build()
    assert not made
    assert not [group.name for group in bpy.data.node_groups if group.name[-1].isdigit() or "older" in group.name]


def test_only_the_latest_roads_are_kept(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_groups, "ROADS", 1)
    monkeypatch.setattr(kept_groups, "_NEW_SHARE", 0.0)
    build(WIDE)
    assert len(json.loads(kept.with_suffix(".json").read_text())["roads"]) == 1
    monkeypatch.setattr(kept_groups, "_NEW_SHARE", 1.0)
    before = kept.read_bytes()
    build()
    assert kept.read_bytes() == before


def test_a_file_with_groups_that_the_user_may_have_edited_is_not_kept(file: Path) -> None:
    empty_file()
    builder.node_group("SR Edited", lambda tree: None)
    build_road(BuildRequest(RoadParameters.from_dict(SMALL_ROAD), 0.02, 0.3, {"road"}))
    assert not file.exists()


@pytest.mark.usefixtures("kept")
def test_groups_of_other_source_files_are_not_read(
    made: list[str], first: FirstBuild, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_groups, "_stamp", lambda: "another")
    build()
    assert len(made) == first.made


def _no_blend_file(file: Path) -> None:
    file.write_bytes(b"nothing")


def _no_list(file: Path) -> None:
    file.with_suffix(".json").write_text("[1, 2", encoding="utf-8")


def _another_list(file: Path) -> None:
    file.with_suffix(".json").write_text('{"made_by": 3, "roads": {}}', encoding="utf-8")


def _no_file(file: Path) -> None:
    file.unlink()


@pytest.mark.parametrize("spoil", [_no_blend_file, _no_list, _another_list, _no_file])
def test_a_spoilt_file_is_made_anew(
    kept: Path, made: list[str], first: FirstBuild, spoil: Callable[[Path], None]
) -> None:
    spoil(kept)
    assert build() == first.built
    assert made
    made.clear()
    build()
    assert not made


def test_a_folder_that_cannot_be_made_is_none(file: Path, first: FirstBuild) -> None:
    file.parent.write_text("a file", encoding="utf-8")
    assert build() == first.built


def test_the_place_of_the_file_and_how_to_have_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(Path(kept_groups.__file__).parent, tmp_path / "nodes"))
    source = (folder / "kept_groups.py").read_text(encoding="utf-8")
    space = {"__name__": "kept", "__package__": "synthroads_addon.blender.nodes", "__file__": str(folder / "x.py")}
    exec(compile(source, "kept_groups.py", "exec"), space)  # the tests' own has none
    monkeypatch.setattr(bpy.utils, "user_resource", lambda kind: str(tmp_path / kind))
    place = space["kept_file"]()
    assert place.parent == tmp_path / "DATAFILES" / "synthroads" / "node-groups"
    space["__file__"] = str(folder / "another" / "x.py")
    assert space["kept_file"]() != place
    monkeypatch.setattr(bpy.utils, "extension_path_user", lambda package, path: f"{tmp_path}/{package}/{path}")
    space["__package__"] = "bl_ext.user_default.synthroads.blender.nodes"
    assert space["kept_file"]().parent == tmp_path / "bl_ext.user_default.synthroads" / "node-groups"
    monkeypatch.setitem(os.environ, "SYNTHROADS_KEEP_GROUPS", "off")
    assert space["kept_file"]() is None
