"""The button that builds: it does what the library does, leaves the user's own alone, and nothing when cancelled."""

from __future__ import annotations

from collections.abc import Callable, Generator
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Vector

from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.model import build as model_module
from synthroads_addon.blender.model.build import build_road, build_steps
from synthroads_addon.blender.model.roads import root_above
from synthroads_addon.blender.model.stage import DataBlockLog, remove_staged
from synthroads_addon.blender.model.store import find_road, recall, roads
from synthroads_addon.blender.model.truth import read_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import ROLE, BuildRequest
from synthroads_addon.blender.things.registry import model_parts
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario
from synthroads_addon.ui.panels import road_choice
from synthroads_addon.ui.work import build
from synthroads_addon.ui.work.job import PanelJob, running_job
from synthroads_addon.ui.work.unseen import build_unseen
from tests.helpers.scenes.fake_layout import FakeLayout
from tests.helpers.scenes.kept_groups import KeptGroups
from tests.helpers.scenes.panel_road import (  # noqa: F401
    SAME,
    SMALL,
    block_counts,
    cheap,
    choose,
    fingerprint,
    settings,
    users_own,
    wait_for_end,
)
from tests.helpers.scenes.scene_hash import changes, digest, lines


def parameters(**road: Any) -> RoadParameters:
    """Return a small road with plants and barriers."""
    changes = [f"road.{name}={value}" for name, value in ({"length": 60, "half_width": 20} | road).items()]
    scenario = load_scenario("rq31-600m", changes)
    return sample_road(scenario.road, scenario.seed, scenario.title)


def finish(steps: Generator[Any, None, Any]) -> Any:
    """Run a generator to its end; return what it returns."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def test_the_button_builds_what_the_library_builds(cheap: Any) -> None:  # noqa: F811
    assert bpy.ops.synthroads.build() == {"FINISHED"}
    found = find_road(bpy.context.scene)
    kept, _ = recall(found)
    panel = scene_mesh()
    same = load_scenario("rq31-600m", SAME)
    road = sample_road(same.road, same.seed, same.title)
    assert kept == road
    build_road(BuildRequest(road, same.settings().tolerance, same.settings().vegetation_detail))
    library = scene_mesh()
    for name in ("vertices", "triangles", "class_id", "instance_id", "material"):
        assert (getattr(panel, name) == getattr(library, name)).all(), name


def test_steps_build_what_is_built_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model_module, "_TURN", 0.0)  # as many turns as there can be
    road = parameters()
    first = finish(build_steps(BuildRequest(road, 0.02, 0.1)))
    names = sorted(item.name for item in first.collection.objects if item != first.root)
    stepped = scene_mesh()
    second = build_road(BuildRequest(road, 0.02, 0.1))
    at_once = scene_mesh()
    assert sorted(item.name for item in second.collection.objects if item != second.root) == names
    assert names == sorted(second.objects)
    for name in ("vertices", "triangles", "class_id", "instance_id", "material"):
        assert (getattr(stepped, name) == getattr(at_once, name)).all(), name
    assert [item.name for item in bpy.data.collections] == ["SynthRoads"]


def steps_until_cancelled(number: int, begin: Callable[[], Generator[Any, None, Any]]) -> bool:
    """Begin, do so many steps, give up; return whether there were as many."""
    steps = begin()
    try:
        for _ in range(number):
            next(steps)
    except StopIteration:
        return False
    steps.close()
    return True


@pytest.mark.any_blender
@pytest.mark.parametrize("before", ["nothing", "a road and the user's own"])
def test_cancelling_at_any_step_leaves_the_file_as_it_was(
    before: str,
    users_own: bpy.types.Object,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    kept_groups: KeptGroups,
) -> None:
    if before != "nothing":
        model = build_road(BuildRequest(parameters(length=40), 0.02, 0.1))
        model.collection.objects.link(users_own)
        model.collection.color_tag = "COLOR_03"
        kept_groups.on = False  # steps end in the midst of making groups too
    monkeypatch.setattr(model_module, "_TURN", 0.002)
    expected, counts = digest(), block_counts()
    road = parameters()
    number, seen = 1, 0
    while steps_until_cancelled(number, lambda: build_steps(BuildRequest(road, 0.02, 0.1))):
        assert block_counts() == counts, number
        assert digest() == expected, number
        seen += 1
        number = max(number + 1, int(1.6 * number))
    assert seen >= 5


def test_cancelling_leaves_what_the_user_made_meanwhile() -> None:
    steps = build_steps(BuildRequest(parameters(), 0.02, 0.1))
    for _ in range(4):
        next(steps)
    bpy.data.materials.new("Mine")
    bpy.data.objects.new("Mine", bpy.data.meshes.new("Mine"))
    steps.close()
    assert [item.name for item in bpy.data.objects] == ["Mine"]
    assert [item.name for item in bpy.data.meshes] == ["Mine"]
    assert [item.name for item in bpy.data.materials] == ["Mine"]
    assert len(bpy.data.node_groups) == len(bpy.data.collections) == 0


def test_the_road_before_stays_until_the_new_one_is_complete() -> None:
    old = build_road(BuildRequest(parameters(length=40), 0.02, 0.1))
    names = sorted([*old.objects, old.root.name])
    steps = build_steps(BuildRequest(parameters(), 0.02, 0.1))
    next(steps)
    for _ in steps:
        found = bpy.data.collections["SynthRoads"]
        assert sorted(item.name for item in found.objects) == names
    assert sorted(item[ROLE] for item in bpy.data.collections["SynthRoads"].objects if ROLE in item) == sorted(
        item.name for item in bpy.data.objects if ROLE in item
    )


def test_a_part_that_fails_leaves_the_road_before(monkeypatch: pytest.MonkeyPatch) -> None:
    build_road(BuildRequest(parameters(length=40), 0.02, 0.1))
    expected, counts = digest(), block_counts()

    def fail(builder: Any) -> None:
        raise InputError("asset", None, "cannot be read")

    parts = model_parts()
    monkeypatch.setitem(parts, "delineators", parts["delineators"]._replace(build=fail))
    for run in (
        lambda: build_road(BuildRequest(parameters(), 0.02, 0.1)),
        lambda: finish(build_steps(BuildRequest(parameters(), 0.02, 0.1))),
    ):
        with pytest.raises(InputError, match="cannot be read"):
            run()
        assert block_counts() == counts
        assert digest() == expected


def test_groups_of_an_older_version_get_their_names_back(kept_groups: KeptGroups) -> None:
    build_road(BuildRequest(parameters(length=40), 0.02, 0.1))
    kept_groups.on = False
    for group in bpy.data.node_groups:
        group["synthroads_key"] = "older"
    expected = digest()
    steps = build_steps(BuildRequest(parameters(), 0.02, 0.1))
    while len(bpy.data.collections["SynthRoads (building)"].objects if len(bpy.data.collections) > 1 else ()) < 3:
        next(steps)
    assert any("(older)" in group.name for group in bpy.data.node_groups)
    steps.close()
    assert digest() == expected


def test_what_a_build_could_not_clean_up_goes_with_the_next_look() -> None:
    build_road(BuildRequest(parameters(length=40), 0.02, 0.1))
    expected = [line for line in lines() if not line.startswith("materials")]
    steps = build_steps(BuildRequest(parameters(), 0.02, 0.1))
    # How often it pauses depends on the machine's speed.
    for _ in steps:
        found = bpy.data.collections.get("SynthRoads (building)")
        if found is not None and len(found.objects):
            break
    else:
        pytest.fail("it never paused with something half-built")
    remove_staged()
    assert [line for line in lines() if not line.startswith("materials")] == expected
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DataBlockLog, "remove", lambda self: None)
        steps.close()


def render_settings() -> dict[str, str]:
    scene = bpy.context.scene
    return {
        f"{name}.{prop.identifier}": repr(getattr(part, prop.identifier))
        for name, part in (("render", scene.render), ("view", scene.view_settings), ("eevee", scene.eevee))
        for prop in part.bl_rna.properties
        if prop.type in ("BOOLEAN", "INT", "FLOAT", "ENUM", "STRING") and not getattr(prop, "is_array", False)
    }


def test_building_leaves_the_users_objects_alone(cheap: Any, users_own: bpy.types.Object) -> None:  # noqa: F811
    before, render = fingerprint(users_own), render_settings()
    bpy.ops.synthroads.build()
    bpy.ops.synthroads.build()  # takes the place of the first road
    assert fingerprint(users_own) == before
    assert render_settings() == render
    assert {item.name for item in bpy.data.objects if ROLE not in item} == {users_own.name, "SynthRoads Road"}


@pytest.mark.new_groups
def test_the_operator_cancelled_at_any_tick_leaves_the_file(cheap: Any) -> None:  # noqa: F811
    choose(cheap, **{"road.length": 60.0})
    expected, counts = lines(), block_counts()
    for ticks in (0, 1, 2, 5, 9):
        job = PanelJob("Build", build.build_work(cheap.scenario(), ""))
        job.start()
        for _ in range(ticks):
            job.tick(0.02)
        job.stop()
        wait_for_end(job)
        assert running_job() is None
        assert block_counts() == counts
        assert changes(expected) == [], f"after {ticks} ticks"


def test_undo_takes_the_road_away_and_redo_brings_it_back(cheap: Any, users_own: bpy.types.Object) -> None:  # noqa: F811
    bpy.ops.ed.undo_push(message="before")
    names = sorted(item.name for item in bpy.data.objects)
    bpy.ops.synthroads.build()
    bpy.ops.ed.undo_push(message="Build Road")
    built = sorted(item.name for item in bpy.data.objects)
    bpy.ops.ed.undo()
    assert sorted(item.name for item in bpy.data.objects) == names
    assert find_road(bpy.context.scene) is None
    bpy.ops.ed.redo()
    assert sorted(item.name for item in bpy.data.objects) == built
    assert find_road(bpy.context.scene)


def test_undo_in_the_midst_of_a_build_gives_it_up(cheap: Any, users_own: bpy.types.Object) -> None:  # noqa: F811
    bpy.ops.ed.undo_push(message="before")
    users_own.location.x += 1.0
    bpy.ops.ed.undo_push(message="moved")
    job = PanelJob("Build", build.build_work(cheap.scenario(), ""))
    job.start()
    while len(bpy.data.objects) < 4:
        job.tick()
    bpy.ops.ed.undo()
    assert running_job() is None
    assert [item.name for item in bpy.data.objects] == ["Cube"]
    assert [item.name for item in bpy.data.collections] == ["Mine"]


def test_an_undo_step_of_a_half_built_road_holds_none_of_it(cheap: Any, users_own: bpy.types.Object) -> None:  # noqa: F811
    bpy.ops.ed.undo_push(message="before")
    job = PanelJob("Build", build.build_work(cheap.scenario(), ""))
    job.start()
    while len(bpy.data.objects) < 4:
        job.tick()
    bpy.data.objects["Cube"].location.x += 1.0
    bpy.ops.ed.undo_push(message="moved meanwhile")
    wait_for_end(job)
    assert job.error is None
    bpy.ops.ed.undo_push(message="Build Road")
    bpy.ops.ed.undo()
    assert [item.name for item in bpy.data.objects] == ["Cube"]
    assert [item.name for item in bpy.data.collections] == ["Mine"]


def test_buttons_wait_for_object_mode(settings: Any, users_own: bpy.types.Object) -> None:  # noqa: F811
    bpy.context.view_layer.objects.active = users_own
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="Object Mode"):
        bpy.ops.synthroads.build()
    bpy.ops.object.mode_set(mode="OBJECT")


def test_a_refused_setting_leaves_the_built_road(cheap: Any, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    def refuse(*arguments: Any) -> None:
        raise InputError("road.radius", 1, "is too small")

    bpy.ops.synthroads.build()
    before = digest()
    monkeypatch.setattr(build, "sample_road", refuse)
    with pytest.raises(RuntimeError, match=r"Error: Radius \(Axis and Section\) is 1: is too small"):
        bpy.ops.synthroads.build()
    assert digest() == before


def test_a_growing_road_is_evaluated_but_not_drawn() -> None:
    """Drawing each step takes longer than building; what is complete is shown."""
    bpy.ops.mesh.primitive_cube_add()
    seen = 0
    steps = build_unseen(build_steps(BuildRequest(parameters(), 0.02, 0.1)))
    while True:
        try:
            next(steps)
        except StopIteration as end:
            model = end.value
            break
        growing = [item for item in bpy.context.scene.objects if item.name != "Cube" and item.type == "MESH"]
        assert not any(item.visible_get() for item in growing)
        seen += len(growing)
    assert seen > 5
    assert bpy.data.objects["Cube"].visible_get()
    assert all(
        item.visible_get() for role, item in model.objects.items() if not item.hide_viewport and role != "Backbone"
    )
    layers = [bpy.context.view_layer.layer_collection, *bpy.context.view_layer.layer_collection.children]
    assert not any(layer.hide_viewport for layer in layers)
    road = model.objects["Road"].evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert len(road.data.polygons) > 100


# --- one more road ---------------------------------------------------------------------------------------------------


def outline(root: bpy.types.Object) -> np.ndarray:
    """Return the plan coordinates of all vertices of a road's visible parts, m: not by the way of the panel."""
    graph = bpy.context.evaluated_depsgraph_get()
    points = []
    for use in graph.object_instances:
        item = use.instance_object if use.is_instance else use.object
        owner = use.parent if use.is_instance else use.object
        if root_above(owner.original) == root and item.type == "MESH" and len(item.data.vertices):
            flat = np.empty(3 * len(item.data.vertices), np.float32)
            item.data.vertices.foreach_get("co", flat)
            matrix = np.array(use.matrix_world)
            points.append(flat.reshape(-1, 3) @ matrix[:2, :3].T + matrix[:2, 3])
    return np.concatenate(points)


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return the widest gap, m, between two sets of points across any straight line; negative if none parts them."""
    angles = np.radians(np.arange(360))
    gaps = [(other @ d).min() - (one @ d).max() for d in np.column_stack([np.cos(angles), np.sin(angles)])]
    return float(max(gaps))


def test_one_more_road_is_another_and_stands_beside_the_first(cheap: Any) -> None:  # noqa: F811
    choose(cheap, **{"road.length": 60.0})
    bpy.ops.synthroads.build()
    (first,) = roads(bpy.context.scene)
    before = outline(first)
    bpy.ops.synthroads.build(beside=True)
    second = next(root for root in roads(bpy.context.scene) if root != first)
    assert find_road(bpy.context.scene) == second
    assert np.array_equal(outline(first), before), "the first stays where it is"
    assert apart(before, outline(second)) > 5.0
    assert recall(second)[1].seed == cheap.seed != recall(first)[1].seed == SMALL["seed"]
    assert recall(second)[0].alignment != recall(first)[0].alignment
    assert second["synthroads_built_from"] == cheap.road_values()
    place = tuple(second.location)
    bpy.ops.synthroads.build()
    assert tuple(second.location) == place, "built again it stays beside the first"


def test_one_more_road_at_the_cursor(cheap: Any) -> None:  # noqa: F811
    choose(cheap, **{"road.length": 60.0})
    bpy.ops.synthroads.build()
    (first,) = roads(bpy.context.scene)
    bpy.context.scene.cursor.location = (300.0, -200.0, 5.0)
    bpy.ops.synthroads.build(beside=True, at_cursor=True)
    second = next(root for root in roads(bpy.context.scene) if root != first)
    bpy.context.view_layer.update()
    geometry = RoadGeometry(recall(second)[0])
    middle = [*geometry.alignment.position(30.0).tolist(), float(geometry.profile.elevation(30.0))]
    assert (second.matrix_world @ Vector(middle) - Vector((300.0, -200.0, 5.0))).length < 1e-4
    assert recall(second)[1].seed != recall(first)[1].seed, "with a seed of its own"
    read = read_road(second).known()
    assert np.abs(np.subtract(read.transform.translate, recall(second)[0].transform.translate)[:2]).max() > 100.0


def test_the_plus_asks_where_the_next_road_is_to_be() -> None:
    layout = FakeLayout()
    road_choice.SYNTHROADS_MT_one_more.draw(SimpleNamespace(layout=layout), bpy.context)
    text = "\n".join(layout.lines)
    for words in ("Beside the Others", "At the 3D Cursor", "Along the Active Curve", "Draw It"):
        assert words in text


def test_one_more_road_leaves_the_users_own_free(cheap: Any) -> None:  # noqa: F811
    choose(cheap, **{"road.length": 60.0})
    bpy.ops.mesh.primitive_cube_add(size=40.0, location=(10.0, 0.0, 0.0))
    cube = bpy.context.object
    bpy.ops.synthroads.build(beside=True)
    (root,) = roads(bpy.context.scene)
    corners = np.array([cube.matrix_world @ Vector(corner) for corner in cube.bound_box])[:, :2]
    assert apart(corners, outline(root)) > 5.0
    assert cheap.seed == SMALL["seed"], "no road has it yet"


def test_one_more_road_that_cannot_be_leaves_the_seed(cheap: Any) -> None:  # noqa: F811
    choose(cheap, **{"road.length": 60.0})
    bpy.ops.synthroads.build()
    cheap.road.own_radius = True
    cheap.road.radius_minimum = cheap.road.radius_maximum = 10.0
    with pytest.raises(RuntimeError, match="Radius"):
        bpy.ops.synthroads.build(beside=True)
    assert cheap.seed == SMALL["seed"]
    assert len(roads(bpy.context.scene)) == 1


def test_the_redo_panel_builds_another_length_and_seed_and_the_panel_says_so(cheap: Any) -> None:  # noqa: F811
    assert {"REGISTER", "UNDO"} <= build.SYNTHROADS_OT_build.bl_options, "Blender draws no redo panel without both"
    assert bpy.ops.synthroads.build(length=50.0, seed=77) == {"FINISHED"}
    root = find_road(bpy.context.scene)
    parameters, scenario = recall(root)
    assert parameters.alignment.length == pytest.approx(50.0)
    assert scenario.seed == 77
    assert (cheap.seed, cheap.road.length) == (77, 50.0)
    same = load_scenario("rq31-600m", [*SAME, "seed=77", "road.length=50"])
    assert parameters == sample_road(same.road, same.seed, same.title)
    cheap.seed, cheap.road.length = 5, 40.0
    assert bpy.ops.synthroads.build() == {"FINISHED"}
    assert recall(find_road(bpy.context.scene))[1].seed == 5, "what is not given is the panel's"


def test_a_road_that_cannot_be_leaves_the_panel_as_it_was(cheap: Any) -> None:  # noqa: F811
    cheap.road.own_radius = True
    cheap.road.radius_minimum = cheap.road.radius_maximum = 10.0
    before = (cheap.seed, cheap.road.length)
    with pytest.raises(RuntimeError, match="Radius"):
        bpy.ops.synthroads.build(length=60.0, seed=77)
    assert (cheap.seed, cheap.road.length) == before
