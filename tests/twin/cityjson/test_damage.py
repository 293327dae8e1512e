"""Damage and joints of the pavement in CityJSON: the same outlines as the parameters', on the road's surface."""

from pathlib import Path

import numpy as np

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.section import Carriageway
from synthroads_addon.twin.cityjson.writer import write_cityjson
from tests.helpers.files.cityjson_files import faults_of, read_city
from tests.helpers.roads.damage_outlines import (
    HIGHEST,
    check_joints,
    check_outline,
    damaged_road,
    laid_damage,
    outline_of,
)


def test_damage_and_joints_are_those_of_the_parameters(tmp_path: Path) -> None:
    parameters = damaged_road()
    geometry, origin = RoadGeometry(parameters), np.array(parameters.transform.translate)
    write_cityjson(parameters, tmp_path / "a.city.json", 0.005)
    city = read_city(tmp_path / "a.city.json")
    assert not faults_of(city)
    damage = {about["id"]: rings for _, about, rings in city.surfaces("+PavementDamage")}
    joints: dict[int, list[np.ndarray]] = {}
    for _, about, rings in city.surfaces("+PavementJoint"):
        joints.setdefault(about["instance"], []).extend(ring - origin for ring in rings)
    checked = 0
    for name, carriageway in parameters.of_type(Carriageway).items():
        first = len(carriageway.pavement.ruts) + len(carriageway.pavement.potholes)
        for number, item in enumerate(laid_damage(carriageway), first):
            rings = [ring - origin for ring in damage[geometry.numbers.part(name, number)[0]]]
            check_outline(geometry, rings, outline_of(item, carriageway.pavement), HIGHEST)
            checked += 1
        check_joints(geometry, carriageway, joints[carriageway.instance])
    assert checked == len(damage) == 6
