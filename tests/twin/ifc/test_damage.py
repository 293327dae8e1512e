"""Damage and joints of the pavement in IFC: the same outlines as the parameters', on the road's surface."""

from pathlib import Path

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.section import Carriageway
from tests.helpers.files.ifc_reading import body, named, written
from tests.helpers.roads.damage_outlines import (
    HIGHEST,
    check_joints,
    check_outline,
    damaged_road,
    laid_damage,
    outline_of,
)
from tests.judges.ifc import issues


def test_damage_and_joints_are_those_of_the_parameters(tmp_path: Path) -> None:
    parameters = damaged_road()
    geometry = RoadGeometry(parameters)
    file = written(parameters, tmp_path)
    assert not issues(file)

    def triangles(name: str) -> list:
        vertices, faces = body(named(file, name, "IfcSurfaceFeature"), exact=True)
        return list(vertices[faces])

    for name, carriageway in parameters.of_type(Carriageway).items():
        first = len(carriageway.pavement.ruts) + len(carriageway.pavement.potholes)
        for number, item in enumerate(laid_damage(carriageway), first):
            check_outline(
                geometry,
                triangles(geometry.numbers.part(name, number)[0]),
                outline_of(item, carriageway.pavement),
                HIGHEST,
            )
        joints = [f"{name}/{kind}-joints" for kind in ("longitudinal", "transverse")]
        check_joints(geometry, carriageway, [shape for joint in joints for shape in triangles(joint)])
