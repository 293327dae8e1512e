"""Outlines of a pavement's damage worked out by shapely from the parameters alone, and checks of measured ones."""

from copy import deepcopy

import numpy as np
from shapely import LineString, MultiPoint, Polygon, box, contains_xy, hausdorff_distance, make_valid, union_all
from shapely.geometry.base import BaseGeometry

from synthroads_addon.base.arrays import Float
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.pavement.field import ArrayCalculus, Shape, asphalt_height, concrete_height
from synthroads_addon.road.pavement.places import pavement_places
from synthroads_addon.road.section import Carriageway, Crack, Patch, Pavement, RemovedMarking
from synthroads_addon.road.section_geometry import CarriagewaySection
from tests.helpers.effects.road_cases import base_road

MILLIMETRE = 1e-3
HIGHEST = 0.0034
"""Highest face of damage above the pavement: a crack on a marking's film, m."""


def damaged_road() -> RoadParameters:
    """Return a short road with damage of every kind on asphalt and on concrete; an arrow is cracked and patched."""
    arrow = {"type": "Arrow", "carriageway": "right", "kind": "straight", "station": 40.0, "offset": -6.0}
    data = deepcopy(base_road({"arrow": arrow}))
    patch = {"outline": [[41.0, -6.5], [43.0, -6.5], [43.5, -5.5], [41.0, -5.8]], "age": 0.9}
    data["objects"]["right"]["pavement"]["patches"].append(patch)
    net = [[[20.0, 5.0], [20.4, 5.3], [20.9, 5.1]], [[20.1, 5.4], [20.4, 5.3], [20.6, 4.8]]]
    across = [[[30.0, 4.0], [30.2, 5.5], [30.1, 8.0]]]
    data["objects"]["left"]["pavement"]["cracks"] = [
        {"kind": "alligator", "width": 0.008, "lines": net},
        {"kind": "transverse", "width": 0.05, "sealed": True, "lines": across},
    ]
    return RoadParameters.from_dict(data)


def outline_of(item: Patch | Crack | RemovedMarking, pavement: Pavement) -> BaseGeometry:
    """Return the area of a patch, crack or removed marking in stations and offsets, m."""
    if isinstance(item, Patch):
        return MultiPoint(item.outline).convex_hull
    if isinstance(item, Crack):
        bands = [
            LineString(line).buffer(item.width / 2.0, cap_style="flat", join_style="mitre", mitre_limit=2.0)
            for line in item.lines
        ]
        return union_all(bands)
    low, high = item.offset - item.width / 2.0, item.offset + item.width / 2.0
    starts = np.arange(item.start_station, item.end_station, item.dash_length + item.gap_length)
    dashes = union_all([box(s, low, min(s + item.dash_length, item.end_station), high) for s in starts])
    return dashes.difference(union_all([outline_of(patch, pavement) for patch in pavement.patches]))


def laid_damage(carriageway: Carriageway) -> list[Patch | Crack | RemovedMarking]:
    """Return a carriageway's damage that has faces of its own, in the order of its numbers."""
    pavement = carriageway.pavement
    return [*pavement.patches, *pavement.cracks, *pavement.removed_markings]


def check_outline(geometry: RoadGeometry, polygons: list[Float], wanted: BaseGeometry, height: float) -> None:
    """Assert that polygons (K, 3), local coordinates, cover an area within 1 mm and lie within 1 mm above the road.

    Args:
        geometry: the road.
        polygons: m.
        wanted: area in stations and offsets.
        height: highest above the pavement, m.
    """
    found = []
    for corners in polygons:
        station, offset = geometry.alignment.project(corners[:, :2])
        found.append(make_valid(Polygon(np.column_stack([station, offset]))))
        above = corners[:, 2] - geometry.elevation(station, offset)
        assert above.min() > -MILLIMETRE
        assert above.max() < height + MILLIMETRE
    # Neighbours' corners are rounded apart from each other: gaps up to 0.6 mm are closed.
    whole = union_all([shape.buffer(0.0003, join_style="mitre") for shape in found])
    whole = make_valid(whole.buffer(-0.0003, join_style="mitre"))
    assert hausdorff_distance(whole, wanted, 0.05) < MILLIMETRE
    assert whole.symmetric_difference(wanted).area < MILLIMETRE * wanted.length


def check_joints(geometry: RoadGeometry, carriageway: Carriageway, polygons: list[Float]) -> None:
    """Assert that polygons (K, 3), local coordinates, cover a carriageway's joints as its heights have them."""
    section = geometry.sections[carriageway.side]
    outlines = [np.column_stack(geometry.alignment.project(corners[:, :2])) for corners in polygons]
    whole = union_all([make_valid(Polygon(outline)).buffer(0.0003, join_style="mitre") for outline in outlines])
    whole = whole.buffer(-0.0003, join_style="mitre")
    rng, corners = np.random.default_rng(0), np.concatenate(outlines)
    near = np.repeat(corners, 1 + 20_000 // len(corners), axis=0)
    near = near + rng.uniform(-0.03, 0.03, near.shape)
    wide = np.column_stack([rng.uniform(0.0, geometry.length, 5000), rng.uniform(*_paved(section), 5000)])
    places = np.concatenate([near, wide])
    low, high = _paved(section)
    inside = (places[:, 0] > 0.0) & (places[:, 0] < geometry.length) & (places[:, 1] > low) & (places[:, 1] < high)
    station, offset = places[inside].T
    field = concrete_height if carriageway.pavement.is_concrete else asphalt_height
    more = (carriageway.pavement.slab_length,) if carriageway.pavement.is_concrete else ()
    joint = -np.asarray(field(ArrayCalculus(), pavement_places(section, station, offset), Shape(0.0, 1.0), *more))
    assert 200 < (joint > 0.5).sum() < len(joint) - 200
    assert not contains_xy(whole.buffer(-MILLIMETRE), station, offset)[joint < 0.5].any()
    assert contains_xy(whole.buffer(MILLIMETRE), station, offset)[joint > 0.5].all()


def _paved(section: CarriagewaySection) -> tuple[float, float]:
    """Return the lowest and highest offset that is paved all along, m."""
    distances = section.distances(np.array([0.0, 20.0, 45.0, 60.0]))
    inner, outer = float(distances[:, 0].max()), float(distances[:, -2].min())
    return (inner, outer) if section.carriageway.sign > 0 else (-outer, -inner)
