"""Every thing of the registry in several variants: its solids against the mesh that its node group makes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.registry import model_parts
from synthroads_addon.road.terrain import surface_elevation
from synthroads_addon.road.things.registry import THINGS
from synthroads_addon.road.things.thing import Thing
from synthroads_addon.twin.things import PlacedThing, placed_things
from tests.helpers.roads.thing_variants import LENGTH, PLACE, Data, placed, straight_road
from tests.helpers.scenes.furnished_road import Float, FurnishedRoad
from tests.helpers.solid_comparison import compare, triangles_of

GROUND = ("Road", "Terrain", "Ground", "Backbone")
NOT_BUILT = {"Asset", "Hedge", "ParkedVehicle", "Tree"}
"""Things whose shape isn't made of their bodies: `test_roadside` has hedges and parked vehicles, `test_tree` trees."""
COSTLY = {"Gantry", "Overpass", "NoiseBarrier", "PowerLine"}
"""Things whose shape is in files of their own."""
_CROWN = 0.31
"""An embankment's crown begins so far (m) before the ends of a bridge's wing walls."""


class BuiltThings:
    """Variants of things on a straight road, built."""

    def __init__(self, objects: dict[str, Data]) -> None:
        parts = [part for part in model_parts() if part not in ("vegetation", "vehicles")]
        self.road = FurnishedRoad(straight_road(objects), parts)
        shown = [item for role, item in self.road.model.objects.items() if role not in GROUND]
        self._mesh = scene_mesh(objects=shown)

    def things(self) -> Iterator[PlacedThing]:
        """Yield the things that have a shape."""
        for placed_thing in placed_things(self.road.geometry, 0.005):
            if type(placed_thing.thing).__name__ not in NOT_BUILT:
                yield placed_thing

    def triangles(self, found: PlacedThing) -> Float:
        """Return the triangles (T, 3, 3) of a thing in the frame of its bodies; a bridge's without its embankments."""
        mesh = self._mesh
        chosen = mesh.instance_id == found.thing.instance
        chosen &= mesh.class_id == class_id(found.thing.semantic_class)
        points = mesh.vertices[mesh.triangles[chosen]].astype(np.float64) + self.road.origin
        if found.frame is None:
            return points
        away = points - found.frame.origin
        points = np.stack([away[..., :2] @ found.frame.right, away[..., :2] @ found.frame.along, away[..., 2]], axis=-1)
        if found.thing.twin().cityjson != "Bridge":
            return points
        walls = np.concatenate([b.sections.reshape(-1, 3)[:, 0] for b in found.bodies if "abutment" in b.part])
        low, high = walls.min() + _CROWN, walls.max() - _CROWN
        beyond = (points[..., 0] < low).all(axis=1) | (points[..., 0] > high).all(axis=1)
        earth = np.isin(np.array(mesh.materials)[mesh.material[chosen]], ("asphalt", "grass_ground"))
        return points[~(beyond & earth)]

    def misfits(self, found: PlacedThing) -> int:
        """Return how many points of a thing's mesh and of its bodies have nothing in the other."""
        solid = [triangles_of(body) for body in found.bodies if not body.detail]
        fittings = [triangles_of(body) for body in found.bodies if body.detail]
        misfit = compare(self.triangles(found), solid, fittings)
        return len(misfit.of_mesh) + len(misfit.of_bodies)


@pytest.fixture(scope="module")
def built() -> BuiltThings:
    """The usual variant of the things that are quickly built; `test_all_variants` has all."""
    return BuiltThings(placed([kind for kind in THINGS if kind not in COSTLY], most=1))


@pytest.mark.keep_scene
class TestBodies:
    def test_every_thing_is_there(self, built: BuiltThings) -> None:
        assert {type(found.thing).__name__ for found in built.things()} == set(THINGS) - NOT_BUILT - COSTLY
        assert all(found.bodies for found in built.things())

    def test_solids_are_the_models(self, built: BuiltThings) -> None:
        assert {found.name: built.misfits(found) for found in built.things() if built.misfits(found)} == {}

    def test_a_height_that_differs_by_three_millimetres_is_seen(self, built: BuiltThings) -> None:
        standing = [found for found in built.things() if found.frame and "height" in _measures(found.thing)]
        assert len(standing) > 5
        assert [found.name for found in standing if not built.misfits(_changed(found, "height"))] == []


SHAPE = {"crest_length": 0.8, "rounding_length": 3.0, "swale_width": 2.0, "swale_depth": 0.4}


@pytest.mark.parametrize(
    ("ground", "chord"),
    [
        ({"undulation": 0.0}, 1e-3),
        # The ground itself has chords: 5 mm along, and as much across; roundings and swales have theirs.
        ({"undulation": 0.5, "embankment_height": -0.4} | SHAPE, 2e-2),
    ],
)
def test_the_ground_beside_the_road_is_the_analytic_one(ground: Data, chord: float) -> None:
    data = straight_road({})
    data["terrain"] |= ground
    road = FurnishedRoad(data, [])
    rng = np.random.default_rng(1)
    station, offset = rng.uniform(2.0, LENGTH - 2.0, 800), rng.uniform(15.6, 24.0, 800)
    plan = road.geometry.alignment.place(station, offset)
    known = surface_elevation(road.geometry, station, offset)
    found = road.surface(plan - road.origin[:2]) + road.origin[2]
    assert np.abs(found - known).max() < chord
    vertices = road.mesh("Terrain").vertices
    station, offset = road.located(vertices)
    inside = (station > 0.5) & (station < LENGTH - 0.5)
    known = surface_elevation(road.geometry, station[inside], offset[inside]) - road.origin[2]
    assert np.abs(vertices[inside, 2] - known).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in THINGS if kind not in NOT_BUILT])
def test_all_variants(kind: str) -> None:
    """Their solids are the model's; and where any measure differs by 3 mm, it is seen."""
    built = BuiltThings(placed([kind]))
    found = list(built.things())
    assert len(found) >= 3
    assert {item.name: built.misfits(item) for item in found if built.misfits(item)} == {}
    for measure in _measures(found[0].thing) if found[0].frame else ():
        assert any(built.misfits(_changed(item, measure)) for item in found), measure


HIDDEN = {"parapet_height", "kerb_batter"} | {"shade"}


def _measures(thing: Thing) -> list[str]:
    """Return the fields of a thing that are lengths of it."""
    fields = type(thing).model_fields
    return [name for name in fields if name not in PLACE | HIDDEN and isinstance(getattr(thing, name), float)]


def _changed(found: PlacedThing, measure: str) -> PlacedThing:
    """Return a standing thing whose bodies are those of one with another measure."""
    assert found.frame
    thing = found.thing.model_copy(update={measure: getattr(found.thing, measure) + 0.003})
    return found._replace(bodies=thing.bodies(found.frame.place()))
