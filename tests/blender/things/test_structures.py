"""Gantries, overpasses and beacons on the built mesh: clearance, sizes, which way they face, labels."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.gantry.gantry import gantry_group
from synthroads_addon.blender.things.overpass.overpass import overpass_group
from synthroads_addon.road import stretches
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.files.opendrive_reader import Roads
from tests.helpers.scenes.furnished_road import (
    MEASURE,
    Data,
    Float,
    FurnishedRoad,
    cast_down,
    corners,
    normals,
    of_material,
    open_edges,
    pieces,
    tree_of,
    volume,
)

pytestmark = pytest.mark.any_blender

PARTS = ("gantries", "overpasses", "beacons")


def sign(offset: float, width: float, height: float, *text: str, kind: str = "destination") -> Data:
    return {"offset": offset, "width": width, "height": height, "kind": kind, "text": list(text)}


def gantry(station: float, kind: str, left: float, right: float, *signs: Data, **more: object) -> Data:
    item = {"type": "Gantry", "station": station, "offset": (left + right) / 2, "kind": kind, "signs": list(signs)}
    return item | {"left_offset": left, "right_offset": right, **more}


def display(offset: float, *text: str) -> Data:
    return sign(offset, 1.35, 1.35, *text, kind="display")


TRUSS = {"beam": "truss", "beam_height": 1.4, "beam_depth": 1.0}
TUBE = {"beam": "tube", "beam_height": 0.6, "beam_depth": 0.6}
GANTRIES: dict[str, Data] = {
    "bare": gantry(40.0, "one_sided", 0.0, -17.0, clearance=5.0),
    "boards": gantry(
        70.0, "one_sided", 0.0, -17.0, sign(-4.6, 3.4, 2.5, "A", "B"), sign(-8.4, 3.4, 2.0, "C"), shade=0.2
    ),
    "against": gantry(100.0, "one_sided", 17.0, 0.0, sign(4.6, 3.4, 3.0, "A"), **TUBE),
    "both": gantry(130.0, "two_sided", 17.0, -16.0, *(display(o, "80") for o in (8.4, 4.6, -4.6, -8.4)), **TRUSS),
    "cantilever": gantry(160.0, "cantilever", -2.8, -17.0, sign(-8.4, 3.4, 3.0, "A"), post_side="right", **TUBE),
    "cantilever-left": gantry(190.0, "cantilever", 17.0, 2.8, display(8.4, ""), post_side="left", rotation_deg=5.0),
}
BRIDGES: dict[str, Data] = {
    "straight": {"left_abutment": 22.0, "right_abutment": -20.0, "pier_offsets": [0.0]},
    "skewed": {
        "left_abutment": 27.0,
        "right_abutment": -26.0,
        "pier_offsets": [0.0, 18.5, -18.5],
        "rotation_deg": 25.0,
        "width": 7.0,
        "clearance": 5.4,
        "deck_thickness": 1.0,
        "pier_width": 0.8,
    },
}
BEACONS: dict[str, Data] = {
    f"beacon-{turn}-{side}": {
        "type": "ConstructionBeacon",
        "station": 20.0 + 9 * i,
        "offset": -6.0,
        "pass_side": side,
        "rotation_deg": turn,
        "height": 1.0 + 0.1 * i,
        "width": 0.25 + 0.05 * i,
        "elevation": 0.1 * i,
    }
    for i, (turn, side) in enumerate([(0.0, "left"), (0.0, "right"), (180.0, "left"), (180.0, "right")])
}


def bridge(station: float, **more: object) -> Data:
    return {"type": "Overpass", "station": station, "offset": 0.0, **more}


@pytest.fixture(scope="module")
def road() -> FurnishedRoad:
    bridges = {name: bridge(60.0 + 150.0 * i, **item) for i, (name, item) in enumerate(BRIDGES.items())}
    return FurnishedRoad(GANTRIES | bridges | BEACONS, PARTS)


@pytest.fixture(scope="module")
def drawn(road: FurnishedRoad, tmp_path_factory: pytest.TempPathFactory) -> Roads:
    """Return the roads of its OpenDRIVE file."""
    path = tmp_path_factory.mktemp("drawn") / "road.xodr"
    write_opendrive(road.parameters, path, 0.005)
    return Roads.read(path)


def axes(road: FurnishedRoad, name: str) -> Float:
    """Return the object's axes as columns (3, 3): to the right, along the road, up; its own x is along the road."""
    matrix = np.array(road.model.objects[name].matrix_world)
    return np.column_stack([-matrix[:3, 1], matrix[:3, 0], matrix[:3, 2]])


def frame(road: FurnishedRoad, name: str, points: Float) -> Float:
    """Return points (N, 3) from the object's origin: x right, y along the road."""
    return (points - np.array(road.model.objects[name].matrix_world)[:3, 3]) @ axes(road, name)


def world(road: FurnishedRoad, name: str, points: Float) -> Float:
    return points @ axes(road, name).T + np.array(road.model.objects[name].matrix_world)[:3, 3]


def faces_of(road: FurnishedRoad, name: str) -> list[str]:
    """Return the roles of a gantry's objects."""
    return [role for role in road.model.objects if role == name or role.startswith(f"{name}/")]


def clearance(road: FurnishedRoad, name: str, mesh: SceneMesh, corner: Float) -> float:
    """Return how far the lowest part over the pavement is above the highest pavement below, m.

    Args:
        corner: (2, 2) x and y between which the parts that span the road are.
    """
    x, y = (np.linspace(corner[0][i], corner[1][i], count) for i, count in ((0, 420), (1, 71)))
    grid = world(road, name, np.stack(np.meshgrid(x, y, [0.0]), axis=-1).reshape(-1, 3))
    pavement = cast_down(tree_of(road.mesh("Road"), "road"), grid[:, :2])
    paved = ~np.isnan(pavement)
    made = tree_of(mesh)
    places = zip(*grid[paved, :2].T, pavement[paved], strict=True)
    hits = (made.ray_cast((float(x), float(y), float(z)), (0.0, 0.0, 1.0))[0] for x, y, z in places)
    return min(hit.z for hit in hits if hit is not None) - float(np.nanmax(pavement))


@pytest.mark.keep_scene
class TestGantry:
    @pytest.mark.parametrize("name", list(GANTRIES))
    def test_its_clearance_is_kept(self, road: FurnishedRoad, name: str) -> None:
        item, mesh = GANTRIES[name], road.mesh(*faces_of(road, name))
        # Without the posts and the ladder, which all stand off the pavement.
        left, right = item["left_offset"] - item["offset"], item["right_offset"] - item["offset"]
        own = frame(road, name, mesh.vertices)
        high = own[own[:, 2] > 4.0]
        corner = np.array([[-left, high[:, 1].min()], [-right, high[:, 1].max()]])
        slack = MEASURE + 0.03 * 0.02  # faces stand a little before the boards, on a rising road
        assert clearance(road, name, mesh, corner) == pytest.approx(item.get("clearance", 5.2), abs=slack)

    @pytest.mark.parametrize("name", list(GANTRIES))
    def test_the_beam_reaches_from_end_to_end(self, road: FurnishedRoad, name: str) -> None:
        item, mesh = GANTRIES[name], road.mesh(name)
        own = frame(road, name, mesh.vertices)
        half = item.get("post_width", 0.5) / 2
        posts = {"one_sided": "left right", "two_sided": "left right middle"}.get(item["kind"], item.get("post_side"))
        level = own[:, 2] > 4.0
        for end, sign_ in (("left", -1.0), ("right", 1.0)):
            reach = sign_ * (item["offset"] - item[f"{end}_offset"])
            post = half if end in posts else 0.0
            assert (own[level, 0] * sign_).max() == pytest.approx(reach + post, abs=MEASURE)
        plinths = {round(float(p[..., 0].mean()), 1) for p in self._plinths(road, name)}
        wanted = {"left": item["left_offset"], "right": item["right_offset"], "middle": 0.0}
        assert plinths == {round(item["offset"] - wanted[post], 1) for post in posts.split()}

    def _plinths(self, road: FurnishedRoad, name: str) -> list[Float]:
        mesh = road.mesh(name)
        found = pieces(mesh, of_material(mesh, "bridge_concrete"))
        return [frame(road, name, p.reshape(-1, 3)).reshape(p.shape) for p in found]

    @pytest.mark.parametrize("name", list(GANTRIES))
    def test_its_posts_stand_on_the_ground(self, road: FurnishedRoad, name: str) -> None:
        for plinth in self._plinths(road, name):
            points = world(road, name, plinth.reshape(-1, 3))
            middle = points.mean(axis=0)
            ground = road.surface(middle[None, :2])[0]
            assert points[:, 2].max() - ground == pytest.approx(0.3, abs=MEASURE)
            assert points[:, 2].min() - ground == pytest.approx(-0.6, abs=MEASURE)

    @pytest.mark.parametrize("name", ["bare", "against", "both"])
    def test_the_beam_has_its_size(self, road: FurnishedRoad, name: str) -> None:
        item = GANTRIES[name]
        own = frame(road, name, road.mesh(name).vertices)
        depth, height = item.get("beam_depth", 0.6), item.get("beam_height", 0.8)
        # The posts enclose the beam by 2 cm.
        assert np.ptp(own[own[:, 0] < own[:, 0].min() + 1e-3, 1]) >= depth
        shown = frame(road, name, road.edit(name, "Left Post", False).vertices)
        end = shown[(shown[:, 0] < shown[:, 0].min() + 1e-3) & (shown[:, 2] > 4.0)]
        road.edit(name, "Left Post", True)
        assert np.ptp(end[:, 1]) == pytest.approx(depth, abs=MEASURE)
        assert np.ptp(end[:, 2]) == pytest.approx(height, abs=MEASURE)

    @pytest.mark.parametrize("name", ["boards", "against", "both", "cantilever"])
    def test_signs_hang_at_their_offsets_and_face_their_traffic(self, road: FurnishedRoad, name: str) -> None:
        item = GANTRIES[name]
        for number, board in enumerate(item["signs"], 1):
            mesh = road.mesh(f"{name}/sign-{number}")
            own = frame(road, name, mesh.vertices)
            lit = 0.9 if board["kind"] == "display" else 1.0
            middle = (own.max(axis=0) + own.min(axis=0)) / 2
            assert item["offset"] - middle[0] == pytest.approx(board["offset"], abs=MEASURE)
            assert np.ptp(own, axis=0)[[0, 2]] == pytest.approx(
                [board["width"] * lit, board["height"] * lit], abs=MEASURE
            )
            towards = -1.0 if board["offset"] < 0.0 else 1.0
            written = of_material(mesh, "sheeting_white", "led_white")
            assert written.any()
            assert (normals(mesh, written)[:, :2] @ self._forwards(road, name) * towards > 0.99).all()
            assert middle[1] * towards > item.get("beam_depth", 0.6) / 2

    def _forwards(self, road: FurnishedRoad, name: str) -> Float:
        return axes(road, name)[:2, 1]

    @pytest.mark.parametrize("name", ["boards", "against", "both", "cantilever"])
    def test_signals_hang_where_the_model_has_them(self, road: FurnishedRoad, drawn: Roads, name: str) -> None:
        item = road.parameters.objects[name]
        for number, board in enumerate(item.signs, 1):
            face = frame(road, name, road.mesh(f"{name}/sign-{number}").vertices)
            middle = world(road, name, (face.min(axis=0) + face.max(axis=0))[None] / 2)[0, 2] + road.origin[2]
            (made,) = [item for item in drawn.signals().values() if item.get("name") == f"{name}-{number}"]
            lower = (drawn.place(made) - road.parameters.transform.translate)[2]
            assert lower + board.height / 2 == pytest.approx(middle, abs=MEASURE)

    def test_a_display_that_shows_nothing_has_no_face(self, road: FurnishedRoad) -> None:
        assert faces_of(road, "cantilever-left") == ["cantilever-left"]
        assert "display" in road.mesh("cantilever-left").materials

    @pytest.mark.parametrize("name", list(GANTRIES))
    def test_its_parts_are_closed_and_look_outwards(self, road: FurnishedRoad, name: str) -> None:
        for piece in pieces(road.mesh(name)):
            assert open_edges(piece) == 0
            assert volume(piece) > 0.0

    @pytest.mark.parametrize("name", list(GANTRIES))
    def test_faces_carry_class_instance_and_shade(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(*faces_of(road, name))
        assert set(mesh.class_id) == {class_id("shield_gantry")}
        assert set(mesh.instance_id) == {road.instance(name)}
        assert "unknown" not in {mesh.materials[i] for i in np.unique(mesh.material)}
        made = road.model.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        shade = np.empty(len(made.vertices), np.float32)
        made.attributes["shade"].data.foreach_get("value", shade)
        assert shade.max() == pytest.approx(GANTRIES[name].get("shade", 0.5))

    def test_triangles_are_few(self, road: FurnishedRoad) -> None:
        for name in GANTRIES:
            count = len(road.mesh(name).triangles)
            print(f"{name}: {count} triangles")
            assert count < (4500 if name == "both" else 1500)


@pytest.mark.keep_scene
class TestOverpass:
    def bridge(self, road: FurnishedRoad, name: str) -> tuple[SceneMesh, Float]:
        """Return an overpass's mesh, and its vertices in its own frame without its skew."""
        mesh = road.mesh(name)
        own = frame(road, name, mesh.vertices)
        own[:, 1] -= own[:, 0] * np.tan(np.deg2rad(BRIDGES[name].get("rotation_deg", 0.0)))
        return mesh, own

    def parts(self, road: FurnishedRoad, name: str, *materials: str) -> list[Float]:
        """Return the pieces (T, 3, 3) of some materials in the bridge's own frame without its skew."""
        mesh, own = self.bridge(road, name)
        moved = SceneMesh(**{**mesh.__dict__, "vertices": own.astype(np.float32)})
        return pieces(moved, of_material(mesh, *materials))

    @pytest.mark.parametrize("name", list(BRIDGES))
    def test_its_clearance_is_kept(self, road: FurnishedRoad, name: str) -> None:
        item = bridge(0.0, **BRIDGES[name])
        deck = max(self.parts(road, name, "bridge_concrete"), key=lambda p: np.ptp(p[..., 0]))
        underside = deck[..., 2].min() + road.model.objects[name].location.z
        half, skew = item.get("width", 10.0) / 2, np.tan(np.deg2rad(item.get("rotation_deg", 0.0)))
        x, y = np.linspace(-item["left_abutment"], -item["right_abutment"], 900), np.linspace(-half, half, 9)
        grid = np.stack(np.meshgrid(x, y, [0.0]), axis=-1).reshape(-1, 3)
        grid[:, 1] += grid[:, 0] * skew
        below = cast_down(tree_of(road.mesh("Road"), "road"), world(road, name, grid)[:, :2])
        assert underside - np.nanmax(below) == pytest.approx(item.get("clearance", 4.9), abs=MEASURE)
        # Nothing else of the bridge is lower over the pavement.
        mesh = road.mesh(name)
        own = frame(road, name, mesh.vertices)
        piers = [-offset for offset in item["pier_offsets"]]
        free = np.all([np.abs(own[:, 0] - x) > 1.0 for x in piers], axis=0)
        paved = ~np.isnan(cast_down(tree_of(road.mesh("Road"), "road"), mesh.vertices[:, :2]))
        assert not (free & paved).any() or mesh.vertices[free & paved, 2].min() > underside - 1e-3

    @pytest.mark.parametrize("name", list(BRIDGES))
    def test_deck_abutments_and_piers_have_their_places_and_sizes(self, road: FurnishedRoad, name: str) -> None:
        item = bridge(0.0, **BRIDGES[name])
        width, thickness = item.get("width", 10.0), item.get("deck_thickness", 1.2)
        beams = np.concatenate([p.reshape(-1, 3) for p in self.parts(road, name, "barrier_concrete")])
        assert np.ptp(beams[:, 1]) == pytest.approx(width, abs=MEASURE)
        deck, *rest = sorted(self.parts(road, name, "bridge_concrete"), key=lambda p: -np.ptp(p[..., 0]))
        asphalt = max(self.parts(road, name, "asphalt"), key=lambda p: np.ptp(p[..., 0]))
        assert asphalt[..., 2].max() - deck[..., 2].min() == pytest.approx(thickness, abs=MEASURE)
        foot = deck[..., 2].min() - 1.0
        walls = [p for p in rest if np.ptp(p[..., 1]) > width * 0.9 and p[..., 2].min() < foot]
        assert min(p[..., 0].min() for p in walls if p[..., 0].min() > 0) == pytest.approx(
            -item["right_abutment"], abs=MEASURE
        )
        assert max(p[..., 0].max() for p in walls if p[..., 0].max() < 0) == pytest.approx(
            -item["left_abutment"], abs=MEASURE
        )
        piers = [p for p in rest if np.ptp(p[..., 0]) < 2.0 and np.abs(p[..., 0]).max() < 19.5]
        found = sorted((float((p[..., 0].max() + p[..., 0].min()) / 2), float(np.ptp(p[..., 0]))) for p in piers)
        pier = item.get("pier_width", 1.0)
        assert found == [pytest.approx((-offset, pier), abs=MEASURE) for offset in sorted(item["pier_offsets"])[::-1]]

    @pytest.mark.parametrize("name", list(BRIDGES))
    def test_railings_are_as_high_as_the_parapet(self, road: FurnishedRoad, name: str) -> None:
        asphalt = max(self.parts(road, name, "asphalt"), key=lambda p: np.ptp(p[..., 0]))
        rails = self.parts(road, name, "galvanised_steel")
        top = max(p[..., 2].max() for p in rails)
        assert top - asphalt[..., 2].max() == pytest.approx(1.1, abs=MEASURE)

    @pytest.mark.parametrize("name", list(BRIDGES))
    def test_piers_and_walls_end_below_the_ground(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        found = pieces(mesh, of_material(mesh, "bridge_concrete"))
        standing = [p.reshape(-1, 3) for p in found if np.ptp(p[..., 2]) > 3.0]
        assert len(standing) >= 4 + len(BRIDGES[name]["pier_offsets"])
        for points in standing:
            feet = points[points[:, 2] < points[:, 2].min() + 0.01]
            assert (feet[:, 2] < road.surface(feet[:, :2])).all()

    @pytest.mark.parametrize("name", list(BRIDGES))
    def test_embankments_fall_to_the_ground_at_the_batters_slope(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        slopes = of_material(mesh, "grass_ground")
        assert set(mesh.class_id[slopes]) == {class_id("ground")}
        normal = normals(mesh, slopes)
        assert normal[:, 2].min() > -1e-3
        tilted = (normal[:, 2] > 0.1) & (normal[:, 2] < 0.95)
        steepness = np.hypot(*normal[tilted, :2].T) / normal[tilted, 2]
        assert np.median(steepness) == pytest.approx(1 / 1.5, rel=0.03)
        # The lowest corner of every face of the slopes is below the ground, where there is ground.
        lowest = corners(mesh, slopes)[tilted]
        lowest = lowest[np.arange(len(lowest)), lowest[..., 2].argmin(axis=1)]
        ground = road.surface(lowest[:, :2])
        assert np.nanmax(lowest[:, 2] - ground) < 0.0

    @pytest.mark.parametrize("name", list(BRIDGES))
    def test_its_solids_are_closed_and_look_outwards(self, road: FurnishedRoad, name: str) -> None:
        mesh = road.mesh(name)
        for piece in pieces(mesh, of_material(mesh, "bridge_concrete", "barrier_concrete")):
            assert open_edges(piece) == 0
            assert volume(piece) > 0.0

    def test_faces_carry_class_and_instance(self, road: FurnishedRoad) -> None:
        for name in BRIDGES:
            mesh = road.mesh(name)
            assert set(mesh.class_id) == {class_id("bridge"), class_id("ground")}
            assert set(mesh.instance_id) == {road.instance(name)}
            assert "unknown" not in {mesh.materials[i] for i in np.unique(mesh.material)}
            print(f"{name}: {len(mesh.triangles)} triangles")
            assert len(mesh.triangles) < 12_000


@pytest.mark.keep_scene
class TestBeacon:
    def one(self, road: FurnishedRoad, name: str) -> tuple[SceneMesh, Float]:
        """Return the beacons' mesh and a beacon's triangles (T, 3, 3) relative to its place on the ground."""
        mesh = road.mesh("Beacons")
        own = mesh.instance_id == road.instance(name)
        place = road.point(BEACONS[name]["station"], BEACONS[name]["offset"])
        _, heading, _ = road.geometry.alignment.frame(np.array([BEACONS[name]["station"]]))
        turn = heading[0] - np.pi / 2
        rotation = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        moved = SceneMesh(**{**mesh.__dict__, "vertices": ((mesh.vertices - place) @ rotation.T).astype(np.float32)})
        return moved, own

    @pytest.mark.parametrize("name", list(BEACONS))
    def test_blades_have_their_size_above_the_ground(self, road: FurnishedRoad, name: str) -> None:
        mesh, own = self.one(road, name)
        item = BEACONS[name]
        blade = corners(mesh, own & of_material(mesh, "sheeting_white", "sheeting_red")).reshape(-1, 3)
        assert np.ptp(blade[:, 2]) == pytest.approx(item["height"], abs=MEASURE)
        assert np.ptp(blade[:, 0]) == pytest.approx(item["width"], abs=MEASURE)
        assert blade[:, 2].min() == pytest.approx(0.16 + item["elevation"], abs=MEASURE)
        foot = corners(mesh, own & of_material(mesh, "rubber")).reshape(-1, 3)
        assert foot[:, 2].min() == pytest.approx(item["elevation"] - 0.01, abs=MEASURE)

    @pytest.mark.parametrize("name", list(BEACONS))
    def test_stripes_fall_to_the_side_that_traffic_passes_on(self, road: FurnishedRoad, name: str) -> None:
        mesh, own = self.one(road, name)
        for front in (True, False):
            before = corners(mesh)[..., 1].mean(axis=1) * (-1.0 if front else 1.0) > 0.02
            red, white = (
                corners(mesh, own & before & of_material(mesh, f"sheeting_{color}")) for color in ("red", "white")
            )
            looks = normals(mesh, own & before & of_material(mesh, "sheeting_red"))[:, 1]
            assert (looks * (-1.0 if front else 1.0) > 0.99).all()
            area = [np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum() for t in (red, white)]
            # Half and half; behind the white triangles is the white plate.
            assert area[0] == pytest.approx(BEACONS[name]["height"] * BEACONS[name]["width"], rel=0.1)
            edges = np.concatenate([red[:, i] - red[:, i - 1] for i in range(3)])
            oblique = edges[(np.abs(edges[:, 0]) > 0.02) & (np.abs(edges[:, 2]) > 0.02)]
            # x is right: stripes that fall to the left rise to the right.
            rises = oblique[:, 2] / oblique[:, 0]
            assert (rises > 0.0).all() if BEACONS[name]["pass_side"] == "left" else (rises < 0.0).all()

    def test_faces_carry_class_instance_and_material(self, road: FurnishedRoad) -> None:
        mesh = road.mesh("Beacons")
        assert set(mesh.class_id) == {class_id("construction_barrier")}
        assert set(mesh.instance_id) == {road.instance(name) for name in BEACONS}
        assert "unknown" not in {mesh.materials[i] for i in np.unique(mesh.material)}
        assert len(mesh.triangles) / len(BEACONS) < 400


def test_a_changed_input_changes_the_mesh() -> None:
    road = FurnishedRoad(
        {"boards": GANTRIES["boards"], "straight": bridge(150.0, **BRIDGES["straight"])}, ("gantries", "overpasses")
    )
    before = road.mesh("boards/sign-1").vertices[:, 2].min()
    bottom = pieces_low(road, "straight")
    road.edit("boards", "Clearance", 6.2)
    # The faces go with the boards.
    assert road.mesh("boards/sign-1").vertices[:, 2].min() - before == pytest.approx(1.0, abs=1e-3)
    road.edit("straight", "Clearance", 5.9)
    assert pieces_low(road, "straight") - bottom == pytest.approx(1.0, abs=1e-3)


def pieces_low(road: FurnishedRoad, name: str) -> float:
    """Return the z of a deck's underside."""
    mesh = road.mesh(name)
    found = pieces(mesh, of_material(mesh, "bridge_concrete"))
    return float(max(found, key=lambda p: np.ptp(p[..., :2].reshape(-1, 2), axis=0).max())[..., 2].min())


def test_structures_of_a_stretch_stand_where_they_do_on_the_whole_road(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stretches, "FRAME", 50.0)
    objects = {"boards": GANTRIES["boards"], "skewed": bridge(150.0, **BRIDGES["skewed"])}
    whole = FurnishedRoad(objects, ("gantries", "overpasses"))
    wanted = {name: whole.mesh(name).vertices + whole.origin for name in objects}
    part = FurnishedRoad(objects, ("gantries", "overpasses"), (50.0, 220.0))
    assert np.linalg.norm(part.origin) > 10.0
    for name in objects:
        found = part.mesh(name).vertices + part.origin
        assert np.abs(found.min(axis=0) - wanted[name].min(axis=0)).max() < 0.02
        assert np.abs(found.max(axis=0) - wanted[name].max(axis=0)).max() < 0.02


@pytest.mark.parametrize(
    ("make", "class_name", "along", "clearance"),
    # Below a web of the bridge.
    [(gantry_group, "shield_gantry", 0.0, 5.2), (overpass_group, "bridge", 1.9, 4.9)],
)
def test_a_structure_can_be_put_onto_an_object_of_ones_own(
    make: Callable[[], bpy.types.NodeTree], class_name: str, along: float, clearance: float
) -> None:
    item = bpy.data.objects.new("Own", bpy.data.meshes.new("Own"))
    bpy.context.scene.collection.objects.link(item)
    item.location = (5.0, 0.0, 2.0)
    item.modifiers.new("Nodes", "NODES").node_group = make()
    hit = tree_of(scene_mesh(), class_name).ray_cast((5.0 + along, -0.5, 2.0), (0.0, 0.0, 1.0))[0]
    # Without a road the ground is the object's own z = 0.
    assert hit.z - 2.0 == pytest.approx(clearance, abs=MEASURE)
