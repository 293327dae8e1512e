"""A cloud over the 3D view: it lies on the model, nothing is added to the file, and messages say what is wrong."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

import synthroads_addon
from synthroads_addon.base.errors import Cancelled
from synthroads_addon.blender.model.roads import scene_origin
from synthroads_addon.blender.model.store import find_road, recall_parameters
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.views.cloud import Pace
from synthroads_addon.cloud.formats.registry import ENDINGS, open_writer
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.cloud.tools.display import COLOURINGS, drawing_order, read_display
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.ui.panels import cloud_view
from synthroads_addon.ui.panels.cloud_view import view
from tests.helpers.clouds.random_points import make_points
from tests.helpers.scenes.fake_layout import drawn
from tests.helpers.scenes.panel_road import choose
from tests.helpers.scenes.scene_hash import digest

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])


@pytest.fixture(autouse=True)
def shown() -> Iterator[Any]:
    """Register the add-on for one test; return what says how clouds are shown."""
    synthroads_addon.register()
    yield bpy.context.scene.synthroads_cloud_view
    synthroads_addon.unregister()
    assert view.cloud is None


def write(path: Path, block: PointBlock) -> Path:
    with open_writer(path, 25832, ORIGIN, 65535 * 900.0) as writer:
        writer.write(block)
    return path


def build(**values: Any) -> RoadGeometry:
    settings = bpy.context.scene.synthroads
    choose(settings, **{"road.length": 120.0, "seed": 3, **values})
    bpy.ops.synthroads.build()
    road = find_road(bpy.context.scene)
    assert road
    return RoadGeometry(recall_parameters(road))


def surface_cloud(path: Path, geometry: RoadGeometry) -> tuple[Path, np.ndarray]:
    """Write a cloud of 400 points on the road's surface; return the file and the points in local coordinates."""
    rng = np.random.default_rng(1)
    local = geometry.point(rng.uniform(0, geometry.length, 400), rng.uniform(-12, 12, 400))
    assert np.isfinite(local).all()
    return write(path, replace(make_points(400), xyz=local + np.array(geometry.parameters.transform.translate))), local


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_cloud_is_what_the_library_reads(shown: Any, tmp_path: Path, ending: str) -> None:
    path = write(tmp_path / f"a{ending}", make_points(5_000))
    shown.points = 1_000
    assert bpy.ops.synthroads.show_cloud(filepath=str(path)) == {"FINISHED"}
    expected = read_display(path, 1_000)
    assert view.cloud
    for name in ("origin", "xyz", "class_id", "rgb", "brightness", "counts"):
        assert getattr(view.cloud, name).tobytes() == getattr(expected, name).tobytes(), name
    for by in COLOURINGS:
        assert view.cloud.colors(by).tobytes() == expected.colors(by).tobytes()


def test_it_lies_on_the_model(shown: Any, tmp_path: Path) -> None:
    """Points of the analytic surface lie on the mesh that is drawn, at the place of the file's map coordinates."""
    geometry = build(fidelity="high")
    path, local = surface_cloud(tmp_path / "a.npz", geometry)
    bpy.ops.synthroads.show_cloud(filepath=str(path))
    assert view.cloud
    drawn = (view.cloud.xyz + view.offset(bpy.context.scene))[drawing_order(400)]
    assert np.abs(drawn - local).max() < 0.001
    road = bpy.data.objects["Road"].evaluated_get(bpy.context.evaluated_depsgraph_get())
    gaps = [road.closest_point_on_mesh(point)[1] for point in drawn.tolist()]
    away = np.linalg.norm(np.array(gaps) - drawn, axis=1)
    assert np.quantile(away, 0.9) < 0.001  # markings lie over the surface


def test_it_stays_in_place_when_another_road_is_built(shown: Any, tmp_path: Path) -> None:
    geometry = build()
    path, _ = surface_cloud(tmp_path / "a.laz", geometry)
    bpy.ops.synthroads.show_cloud(filepath=str(path))
    assert view.cloud
    assert view.offset(bpy.context.scene).tolist() == [0.0, 0.0, 0.0]
    road = find_road(bpy.context.scene)
    assert road
    road["synthroads_origin"] = [value + 1_000.0 for value in road["synthroads_origin"]]
    assert view.offset(bpy.context.scene).tolist() == [-1_000.0] * 3


@pytest.mark.any_blender
def test_nothing_of_the_file_is_touched(shown: Any, tmp_path: Path) -> None:
    build()
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.scene.render.resolution_x = 333
    space = next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D").spaces.active
    shading = space.shading.type, space.shading.color_type
    shown.by, shown.visible = COLOURINGS[-1], True
    before = digest()
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "a.laz", make_points(1_000))))
    for by in COLOURINGS:
        shown.by = by
    assert digest() == before  # but for how clouds are shown, which is kept
    assert (space.shading.type, space.shading.color_type) == shading
    bpy.ops.synthroads.hide_cloud()
    assert digest() == before


def test_colour_size_and_eye_are_what_is_drawn(shown: Any, tmp_path: Path) -> None:
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "a.laz", make_points(1_000))))
    for by in COLOURINGS:
        shown.by, shown.size = by, 5.0
        assert (view.by, view.size) == (by, 5.0)
    shown.visible = False
    assert not view.visible
    bpy.ops.synthroads.show_cloud(filepath=str(tmp_path / "a.laz"))
    assert view.visible
    assert shown.visible


def test_without_a_file_it_is_the_last_scans(shown: Any, tmp_path: Path) -> None:
    settings = bpy.context.scene.synthroads
    with pytest.raises(RuntimeError, match="File: scan first, or choose a cloud"):
        bpy.ops.synthroads.show_cloud()
    settings.output = str(tmp_path)
    write(tmp_path / "cloud.laz", make_points(100))
    bpy.ops.synthroads.show_cloud()
    assert view.cloud
    assert view.cloud.header.path == tmp_path / "cloud.laz"


def test_a_cloud_of_elsewhere_is_told_apart(shown: Any, tmp_path: Path) -> None:
    build()
    near, far = make_points(10), make_points(10, origin=(394_000.0, 5_628_000.0, 180.0))
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "a.laz", near)))
    assert view.cloud
    assert [text for text, _ in cloud_view.cloud_notes(view.cloud, bpy.context.scene)] == ["10 of 10 points"]
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "b.laz", far)))
    assert any("100 km from the road" in text for text, _ in cloud_view.cloud_notes(view.cloud, bpy.context.scene))


def test_without_a_road_it_is_drawn_near_the_middle_and_looked_at(shown: Any, tmp_path: Path) -> None:
    assert scene_origin(bpy.context.scene) is None
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "a.laz", make_points(1_000))))
    assert view.cloud
    assert np.abs(view.cloud.xyz).max() < 700.0
    assert any("No road" in text for text, _ in cloud_view.cloud_notes(view.cloud, bpy.context.scene))
    space = next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D").spaces.active
    middle = (view.cloud.xyz.min(axis=0) + view.cloud.xyz.max(axis=0)) / 2
    assert np.allclose(space.region_3d.view_location, middle, atol=0.01)
    assert space.clip_end > 1_000.0


def test_another_file_shows_no_cloud(shown: Any, tmp_path: Path) -> None:
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "a.laz", make_points(10))))
    bpy.ops.wm.read_homefile(use_empty=True)
    assert view.cloud is None
    assert not bpy.ops.synthroads.hide_cloud.poll()


BAD = {
    "missing.laz": (None, "no such file"),
    "empty.laz": (b"", "is empty, not a cloud"),
    "text.las": (b"x y z\n" * 100, "is not a LAS file"),
    "text.ply": (b"x y z\n" * 100, "text.ply"),
    "text.e57": (b"x y z\n" * 100, "text.e57"),
    "text.npz": (b"x y z\n" * 100, "text.npz"),
    "cloud.xyz": (b"1 2 3\n", "cloud.xyz"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_a_message_and_the_cloud_stays(shown: Any, tmp_path: Path, name: str) -> None:
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "good.laz", make_points(10))))
    before, (content, message) = view.cloud, BAD[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(RuntimeError, match=message) as caught:
        bpy.ops.synthroads.show_cloud(filepath=str(tmp_path / name))
    assert "Traceback" not in str(caught.value)
    assert view.cloud is before


def test_a_truncated_cloud_is_a_message(shown: Any, tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", make_points(1_000))
    path.write_bytes(path.read_bytes()[:-3_000])
    with pytest.raises(RuntimeError, match="truncated"):
        bpy.ops.synthroads.show_cloud(filepath=str(path))
    assert view.cloud is None


def test_reading_beside_the_window_can_be_stopped(shown: Any, tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", make_points(1_000))

    def stop(share: float) -> None:
        raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        cloud_view.read_cloud_to_show(path, 100, None, "class", stop)
    shares: list[float] = []
    assert len(cloud_view.read_cloud_to_show(path, 100, None, "height", shares.append)) == 100
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_the_panel_shows_the_legend(shown: Any, tmp_path: Path) -> None:
    def lines() -> str:
        return "\n".join(drawn(cloud_view.SYNTHROADS_PT_cloud_view, bpy.context).lines)

    assert "Last scan's cloud" in lines()
    assert "swatch" not in lines()
    block = make_points(100)
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "a.laz", block)))
    for number, name in ((1, "Road"), (3, "Vegetation"), (14, "Warning Post")):
        count = int((block.class_id == number).sum())
        assert f"label {name!r} <swatch> | label '{count}'" in lines()
    shown.by = "height"
    assert view.cloud
    low, high = view.cloud.limits("height")
    assert f"label '{low:,.1f} m' | label '{high:,.1f} m'" in lines()
    shown.by = "intensity"
    assert "Intensity x squared range" in lines()
    shown.by = "rgb"
    assert "swatch" not in lines()


class Region:
    """A region of the window."""

    def __init__(self) -> None:
        self.drawn = 0

    def as_pointer(self) -> int:
        return id(self)

    def tag_redraw(self) -> None:
        self.drawn += 1


def test_a_slow_machine_draws_fewer_points_while_the_view_turns() -> None:
    pace, region = Pace(), Region()
    still, turned = Matrix.Identity(4), Matrix.Rotation(0.1, 4, "Z")
    assert pace.points(2_000_000, region, still) == 2_000_000
    pace.measure(1.0, 2_000_000)
    assert pace.points(2_000_000, region, still) == 2_000_000  # nothing moves
    assert pace.points(2_000_000, region, turned) == 100_000
    pace._draw_all()
    assert region.drawn == 1
    assert pace.points(2_000_000, region, turned) == 2_000_000


def test_a_fast_machine_draws_them_all() -> None:
    pace, region = Pace(), Region()
    pace.points(2_000_000, region, Matrix.Identity(4))
    pace.measure(0.001, 2_000_000)
    assert pace.points(2_000_000, region, Matrix.Rotation(0.1, 4, "Z")) == 2_000_000


@pytest.mark.parametrize("by", COLOURINGS)
def test_a_cloud_added_to_the_scene_is_blenders_own(shown: Any, tmp_path: Path, by: str) -> None:
    """Its attributes are the file's, its colours those of the view; scans leave it out."""
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    block = make_points(1_000)
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "a.laz", block)))
    assert bpy.ops.synthroads.add_cloud(radius=0.05) == {"FINISHED"}
    (item,) = (item for item in bpy.context.scene.objects if item.type == "POINTCLOUD")
    assert (bpy.context.object, list(bpy.context.selected_objects)) == (cube, [cube])
    assert not shown.visible
    shown.by = by
    assert view.cloud
    read = {
        a.name: np.empty(len(view.cloud), np.float32 if a.data_type == "FLOAT" else np.int32)
        for a in item.data.attributes
        if a.data_type in ("FLOAT", "INT")
    }
    for name, values in read.items():
        item.data.attributes[name].data.foreach_get("value", values)
    assert (read["class_id"] == view.cloud.class_id).all()
    assert (read["intensity"] == view.cloud.brightness).all()
    assert read["radius"] == pytest.approx(0.05)
    colors = np.empty(4 * len(view.cloud), np.float32)
    item.data.attributes["shown"].data.foreach_get("color_srgb", colors)
    assert np.abs(colors.reshape(-1, 4) * 255.0 - view.cloud.colors(by)).max() < 0.6
    places = np.empty(3 * len(view.cloud), np.float32)
    item.data.attributes["position"].data.foreach_get("vector", places)
    assert (places.reshape(-1, 3) == view.cloud.xyz).all()
    assert len(scene_mesh().triangles) == 12
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert len(next(item for item in bpy.data.objects if item.type == "POINTCLOUD").data.points) == 1_000


def test_the_overlay_follows_show_overlays(shown: Any, tmp_path: Path) -> None:
    bpy.ops.synthroads.show_cloud(filepath=str(write(tmp_path / "a.laz", make_points(10))))
    area = next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D")
    with bpy.context.temp_override(area=area):
        assert view.is_drawn(bpy.context)
        area.spaces.active.overlay.show_overlays = False
        assert not view.is_drawn(bpy.context)
        area.spaces.active.overlay.show_overlays = True


def test_settings_are_kept_in_the_file(shown: Any, tmp_path: Path) -> None:
    """Calibration, how clouds are shown, and what a scan without a road needs: saved."""
    scene = bpy.context.scene
    shown.by, shown.points = "height", 5_000
    scene.synthroads_calibration.real = "real.laz"
    scene.synthroads_scene_scan.classes = "classes.json"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    assert (scene.synthroads_cloud_view.by, scene.synthroads_calibration.real) == ("class", "")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    scene = bpy.context.scene
    assert (scene.synthroads_cloud_view.by, scene.synthroads_cloud_view.points) == ("height", 5_000)
    assert scene.synthroads_calibration.real == "real.laz"
    assert scene.synthroads_scene_scan.classes == "classes.json"
