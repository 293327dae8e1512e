"""Cross-sections, lane drops, turnouts, damage, painted areas: the mesh against the analytic road, by numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.compat import modifier_input, set_modifier_input
from synthroads_addon.blender.model.build import RoadModel, build_road
from synthroads_addon.blender.model.read_back import edited_parameters
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.blender.things.road.layout import names_in_words, side_of
from synthroads_addon.road.damage import deepest_damage
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import SECTIONS_OF_CLASS, is_single
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Carriageway, LineMarking, Pothole, Turnout
from synthroads_addon.road.stretches import FRAME, stretches
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.turnout_geometry import STEP
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.relative_speed import quiet_seconds

ROUNDING = 2e-4
TOLERANCES = {"draft": 0.020, "standard": 0.005, "high": 0.001}
CLASS_OF_SECTION = {section: name for name, sections in SECTIONS_OF_CLASS.items() for section in sections}
CASES = [
    pytest.param(name, section, marks=() if CLASS_OF_SECTION[section] == name else pytest.mark.slow)
    for name, sections in SECTIONS_OF_CLASS.items()
    for section in sections
]
"""Each cross-section once, and as slow tests those of all classes."""

Float = NDArray[np.float64]


@dataclass
class Built:
    """A road in the scene beside its analytic truth."""

    parameters: RoadParameters
    geometry: RoadGeometry
    model: RoadModel

    def mesh(self, *roles: str) -> SceneMesh:
        return scene_mesh(objects=[self.model.objects[role] for role in roles] or None)

    def errors(self, mesh: SceneMesh, *names: str) -> Float:
        """Return how far points of some classes lie above the analytic surface; not on a step's centimetre."""
        triangles = mesh.triangles[np.isin(mesh.class_id, [class_id(name) for name in names])]
        points = random_points(mesh, triangles)
        station, offset = self.geometry.alignment.project(points[:, :2])
        truth = self.geometry.elevation(np.clip(station, 0.0, self.geometry.length), offset)
        kinks = [k for section in self.geometry.sections.values() for k in section.kinks()]
        on_step = (np.abs(station[:, None] - np.array([*kinks, -1.0])) < STEP).any(axis=1)
        inside = np.isfinite(truth) & ~on_step
        assert np.count_nonzero(~np.isfinite(truth)) < 20  # on the very edge, by rounding
        return points[inside, 2] - truth[inside]


def longest_edges(mesh: bpy.types.Mesh) -> Float:
    """Return the length (m) of each face's longest edge."""
    corners, start = np.empty(len(mesh.loops), np.int32), np.empty(len(mesh.polygons), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.polygons.foreach_get("loop_start", start)
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    following = np.arange(len(corners)) + 1
    following[np.append(start[1:], len(corners)) - 1] = start
    places = places.reshape(-1, 3).astype(np.float64)
    edges = np.linalg.norm(places[corners[following]] - places[corners], axis=1)
    return np.maximum.reduceat(edges, start)


def random_points(mesh: SceneMesh, triangles: NDArray[np.int32], count: int = 15_000) -> Float:
    rng = np.random.default_rng(1)
    corners = mesh.vertices[triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    weight = rng.dirichlet((1.0, 1.0, 1.0), count)
    return np.einsum("nk,nkd->nd", weight, corners[rng.choice(len(area), count, p=area / area.sum())])


def everything(design_class: str = "EKA1A", cross_section: str = "RQ31", length: float = 900.0) -> RoadScenario:
    """Return a scenario whose carriageways have exits, entries, bays, lane changes and damage wherever they fit."""
    data: dict[str, Any] = {"design_class": design_class, "cross_section": cross_section, "length": length}
    if not is_single(design_class):  # one carriageway has none of these
        data["turnouts"] = {"exits": 0.9, "entries": 0.9, "emergency_bays": 0.9}
        data["lane_changes"] = {"share": 0.9}
    data["pavement"] = {"rutted": 0.9, "potholes_per_km": {"minimum": 3.0, "maximum": 6.0}}
    return RoadScenario.from_dict(data)


def built(parameters: RoadParameters, tolerance: float = 0.005, parts: tuple[str, ...] = ("road",)) -> Built:
    return Built(parameters, RoadGeometry(parameters), build_road(BuildRequest(parameters, tolerance, 0.3, parts)))


def cases() -> Iterator[Any]:
    """Yield all cross-sections; every fourth is built in both Blenders."""
    for number, case in enumerate(CASES):
        yield pytest.param(*case.values, marks=[*case.marks, *([pytest.mark.any_blender] if number % 4 else [])])


@pytest.mark.parametrize(("design_class", "cross_section"), cases())
def test_every_cross_section_follows_the_analytic_surface(design_class: str, cross_section: str) -> None:
    road = built(sample_road(everything(design_class, cross_section), 4))
    mesh = road.mesh("Road")
    surfaces = [(("road", "roadside"), 0.0), (("road_marking",), None)]
    if not road.parameters.of_type(LineMarking):  # the narrowest road has no lines
        assert not np.any(mesh.class_id == class_id("road_marking"))
        surfaces.pop()
    for names, above in surfaces:
        error = road.errors(mesh, *names)
        if above is None:
            assert error.min() > -0.005
            continue
        print(f"{design_class} {cross_section}: {np.abs(error).max() * 1000:.2f} mm at most")
        assert np.abs(error).max() < 0.005
    item = road.model.objects["Road"].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    area, normal = np.empty(len(item.polygons), np.float32), np.empty((len(item.polygons), 3), np.float32)
    item.polygons.foreach_get("area", area)
    item.polygons.foreach_get("normal", normal.ravel())
    assert (area / longest_edges(item)).min() > 5e-5  # m; kinks nearer than 1e-4 are joined, rows in curves nearer
    assert normal[:, 2].min() > 0.05


@pytest.mark.parametrize(
    "fidelity",
    [
        pytest.param(name, marks=pytest.mark.any_blender if name in ("high", "draft") else pytest.mark.slow)
        for name in TOLERANCES
    ],
)
def test_every_fidelity_keeps_its_tolerance_with_turnouts_and_damage(fidelity: str) -> None:
    parameters = sample_road(everything("EKA1A", "RQ36", 800.0), 5)
    assert parameters.of_type(Turnout)
    assert any(c.pavement.potholes and c.pavement.ruts for c in parameters.of_type(Carriageway).values())
    road = built(parameters, TOLERANCES[fidelity])
    error = road.errors(road.mesh("Road"), "road", "roadside")
    print(f"{fidelity}: {np.abs(error).max() * 1000:.2f} mm at most")
    assert np.abs(error).max() < TOLERANCES[fidelity]


def test_there_are_no_cracks_where_widths_change() -> None:
    road = built(sample_road(everything("EKA1A", "RQ36", 800.0), 5), parts=("road", "terrain"))
    mesh = road.mesh("Road", "Terrain")
    chosen = np.isin(mesh.class_id, [class_id(name) for name in ("road", "roadside", "ground")])
    _, same = np.unique(mesh.vertices, axis=0, return_inverse=True)
    corners = same.ravel()[mesh.triangles[chosen]]
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    borders, counts = np.unique(edges, axis=0, return_counts=True)
    assert counts.max() == 2
    place = np.empty((same.max() + 1, 3))
    place[same.ravel()] = mesh.vertices
    ends = place[borders[counts == 1]]
    station, offset = road.geometry.alignment.project(ends.mean(axis=1)[:, :2])
    at_border = np.abs(np.abs(offset) - road.parameters.terrain.half_width) < 0.05  # type: ignore[union-attr]
    at_end = np.minimum(np.abs(station), np.abs(station - road.geometry.length)) < 1e-3
    open_ = ends[~(at_border | at_end)]
    # What is left are slivers whose faces were deleted: none wider than a millimetre.
    assert len(open_) == 0 or _widths(open_).max() < 1e-3


def _widths(edges: Float) -> Float:
    """Return how far (N,) the middle of every open edge (N, 2, 3) lies from the nearest other open edge."""
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    length = np.maximum((along**2).sum(axis=1), 1e-18)
    away = np.empty(len(edges))
    for i, middle in enumerate(edges.mean(axis=1)):
        share = np.clip(((middle - start) * along).sum(axis=1) / length, 0.0, 1.0)
        distance = np.linalg.norm(start + share[:, None] * along - middle, axis=1)
        distance[i] = np.inf
        away[i] = distance.min()
    return away


@pytest.mark.any_blender
def test_a_hole_is_wider_than_a_crack() -> None:
    """Widths of a missing triangle of 1 m, and of a sliver of 0.2 mm that rounding took."""
    for width in (1.0, 2e-4):
        corners = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.5, width, 0.0)])
        widest = _widths(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)).max()
        assert 0.3 * width < widest <= width


@pytest.mark.any_blender
def test_strips_of_turnouts_carry_the_turnouts_instances() -> None:
    road = built(sample_road(everything("EKA1A", "RQ31"), 3))
    mesh = road.mesh("Road")
    instances = {item.instance for item in road.parameters.of_type(Turnout).values()}
    assert instances
    assert instances <= set(np.unique(mesh.instance_id[mesh.class_id == class_id("road")]).tolist())
    chosen = mesh.class_id != class_id("road_marking")
    station, offset = road.geometry.alignment.project(mesh.vertices[mesh.triangles[chosen]].mean(axis=1)[:, :2])
    strips = road.geometry.strip_index(station, offset)
    wanted = np.zeros(len(station), np.int64)
    for number, strip in enumerate(road.geometry.strips):
        wanted[strips == number] = road.geometry.instances(strip, station[strips == number])
    for name, carriageway in road.parameters.of_type(Carriageway).items():
        damage = deepest_damage(road.geometry.sections[carriageway.side], station, offset)
        wanted[damage >= 0] = road.geometry.numbers.parts[name].first + damage[damage >= 0]
    assert np.mean(mesh.instance_id[chosen] != wanted) < 2e-3  # but for slivers across a border


@pytest.mark.any_blender
def test_painted_areas_lie_on_the_pavement() -> None:
    road = built(sample_road(everything("EKA1A", "RQ31", 1500.0), 3), parts=("road", "painted_areas"))
    mesh = road.mesh("Painted Areas")
    assert (mesh.class_id == class_id("road_marking")).all()
    assert mesh.normals()[:, 2].min() > 0.3  # some lie over potholes
    error = road.errors(mesh, "road_marking")
    print(f"painted areas: {error.min() * 1000:.2f} to {error.max() * 1000:.2f} mm above the analytic surface")
    assert error.min() > -0.005
    assert error.max() < 0.006 + 0.005


class TestEdits:
    def edited(self, role: str, name: str, value: float, parts: tuple[str, ...]) -> tuple[Built, RoadParameters]:
        """Edit an input of a modifier; return the road, and the parameter set that it stands for now."""
        road = built(sample_road(everything("EKA1A", "RQ36", 600.0), 2), parts=parts)
        bpy.context.view_layer.update()
        modifier = road.model.objects[role].modifiers[0]

        def edit() -> None:
            set_modifier_input(modifier, name, value)
            bpy.context.view_layer.update()

        assert quiet_seconds(edit) < 0.4  # of both cores
        return road, edited_parameters(road.parameters, road.model.objects)

    def test_nothing_edited_is_nothing_changed(self) -> None:
        road = built(sample_road(everything("EKA1A", "RQ36", 800.0), 5), parts=("road", "terrain", "guardrails"))
        assert edited_parameters(road.parameters, road.model.objects).to_json() == road.parameters.to_json()

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("Right Lane 1 Width", 4.25),
            pytest.param("Left Inner Offset", 3.5, marks=pytest.mark.any_blender),
            pytest.param("Left Verge Slope", 0.12, marks=pytest.mark.any_blender),
            pytest.param("Right Verge Width", 2.5, marks=pytest.mark.any_blender),
        ],
    )
    def test_the_exported_set_agrees_with_the_edited_surface(self, name: str, value: float) -> None:
        road, now = self.edited("Road", name, value, ("road",))
        assert now != road.parameters
        edited = Built(now, RoadGeometry(now), road.model)
        moved = np.abs(edited.geometry.offsets(300.0) - road.geometry.offsets(300.0)).max()
        lifted = np.abs(edited.geometry.boundary_elevations(300.0) - road.geometry.boundary_elevations(300.0)).max()
        assert max(moved, lifted) > 0.05
        assert np.abs(edited.errors(road.mesh("Road"), "road", "roadside")).max() < 0.006

    def test_a_marking_s_edit_is_exported(self) -> None:
        parameters = sample_road(everything("EKA1A", "RQ36", 600.0), 2)
        line, item = next(pair for pair in parameters.of_type(LineMarking).items() if pair[1].dash_length == 6.0)
        words = f"{side_of(parameters, item)} {names_in_words(parameters)[line]}"
        _, now = self.edited("Road", f"{words} Dash Length", 4.5, ("road",))
        assert now.objects[line].dash_length == 4.5  # type: ignore[union-attr]

    def test_post_spacing_and_batter_slope_are_exported(self) -> None:
        parameters = sample_road(everything("EKA1A", "RQ36", 600.0), 2)
        rail = next(iter(parameters.of_type(Guardrail)))
        _, now = self.edited(rail, "Post Spacing", 1.7, ("road", "terrain", "guardrails"))
        assert now.objects[rail].post_spacing == 1.7  # type: ignore[union-attr]
        _, now = self.edited("Terrain", "Batter Slope", 3.25, ("road", "terrain"))
        assert now.terrain is not None
        assert now.terrain.batter_slope == 3.25


class TestStretches:
    @pytest.mark.any_blender
    def test_stretches_join_to_the_whole(self) -> None:
        parameters = sample_road(everything("EKA1A", "RQ31", 450.0), 3)
        parts = ("road", "painted_areas", "terrain", "guardrails", "delineators")
        whole = built(parameters, parts=parts).mesh()
        area: dict[int, float] = {}
        for stretch in stretches(450.0, 150.0):
            build_road(BuildRequest(parameters, 0.005, 0.3, parts, stretch))
            mesh = scene_mesh()
            assert np.abs(mesh.vertices).max() < FRAME
            for number in np.unique(mesh.instance_id):
                area[number] = area.get(number, 0.0) + float(mesh.areas()[mesh.instance_id == number].sum())
        for number in np.unique(whole.instance_id):
            wanted = whole.areas()[whole.instance_id == number].sum()
            assert area[number] == pytest.approx(wanted, rel=2e-3, abs=0.02), number

    @pytest.mark.any_blender
    def test_local_origins_stay_exact_on_the_map(self) -> None:
        parameters = sample_road(RoadScenario(length=10_000.0), 4)
        geometry = RoadGeometry(parameters)
        model = build_road(BuildRequest(parameters, 0.005, 0.0, ("road",), (9_000.0, 9_200.0)))
        mesh = scene_mesh()
        vertices = mesh.vertices[np.unique(mesh.triangles[mesh.class_id == class_id("road")])].astype(np.float64)
        on_map = vertices + model.origin
        local = on_map - np.array(parameters.transform.translate)
        station, offset = geometry.alignment.project(local[:, :2])
        error = local[:, 2] - geometry.elevation(station, offset)
        assert np.nanmax(np.abs(error)) < ROUNDING
        assert station.min() > 9_000.0 - 1e-3
        assert station.max() < 9_200.0 + 1e-3
        assert isinstance(modifier_input(model.objects["Road"].modifiers[0], "Left Lane 1 Width"), float)


def test_a_pothole_reaches_into_an_edge_strip_of_a_quarter_of_a_metre() -> None:
    whole = sample_road(RoadScenario.from_dict({"design_class": "EKL4", "cross_section": "W5.5", "length": 200.0}), 4)
    carriageway = whole.carriageway("right")
    assert carriageway is not None
    name = next(name for name, item in whole.objects.items() if item is carriageway)
    edge = float(RoadGeometry(whole).sections["right"].distances(100.0)[0, 1])
    pothole = Pothole(station=100.0, offset=-(edge - 0.15), length=0.7, width=0.56, depth=0.05)
    pavement = carriageway.pavement.model_copy(update={"potholes": (pothole,), "ruts": ()})
    damaged = carriageway.model_copy(update={"pavement": pavement})
    road = built(whole.model_copy(update={"objects": whole.objects | {name: damaged}}))
    points = road.mesh("Road").vertices.astype(np.float64)
    station, offset = road.geometry.alignment.project(points[:, :2])
    near = (np.abs(station - 100.0) < 0.3) & (offset < -edge - 0.02) & (offset > -edge - 0.1)
    assert np.count_nonzero(near) > 20
