"""The IFC model, as readers that we didn't write see it, against the parameter set and its analytic geometry."""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.util.pset
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import unit_of
from synthroads_addon.road.alignment import Alignment, Element
from synthroads_addon.road.damage import damage_numbers
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.instances import InstanceNumbers
from synthroads_addon.road.lanes import lane_of
from synthroads_addon.road.objects import LineObject, PointObject, width_at
from synthroads_addon.road.other_roads.axis import HorizontalElement
from synthroads_addon.road.parameters import AlignmentObject, RoadParameters
from synthroads_addon.road.section import Carriageway, LineMarking, Turnout
from synthroads_addon.road.surroundings import Vegetation, Vehicle
from synthroads_addon.road.terrain import surface_elevation
from synthroads_addon.road.things.asset import Asset
from synthroads_addon.road.things.concrete_barrier import ConcreteBarrier
from synthroads_addon.road.things.gantry import Gantry
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.noise_barrier import NoiseBarrier
from synthroads_addon.road.things.overpass import Overpass
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.twin.ifc.alignment import plan_segments, write_alignment
from synthroads_addon.twin.ifc.entities import IfcFile
from synthroads_addon.twin.ifc.writer import write_ifc, write_project
from synthroads_addon.twin.trace import Trace
from tests.helpers.files.alignment_segments import gaps
from tests.helpers.files.ifc_reading import (
    along,
    body,
    fallback,
    map_coordinates,
    named,
    open_edges,
    parts,
    placement,
    said,
    volume,
    whole_body,
    written,
)
from tests.helpers.files.twin_reports import numbers_of
from tests.helpers.roads.checker_full_road import full
from tests.helpers.roads.parameter_sets import OBJECTS, road_data
from tests.helpers.roads.sampled_parts import PAIRS, scenario
from tests.helpers.roads.twin_roads import full_road
from tests.judges.ifc import issues

UTM = (294_123.456, 5_628_987.654, 181.25)
MILLIMETRE = 1e-3
EVERYTHING = {
    "turnouts": {"exits": 1, "entries": 1, "emergency_bays": 1},
    "lane_changes": {"share": 1},
    "pavement": {"rutted": 1, "potholes_per_km": {"minimum": 4, "maximum": 8}},
    "barriers": {"noise_barrier": 1},
    "furniture": {"gantries": 1, "lighting": 1, "surveillance": 1, "overpass": 1, "construction_zone": 1},
}


def _moved(data: dict[str, Any]) -> RoadParameters:
    data["transform"] = {"translate": list(UTM)}
    return RoadParameters.from_dict(data)


@pytest.fixture(scope="module", params=["straight", pytest.param("curved", marks=pytest.mark.first_python)])
def road(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[RoadParameters, Any]:
    """A road with every kind of object and a curved, sampled one, at UTM coordinates, each with its file."""
    if request.param == "straight":
        parameters = _moved(full())
    else:
        limits = scenario(design_class="EKA3", cross_section="RQ38.5", length=1000.0, **EVERYTHING)
        parameters = _moved(sample_road(limits, 11).to_dict())
    return parameters, written(parameters, tmp_path_factory.mktemp(request.param))


# --- valid ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("road", ["straight", pytest.param("curved", marks=pytest.mark.slow)], indirect=True)
def test_nothing_is_invalid(road) -> None:
    _, file = road
    assert file.schema_identifier == "IFC4X3_ADD2"
    assert issues(file) == []


def test_the_validator_sees_faults(tmp_path) -> None:
    file = written(sample_road(scenario(length=50.0), 1), tmp_path)
    file.by_type("IfcAlignmentHorizontalSegment")[0].SegmentLength = -1.0
    file.by_type("IfcSite")[0].GlobalId = "short"
    feature = file.by_type("IfcSurfaceFeature")[0]
    container = file.by_type("IfcRelContainedInSpatialStructure")[0]
    container.RelatedElements = [*container.RelatedElements, feature]
    assert len(issues(file)) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("number", range(50))
def test_fifty_random_roads_are_valid_and_true(number: int, tmp_path) -> None:
    design_class, section = PAIRS[number % len(PAIRS)]
    length = (50.0, 200.0, 400.0, 800.0, 1500.0)[number % 5]
    more = EVERYTHING if length >= 1500.0 else {}
    placing = "random" if number % 7 == 3 else "rules"
    limits = scenario(design_class=design_class, cross_section=section, length=length, placement=placing, **more)
    parameters = _moved(sample_road(limits, 1000 + number).to_dict())
    file = written(parameters, tmp_path)
    assert issues(file) == []
    assert max(gaps(file).values()) < 1e-6
    geometry = RoadGeometry(parameters)
    _check_curves(file, geometry)
    _check_semantics(file, geometry.length)
    _check_places(file, parameters, geometry)
    _check_instances(file, parameters)
    _check_lanes(file, parameters, geometry)


def test_standard_property_sets_are_those_of_the_standard(road) -> None:
    _, file = road
    templates = ifcopenshell.util.pset.PsetQto("IFC4X3")
    checked = set()
    for relation in file.by_type("IfcRelDefinesByProperties"):
        found = relation.RelatingPropertyDefinition
        if found.Name.startswith("SynthRoads"):
            continue
        template = templates.get_by_name(found.Name)
        types = {item.Name: item for item in template.HasPropertyTemplates}
        for item in found.HasProperties:
            rule = types[item.Name]
            if item.is_a("IfcPropertyEnumeratedValue"):
                allowed = {value.wrappedValue for value in rule.Enumerators.EnumerationValues}
                assert {value.wrappedValue for value in item.EnumerationValues} <= allowed
            else:
                assert item.NominalValue.is_a() == rule.PrimaryMeasureType
        for product in relation.RelatedObjects:
            kind = getattr(product, "PredefinedType", None) or ""
            assert found.Name in templates.get_applicable_names(product.is_a(), kind)
        checked.add(found.Name)
    assert {"Pset_RailingCommon", "Pset_RoadMarkingCommon", "Pset_Superelevation", "Pset_Width"} <= checked


# --- the alignment --------------------------------------------------------------------------------------------------


def _check_curves(file: Any, geometry: RoadGeometry) -> None:
    """Every metre, plan and gradient curve lie within a millimetre of the analytic axis."""
    station = np.append(np.arange(0.0, geometry.length, 1.0), geometry.length - 1e-6)
    axis = np.column_stack([geometry.alignment.position(station), geometry.profile.elevation(station)])
    (plan,) = file.by_type("IfcCompositeCurve", include_subtypes=False)
    (gradient,) = file.by_type("IfcGradientCurve")
    assert np.abs(along(plan, station)[:, :2] - axis[:, :2]).max() < MILLIMETRE
    assert np.abs(along(gradient, station) - axis).max() < MILLIMETRE


def test_the_curves_follow_the_axis(road) -> None:
    parameters, file = road
    _check_curves(file, RoadGeometry(parameters))


def _integrated(x: float, y: float, heading: float, curvature: tuple[float, float], at: np.ndarray, length: float):
    """Return points (N, 2) at distances (N,) along a segment whose curvature changes linearly, by quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    u = at[:, None] * (nodes + 1.0) / 2.0
    angle = heading + curvature[0] * u + (curvature[1] - curvature[0]) * u**2 / (2.0 * length)
    half = at[:, None] / 2.0 * weights
    return np.column_stack([x + (np.cos(angle) * half).sum(axis=1), y + (np.sin(angle) * half).sum(axis=1)])


def _check_semantics(file: Any, length: float) -> None:
    """The semantic segments, evaluated by their definition, give the geometric curves."""
    (alignment,) = file.by_type("IfcAlignment")
    layouts = {layout.is_a(): layout for rel in alignment.IsNestedBy for layout in rel.RelatedObjects}
    (plan,) = file.by_type("IfcCompositeCurve", include_subtypes=False)
    (gradient,) = file.by_type("IfcGradientCurve")
    designs = [item.DesignParameters for item in layouts["IfcAlignmentHorizontal"].IsNestedBy[0].RelatedObjects]
    assert designs[-1].SegmentLength == 0.0
    start = 0.0
    for design in designs[:-1]:
        at = np.linspace(0.0, design.SegmentLength, 9)
        radii = design.StartRadiusOfCurvature, design.EndRadiusOfCurvature
        first, last = (1.0 / radius if radius else 0.0 for radius in radii)
        x, y = design.StartPoint.Coordinates
        meant = _integrated(x, y, design.StartDirection, (first, last), at, design.SegmentLength)
        assert np.abs(along(plan, start + at * (1.0 - 1e-9))[:, :2] - meant).max() < MILLIMETRE
        assert {"LINE": first == last == 0.0, "CIRCULARARC": first == last != 0.0}.get(design.PredefinedType, True)
        start += design.SegmentLength
    assert start == pytest.approx(length, abs=1e-6)
    reached = 0.0
    for item in layouts["IfcAlignmentVertical"].IsNestedBy[0].RelatedObjects[:-1]:
        design = item.DesignParameters
        assert design.StartDistAlong == pytest.approx(reached, abs=1e-5)
        u = np.linspace(0.0, design.HorizontalLength, 9)
        change = (design.EndGradient - design.StartGradient) / design.HorizontalLength
        if design.RadiusOfCurvature:
            assert change == pytest.approx(1.0 / design.RadiusOfCurvature, rel=1e-6)
        else:
            assert change == 0.0
        meant = design.StartHeight + u * (design.StartGradient + change * u / 2.0)
        station = np.minimum(design.StartDistAlong + u, length - 1e-6)
        assert np.abs(along(gradient, station)[:, 2] - meant).max() < MILLIMETRE
        reached += design.HorizontalLength
    assert reached == pytest.approx(length, abs=1e-5)


def test_semantics_equal_geometry(road) -> None:
    parameters, file = road
    _check_semantics(file, RoadGeometry(parameters).length)


def test_a_changed_radius_is_seen(tmp_path) -> None:
    parameters = _bent([(200.0, 0.0, 1 / 900), (200.0, 1 / 900, 1 / 900)])
    file = written(parameters, tmp_path)
    _check_semantics(file, 400.0)
    design = next(d for d in file.by_type("IfcAlignmentHorizontalSegment") if d.PredefinedType == "CIRCULARARC")
    design.StartRadiusOfCurvature = design.EndRadiusOfCurvature = 890.0
    with pytest.raises(AssertionError):
        _check_semantics(file, 400.0)


def _bent(elements: list[tuple[float, float, float]], points: list[dict[str, float]] | None = None) -> RoadParameters:
    """Return a bare road of given elements (length, curvature at start and end) and points of vertical intersection."""
    axis = {
        "type": "Alignment",
        "instance": 1,
        "start_x": -1234.5,
        "start_y": 987.25,
        "start_heading_deg": 137.0,
        "horizontal": [HorizontalElement.between(*map(float, e)).to_dict() for e in elements],
        "vertical": points or [{"station": 0.0, "elevation": 3.0}],
    }
    data = full()
    kept = {name: item for name, item in data["objects"].items() if name in ("right", "median", "left")}
    for item in kept.values():
        item.pop("pavement", None)
    data["objects"] = {"axis": axis, **kept}
    return _moved(data)


def _axis_alone(geometry: RoadGeometry, folder: Path) -> Any:
    """Write nothing but a road's alignment, and open the file."""
    ifc = IfcFile("axis", Trace(geometry))
    write_project(ifc, geometry.parameters)
    write_alignment(ifc, geometry)
    ifc.write_relations()
    ifc.write(folder / "axis.ifc", "", "")
    return ifcopenshell.open(str(folder / "axis.ifc"))


FLAT = [
    (radius, length, change)
    for radius in (280.0, 900.0, 5000.0, 1e6)
    for length in (20.0, 400.0)
    for change in (1e-12, 1.1e-6, 1e-5, 1e-3, 1e-1)
]


@pytest.mark.slow
def test_clothoids_between_nearly_equal_radii(tmp_path) -> None:
    # All in one file, to the left and the right in turn: what an IFC clothoid is worst at.
    elements = []
    for number, (radius, length, change) in enumerate(FLAT):
        sign = 1.0 - 2.0 * (number % 2)
        first, last = sign / radius, sign / radius + sign * change / length
        elements += [(length, first, last), (length, last, first), (50.0, 0.0, 0.0), (length, 0.0, last)]
        elements += [(length, last, -first), (30.0, 0.0, 1e-9)]
    file = _axis_alone(RoadGeometry(_bent(elements)), tmp_path)
    alignment = Alignment([Element(*map(float, e)) for e in elements], -1234.5, 987.25, math.radians(137.0))
    (plan,) = file.by_type("IfcCompositeCurve", include_subtypes=False)
    station = np.linspace(0.0, alignment.length * (1.0 - 1e-12), 3000)
    assert np.abs(along(plan, station)[:, :2] - alignment.position(station)).max() < MILLIMETRE
    _check_semantics(file, alignment.length)


def test_curvatures_whose_radius_is_no_number_are_none(tmp_path) -> None:
    elements = [(100.0, 0.0, 0.0), (100.0, -2e-313, 1e-3), (50.0, 1e-310, 1e-310), (100.0, 1e-3, 1e-313)]
    geometry = RoadGeometry(_bent(elements))
    file = _axis_alone(geometry, tmp_path)
    designs = file.by_type("IfcAlignmentHorizontalSegment")
    assert [design.PredefinedType for design in designs] == ["LINE", "CLOTHOID", "LINE", "CLOTHOID", "LINE"]
    assert [design.StartRadiusOfCurvature for design in designs] == [0.0, 0.0, 0.0, 1000.0, 0.0]
    _check_semantics(file, geometry.length)


def test_the_guidelines_clothoids_are_clothoids() -> None:
    for design_class, section in PAIRS[::2]:
        parameters = sample_road(scenario(design_class=design_class, cross_section=section, length=5000.0), 5)
        for element in plan_segments(RoadGeometry(parameters).alignment):
            if element.kind == "CLOTHOID":
                change = element.end_curvature - element.start_curvature
                # The turn from the spiral's middle to where the element begins.
                assert element.start_curvature**2 * element.length / abs(2.0 * change) < 1.0


def test_profiles_with_kinks_and_touching_roundings(tmp_path) -> None:
    points = [
        {"station": -50.0, "elevation": 0.0},
        {"station": 100.0, "elevation": 3.0, "radius": 2000.0},
        {"station": 180.0, "elevation": 1.4, "radius": 2000.0},
        {"station": 300.0, "elevation": 3.8},
        {"station": 390.0, "elevation": 2.0, "radius": 100_000.0},
        {"station": 900.0, "elevation": -8.0},
    ]
    # The first two roundings touch: T = 2000 * 0.04 / 2 = 40 m on either side of the gap of 80 m.
    file = written(_bent([(400.0, 0.0, 0.001)], points), tmp_path)
    geometry = RoadGeometry(_bent([(400.0, 0.0, 0.001)], points))
    _check_curves(file, geometry)
    _check_semantics(file, 400.0)
    codes = [segment.Transition for segment in file.by_type("IfcGradientCurve")[0].Segments]
    assert codes.count("CONTINUOUS") == 1
    assert codes[-1] == "DISCONTINUOUS"


@pytest.mark.parametrize("length", [1.0, 100_000.0])
def test_very_short_and_very_long_alignments(length: float, tmp_path) -> None:
    share = length / 5.0
    elements = [(share, 0, 0), (share, 0, 1e-4), (share, 1e-4, 1e-4), (share, 1e-4, -2e-4), (share, -2e-4, -2e-4)]
    geometry = RoadGeometry(_bent(elements))
    file = _axis_alone(geometry, tmp_path)
    station = np.linspace(0.0, length * (1.0 - 1e-9), 500)
    (plan,) = file.by_type("IfcCompositeCurve", include_subtypes=False)
    assert np.abs(along(plan, station)[:, :2] - geometry.alignment.position(station)).max() < MILLIMETRE


def test_referents_say_crossfall_and_width(road) -> None:
    parameters, file = road
    geometry = RoadGeometry(parameters)
    seen = {"SUPERELEVATIONEVENT": 0, "WIDTHEVENT": 0, "STATION": 0}
    (alignment,) = file.by_type("IfcAlignment")
    nest = next(rel for rel in alignment.IsNestedBy if rel.RelatedObjects[0].is_a("IfcReferent"))
    stations = [said(item, "Pset_Stationing")["Station"] for item in nest.RelatedObjects]
    assert stations == sorted(stations)
    for item, station in zip(nest.RelatedObjects, stations, strict=True):
        seen[item.PredefinedType] += 1
        point = geometry.alignment.position(np.array([station]))[0]
        assert np.abs(placement(item)[:2, 3] - point).max() < MILLIMETRE
        if item.PredefinedType == "STATION":
            continue
        carriageway = parameters.objects[item.Name.split("/")[0]]
        assert isinstance(carriageway, Carriageway)
        if item.PredefinedType == "SUPERELEVATIONEVENT":
            assert said(item, "Pset_Superelevation")["Side"] == [carriageway.side.upper()]
            value = said(item, "Pset_Superelevation")["Superelevation"]
            assert value == pytest.approx(float(geometry.crossfall(carriageway, station)), abs=1e-9)
        else:
            distances = geometry.sections[carriageway.side].distances(station)[0]
            width = said(item, "Pset_Width")["NominalWidth"]
            assert width == pytest.approx(distances[-2] - distances[0], abs=1e-6)
    assert seen["STATION"] == 1
    assert seen["SUPERELEVATIONEVENT"] >= 2
    assert seen["WIDTHEVENT"] >= 10


# --- places ---------------------------------------------------------------------------------------------------------


def _check_places(file: Any, parameters: RoadParameters, geometry: RoadGeometry) -> None:
    """Furniture on the road stands where the parameter set says, upright, for both kinds of readers."""
    products = {item.Name: item for item in file.by_type("IfcProduct") if item.ObjectPlacement is not None}
    inside = 0
    for name, item in parameters.of_type(PointObject).items():
        if item.type == "Arrow":
            continue
        station, offset = np.array([item.station]), np.array([item.offset])
        point = geometry.point(station, offset)[0]
        inside += bool(np.isfinite(point[2]))
        point[2] = surface_elevation(geometry, station, offset)[0] + item.elevation
        assert np.isfinite(geometry.point(station, offset)[0, 2]) <= (
            abs(geometry.point(station, offset)[0, 2] + item.elevation - point[2]) < 1e-9
        )
        _check_place(products[name], file, parameters, point, float(geometry.alignment.heading(station)[0]))
    for name, item in parameters.of_type(LineObject).items():
        station, offset = np.array([item.start_station]), np.array([item.offset])
        point = geometry.point(station, offset)[0]
        point[2] = surface_elevation(geometry, station, offset)[0]
        _check_place(products[name], file, parameters, point, float(geometry.alignment.heading(station)[0]))


def _check_place(product: Any, file: Any, parameters: RoadParameters, point: np.ndarray, heading: float) -> None:
    assert product.ObjectPlacement.is_a("IfcLinearPlacement")
    for matrix in (placement(product), fallback(product)):
        assert np.abs(matrix[:3, 3] - point).max() < MILLIMETRE
        assert matrix[:3, 2] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
        assert matrix[:3, 0] == pytest.approx([math.cos(heading), math.sin(heading), 0.0], abs=1e-6)
    on_map = map_coordinates(file, placement(product)[:3, 3])
    assert np.abs(on_map - (point + parameters.transform.translate)).max() < MILLIMETRE


def test_furniture_stands_where_it_should(road) -> None:
    parameters, file = road
    _check_places(file, parameters, RoadGeometry(parameters))


def test_two_millimetres_are_seen(tmp_path) -> None:
    parameters = _moved(sample_road(scenario(length=100.0), 4).to_dict())
    file = written(parameters, tmp_path)
    _check_places(file, parameters, RoadGeometry(parameters))
    product = named(file, _standing(parameters)[0])
    location = product.ObjectPlacement.RelativePlacement.Location
    location.OffsetLateral += 0.002
    with pytest.raises(AssertionError):
        _check_places(file, parameters, RoadGeometry(parameters))


def _standing(parameters: RoadParameters) -> list[str]:
    return [name for name, item in parameters.of_type(PointObject).items() if item.type != "Arrow"]


def test_vehicles_are_on_their_lanes(road) -> None:
    parameters, file = road
    geometry = RoadGeometry(parameters)
    for name, item in parameters.of_type(Vehicle).items():
        station = np.array([item.station])
        point = geometry.point(station, lane_of(geometry, item).offset(station))[0]
        assert np.abs(placement(named(file, name))[:3, 3] - point).max() < MILLIMETRE


def test_georeferencing(road) -> None:
    parameters, file = road
    (target,) = file.by_type("IfcProjectedCRS")
    assert target.Name == f"EPSG:{parameters.metadata.epsg}"
    assert "UTM" in target.Description
    assert target.GeodeticDatum == "European_Terrestrial_Reference_System_1989"
    (conversion,) = file.by_type("IfcMapConversion")
    assert (conversion.Eastings, conversion.Northings, conversion.OrthogonalHeight) == UTM


# --- parameters -----------------------------------------------------------------------------------------------------


def _check_instances(file: Any, parameters: RoadParameters, may_miss: str = "") -> None:
    """Every object and its damage is there under its id with its number, and no other numbers are.

    What begins with `may_miss`, if that is given, may be missing.
    """
    numbers = {name: item.instance for name, item in parameters.objects.items()}
    found: dict[str, set[int]] = {}
    for item in file.by_type("IfcObject"):
        if "instance" in said(item):
            found.setdefault(item.Name, set()).add(said(item)["instance"])
    assert {name: {number} for name, number in numbers.items()}.items() <= found.items()
    known = InstanceNumbers(parameters)
    for name, item in parameters.of_type(Carriageway).items():
        damages = damage_numbers(item.pavement)
        numbers |= dict(known.part(name, number) for number in range(len(damages)))
    stands = parameters.of_type(Vegetation)
    numbers |= {name: number for number, name in numbers_of(parameters).items() if name.partition("/")[0] in stands}
    wanted = {name: {number} for name, number in numbers.items()}
    absent = {name for name in wanted if name not in found and not (may_miss and name.startswith(may_miss))}
    # Reed grows on neither verges nor median.
    assert absent == {name for name in wanted if re.match("grass-reed/(.*-verge|median)", name)}
    assert {name: number for name, number in wanted.items() if name in found}.items() <= found.items()
    assert set().union(*found.values()) == set().union(*(wanted[name] for name in wanted if name in found))


def test_instances(road) -> None:
    parameters, file = road
    _check_instances(file, parameters)


def test_objects_say_what_the_parameter_set_says(road) -> None:
    parameters, file = road
    objects = {item.Name: item for item in file.by_type("IfcObject")}
    for name, item in parameters.objects.items():
        values = said(objects[name])
        for field, info in type(item).model_fields.items():
            value = getattr(item, field)
            if isinstance(item, AlignmentObject) and field in ("horizontal", "vertical"):
                continue
            if value is None:
                assert field not in values
            elif isinstance(value, bool | int | float | str):
                assert values[field] == value, f"{name}.{field}"
            else:
                assert json.loads(values[field]) == json.loads(item.to_json())[field]
            if isinstance(value, float) and unit_of(info) == "m":
                pset = ifcopenshell.util.element.get_pset(objects[name], "SynthRoads", field, verbose=True)
                assert pset["value_type"] == "IfcLengthMeasure"


def test_the_structure_of_the_road(road) -> None:
    parameters, file = road
    (site,) = file.by_type("IfcSite")
    (road_,) = file.by_type("IfcRoad")
    assert road_ in parts(site)
    kinds = [item.PredefinedType for item in parts(road_)]
    assert sorted(kinds) == ["CENTRALRESERVE", "ROADSIDE", "ROADSIDE", "ROADWAYPLATEAU", "ROADWAYPLATEAU"]
    for name, carriageway in parameters.of_type(Carriageway).items():
        part = named(file, name, "IfcRoadPart")
        lanes = [item for item in parts(part) if item.PredefinedType == "TRAFFICLANE"]
        assert len(lanes) == len(carriageway.lanes)
        inside = [item for rel in part.ContainsElements for item in rel.RelatedElements]
        (pavement,) = [item for item in inside if item.is_a("IfcPavement")]
        assert pavement.PredefinedType == ("RIGID" if carriageway.pavement.is_concrete else "FLEXIBLE")
        assert all(course.is_a("IfcCourse") for course in parts(pavement))
    for name, turnout in parameters.of_type(Turnout).items():
        part = named(file, name, "IfcRoadPart")
        assert part.PredefinedType == ("LAYBY" if turnout.kind == "emergency_bay" else "ROADSEGMENT")
    for item in file.by_type("IfcElement"):
        contained, whole = len(item.ContainedInStructure), len(item.Decomposes)
        assert contained + whole + len(getattr(item, "AdheresToElement", ())) == 1, item


# --- measured surfaces ----------------------------------------------------------------------------------------------


def _on_road(geometry: RoadGeometry, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return geometry.alignment.project(vertices[:, :2])


def _normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the normals (M, 3) of triangles, twice as long as their areas."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def _rows(station: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the stations (R,) of the rows that vertices at stations (N,) belong to, and which one (N,)."""
    order = np.argsort(station)
    steps = np.append(0, np.diff(station[order]) > 5e-5).cumsum()
    index = np.empty(len(station), dtype=int)
    index[order] = steps
    return np.bincount(index, station) / np.bincount(index), index


def _check_lanes(file: Any, parameters: RoadParameters, geometry: RoadGeometry) -> None:
    """Lanes, as triangulated by the reader, are as wide and long as the parameter set says, and as high."""
    for name, carriageway in parameters.of_type(Carriageway).items():
        for number, lane in enumerate(carriageway.lanes):
            everywhere = width_at(lane.width, np.linspace(0.0, geometry.length, 1000))
            if everywhere.max() < 1e-3:
                continue
            vertices, _ = body(named(file, f"{name}/lane-{number}", "IfcCourse"))
            station, offset = _on_road(geometry, vertices)
            rows, index = _rows(station)
            low, high = np.full(len(rows), np.inf), np.full(len(rows), -np.inf)
            np.minimum.at(low, index, offset)
            np.maximum.at(high, index, offset)
            wide = width_at(lane.width, rows)
            # Where a lane has no width it has no triangles.
            assert np.abs((high - low) - wide).max() < MILLIMETRE
            full_length = not isinstance(lane.width, tuple)
            if full_length:
                assert rows[-1] - rows[0] == pytest.approx(geometry.length, abs=MILLIMETRE)
            boundaries = geometry.sections[carriageway.side].lane_boundaries(rows)
            middle = carriageway.sign * boundaries[:, number : number + 2].mean(axis=1)
            assert np.abs((high + low) / 2.0 - middle).max() < MILLIMETRE
            inner = np.clip(offset, low[index] + 1e-9, high[index] - 1e-9)
            assert np.abs(vertices[:, 2] - geometry.elevation(station, inner)).max() < MILLIMETRE


def test_lanes_measured(road) -> None:
    parameters, file = road
    _check_lanes(file, parameters, RoadGeometry(parameters))


def test_a_wider_lane_is_seen(tmp_path) -> None:
    parameters = _bent([(100.0, 0.0, 0.0)])
    file = written(parameters, tmp_path)
    geometry = RoadGeometry(parameters)
    _check_lanes(file, parameters, geometry)
    face = named(file, "right/lane-0", "IfcCourse").Representation.Representations[0].Items[0]
    points = [list(point) for point in face.Coordinates.CoordList]
    points[0][1] += 0.003
    points[0][0] += 0.003
    face.Coordinates.CoordList = points
    with pytest.raises(AssertionError):
        _check_lanes(file, parameters, geometry)


def test_surfaces_keep_the_tolerance(road, tmp_path) -> None:
    """Inside of their triangles, too, all surfaces lie within the tolerance of the analytic road, face up."""
    parameters, file = road
    geometry = RoadGeometry(parameters)
    area = 0.0
    for item in file.by_type("IfcCourse") + file.by_type("IfcEarthworksFill"):
        vertices, triangles = body(item)
        corners, normal = vertices[triangles], _normals(vertices, triangles)
        area += np.linalg.norm(normal, axis=1).sum() / 2.0
        assert (normal[:, 2] > 0.0).mean() > 0.99, item.Name
        large = np.linalg.norm(normal, axis=1) > 1e-4
        middle = corners[large].mean(axis=1)
        station, offset = _on_road(geometry, middle)
        # Within some millimetres of a strip's edge the analytic surface may be the neighbour's.
        heights = [geometry.elevation(station, offset + shift) for shift in (0.0, -0.01, 0.01)]
        off = np.nanmin(np.abs(np.array(heights) - middle[:, 2]), axis=0)
        ends = np.zeros(len(off), dtype=bool)
        for section in geometry.sections.values():
            for shape in section.turnouts:
                for kink in shape.kinks():
                    ends |= np.abs(station - kink) < 0.06
        assert np.nanmax(off[~ends], initial=0.0) < 0.005 + 3e-4, item.Name
    length = geometry.length
    station = np.linspace(0.0, length, 20_001)
    edges = geometry.offsets(station)
    bend = geometry.alignment.curvature(station)
    plan = (edges[:, 0] - edges[:, -1]) - bend * (edges[:, 0] ** 2 - edges[:, -1] ** 2) / 2.0
    assert area == pytest.approx((plan[1:] + plan[:-1]) @ np.diff(station) / 2.0, rel=2e-3)


def test_both_kernels_read_the_same_surface(road) -> None:
    _, file = road
    course = min(file.by_type("IfcCourse"), key=lambda item: len(body(item)[0]))
    quick, exact = (body(course, exact)[0] for exact in (False, True))
    assert len(quick) == len(exact)
    assert np.abs(np.unique(quick.round(6), axis=0) - np.unique(exact.round(6), axis=0)).max() < 1e-6


@pytest.mark.slow
def test_no_face_is_thinner_than_points_are_apart(tmp_path) -> None:
    """Where a gore begins it is micrometres wide; ifcopenshell's kernel for meshes refuses corners that near."""
    file = written(full_road(), tmp_path)
    for item in file.by_type("IfcTriangulatedFaceSet"):
        corners = np.array(item.Coordinates.CoordList)[np.array(item.CoordIndex) - 1]
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        assert (doubled / edges.max(axis=1)).min() > 5e-6
    assert len(body(named(file, "entry-left/gore", "IfcCourse"))[1]) > 60


def test_finer_tolerance_more_rows(tmp_path) -> None:
    parameters = _bent([(200.0, 1 / 300, 1 / 300)])
    rows = []
    for tolerance in (0.02, 0.001):
        # The reader crashes if the file goes before its entities.
        file = written(parameters, tmp_path, tolerance)
        rows.append(len(body(named(file, "right/lane-0", "IfcCourse"))[0]))
    assert rows[1] > 2 * rows[0]


def test_damage_is_in_the_surface_and_named(road) -> None:
    parameters, file = road
    geometry = RoadGeometry(parameters)
    defects = [item for item in file.by_type("IfcSurfaceFeature") if item.PredefinedType == "DEFECT"]
    wanted = len(geometry.numbers.damages())
    assert len(defects) == wanted > 0
    for name, carriageway in parameters.of_type(Carriageway).items():
        for hole in carriageway.pavement.potholes:
            deepest = -np.inf
            for course in parts(named(file, f"{name}/pavement", "IfcPavement")):
                vertices, _ = body(course)
                station, offset = _on_road(geometry, vertices)
                near = np.abs(station - hole.station) < hole.length / 2.0
                near &= np.abs(offset - hole.offset) < hole.width / 2.0
                if near.any():
                    heights = geometry.boundary_elevations(station[near])
                    offsets = geometry.offsets(station[near])
                    plane = [np.interp(-o, -own, z) for o, own, z in zip(offset[near], offsets, heights, strict=True)]
                    deepest = max(deepest, float((np.array(plane) - vertices[near, 2]).max()))
            ruts = [rut.depth for rut in carriageway.pavement.ruts]
            assert hole.depth - 0.008 < deepest < max(hole.depth, *ruts, 0.0) + 1e-6


def test_markings_measured(road) -> None:
    parameters, file = road
    geometry = RoadGeometry(parameters)
    for name, line in parameters.of_type(LineMarking).items():
        feature = named(file, name)
        (adheres,) = feature.AdheresToElement
        assert adheres.RelatingElement.Name == f"{line.carriageway}/pavement"
        vertices, triangles = body(feature)
        station, offset = _on_road(geometry, vertices)
        left, right = geometry.marking_edges(line, station)
        assert np.minimum(np.abs(offset - left), np.abs(offset - right)).max() < MILLIMETRE
        beside = geometry.elevation(station, np.clip(offset, geometry.offsets(station)[:, -1] + 1e-9, np.inf))
        assert np.abs(vertices[:, 2] - beside - line.film_thickness).max() < MILLIMETRE
        painted = np.linalg.norm(_normals(vertices, triangles), axis=1).sum() / 2.0
        dashes = geometry.dashes(line)
        at = np.concatenate([np.linspace(a, b, 50) for a, b in dashes])
        middle = np.mean(geometry.marking_edges(line, at), axis=0)
        share = np.mean(1.0 - geometry.alignment.curvature(at) * middle)
        assert painted == pytest.approx(line.width * np.diff(dashes, axis=1).sum() * share, rel=0.02)
    kinds = {item.PredefinedType for item in file.by_type("IfcSurfaceFeature")}
    assert {"LINEMARKING", "HATCHMARKING", "SYMBOLMARKING", "DEFECT"} <= kinds


# --- measured bodies ------------------------------------------------------------------------------------------------


def test_bodies_are_closed_and_right_way_round(road) -> None:
    _, file = road
    checked = 0
    for item in file.by_type("IfcBuiltElement") + file.by_type("IfcSign") + file.by_type("IfcSignal"):
        if item.Representation is None or item.is_a() in ("IfcCourse", "IfcEarthworksFill"):
            continue
        for representation in item.Representation.Representations:
            vertices, triangles = body(item)
            assert volume(vertices, triangles) > 0.0, item
            if representation.RepresentationType == "Tessellation":
                # The pieces of a body may touch, and then share edges: each must be closed by itself.
                for face in representation.Items:
                    points = np.array(face.Coordinates.CoordList)
                    assert open_edges(points, np.array(face.CoordIndex) - 1) == 0, item
                    assert volume(points, np.array(face.CoordIndex) - 1) > 0.0, item
            checked += 1
    assert checked > 30


def test_barriers_measured(road) -> None:
    parameters, file = road
    geometry = RoadGeometry(parameters)
    kinds = (Guardrail, ConcreteBarrier, NoiseBarrier)
    for name, item in parameters.objects.items():
        if not isinstance(item, kinds):
            continue
        vertices, _ = body(named(file, name))
        station, offset = _on_road(geometry, vertices)
        assert station.min() == pytest.approx(item.start_station, abs=0.1)
        assert station.max() == pytest.approx(item.end_station, abs=0.1)
        ramp = getattr(item, "terminal_length", 0.0)
        level = (station > item.start_station + ramp - 1e-3) & (station < item.end_station - ramp + 1e-3)
        if not level.any():
            continue
        axis = surface_elevation(geometry, station[level], np.full(level.sum(), item.offset))
        assert (vertices[level, 2] - axis).max() == pytest.approx(item.height, abs=0.006)
        if isinstance(item, ConcreteBarrier):
            assert np.ptp(offset[level]) == pytest.approx(item.base_width, abs=MILLIMETRE)
        if isinstance(item, Guardrail):
            sides = {"left": (-0.05, 0.201), "right": (-0.201, 0.05), "both": (-0.331, 0.331)}[item.faces]
            assert offset[level].min() - item.offset == pytest.approx(sides[0], abs=0.002)
            assert offset[level].max() - item.offset == pytest.approx(sides[1], abs=0.002)


def test_signs_measured(road) -> None:
    parameters, file = road
    geometry = RoadGeometry(parameters)
    for name, item in parameters.of_type(TrafficSign).items():
        product = named(file, name)
        vertices, _ = body(product)
        inside = (vertices - placement(product)[:3, 3]) @ placement(product)[:3, :3]
        turn = math.radians(item.rotation_deg)
        ahead = inside[:, 0] * math.cos(turn) + inside[:, 1] * math.sin(turn)
        left = -inside[:, 0] * math.sin(turn) + inside[:, 1] * math.cos(turn)
        plate = ahead < -item.post_diameter / 2.0 - 0.01
        assert np.ptp(left[plate]) == pytest.approx(item.width, abs=0.02 * item.width)
        assert inside[plate, 2].min() == pytest.approx(item.lower_edge, abs=0.02 * item.height)
        assert inside[plate, 2].max() == pytest.approx(item.lower_edge + item.height, abs=0.02 * item.height)
        # At rotation 0 a sign faces traffic with the stations: its face is before its posts.
        front = vertices[plate][:, :2].mean(axis=0) - placement(product)[:2, 3]
        heading = float(geometry.alignment.heading(item.station)) + turn
        assert front @ (math.cos(heading), math.sin(heading)) < 0.0


@pytest.mark.parametrize("rotation", [0.0, 170.0])
def test_faces_are_upright_and_read_from_the_front(rotation: float, tmp_path) -> None:
    data = _bent([(100.0, 1 / 300, 1 / 300)]).to_dict()
    for number, shape in enumerate(("triangle", "arrow", "round")):
        sign = {"type": "TrafficSign", "instance": 90 + number, "station": 50.0, "offset": -20.0, "shape": shape}
        sign |= {"code": "101", "width": 0.9, "height": 0.8, "rotation_deg": rotation}
        data["objects"][shape] = sign
    parameters = RoadParameters.from_dict(data)
    file = written(parameters, tmp_path)
    turn = math.radians(rotation)
    for shape in ("triangle", "arrow", "round"):
        product = named(file, shape)
        inside = (body(product)[0] - placement(product)[:3, 3]) @ placement(product)[:3, :3]
        plate = inside[inside[:, :2] @ (math.cos(turn), math.sin(turn)) < -0.06]
        # As the driver sees it: to the right, and up.
        right = plate[:, :2] @ (math.sin(turn), -math.cos(turn))
        at_top = right[plate[:, 2] > plate[:, 2].max() - 1e-6]
        rightmost = plate[right > right.max() - 1e-6, 2]
        if shape == "triangle":
            assert at_top.mean() == pytest.approx(0.0, abs=1e-6)
            assert np.ptp(at_top) < 0.05
        elif shape == "arrow":
            assert rightmost == pytest.approx(np.full(len(rightmost), 2.4), abs=0.05)
            assert np.ptp(plate[right < right.min() + 1e-6, 2]) == pytest.approx(0.8, abs=0.08)
        assert np.ptp(right) == pytest.approx(0.9, rel=0.02)


def test_clearances_measured(road) -> None:
    parameters, file = road
    geometry = RoadGeometry(parameters)
    for name, item in parameters.of_type(Gantry).items():
        spans = [part for part in parts(named(file, name)) if part.is_a() not in ("IfcColumn", "IfcStair")]
        assert _clearance(geometry, _around(named(file, name), spans)) == pytest.approx(item.clearance, abs=0.005)
        beam = body(named(file, f"{name}/beam"))[0]
        offset = _on_road(geometry, beam)[1]
        assert offset.max() == pytest.approx(item.left_offset, abs=0.05)
        assert offset.min() == pytest.approx(item.right_offset, abs=0.05)
        assert len(spans) == 1 + len(item.signs) + item.catwalk
    for name, item in parameters.of_type(Overpass).items():
        deck = body(named(file, f"{name}/deck"))
        assert _clearance(geometry, deck) == pytest.approx(item.clearance, abs=0.005)
        assert np.ptp(deck[0][:, 2]) == pytest.approx(item.deck_thickness, abs=1e-6)
    assert parameters.of_type(Gantry)
    assert parameters.of_type(Overpass)


def _around(whole: Any, spans: list[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the underside of the box around parts of something, parallel to its axes: 4 vertices, 2 triangles."""
    frame = placement(whole)
    inside = (np.concatenate([body(part)[0] for part in spans]) - frame[:3, 3]) @ frame[:3, :3]
    (x0, y0, z), (x1, y1, _) = inside.min(axis=0), inside.max(axis=0)
    corners = np.array([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])
    return corners @ frame[:3, :3].T + frame[:3, 3], np.array([(0, 1, 2), (0, 2, 3)])


def _clearance(geometry: RoadGeometry, spans: tuple[np.ndarray, np.ndarray]) -> float:
    """Return the height of the lowest vertex above the highest pavement below the triangles."""
    vertices, triangles = spans
    rng = np.random.default_rng(1)
    weights = rng.dirichlet(np.full(3, 0.7), 4000)
    below = np.einsum("pk,tkd->tpd", weights, vertices[triangles]).reshape(-1, 3)
    station, offset = _on_road(geometry, below)
    strips = geometry.strip_index(station, offset)
    paved = (strips >= 0) & np.array([strip.class_name == "road" for strip in geometry.strips])[strips]
    return float(vertices[:, 2].min() - geometry.elevation(station[paved], offset[paved]).max())


def test_every_element_has_a_body(road) -> None:
    parameters, file = road
    bare = {*parameters.of_type(Asset), *parameters.of_type(Vegetation)}
    # Of plants, all of which are made alike, every twentieth.
    plants = file.by_type("IfcGeographicElement")
    left_out = {item.id() for number, item in enumerate(plants) if number % 20}
    for item in file.by_type("IfcElement"):
        if item.id() in left_out:
            continue
        kind = getattr(item, "PredefinedType", None)
        if item.is_a("IfcPavement") or item.Name in bare or kind == "DEFECT":
            continue
        vertices = whole_body(item)
        assert len(vertices) >= 3, item
        assert np.isfinite(vertices).all()


# --- files ----------------------------------------------------------------------------------------------------------


def test_the_same_road_gives_the_same_bytes(tmp_path) -> None:
    parameters = sample_road(scenario(length=120.0), 9)
    first, second, other = (tmp_path / name for name in ("a.ifc", "b.ifc", "c.ifc"))
    for path in (first, second):
        write_ifc(parameters, path)
    write_ifc(sample_road(scenario(length=120.0), 10), other)
    assert first.read_bytes() == second.read_bytes()
    files = [ifcopenshell.open(str(path)) for path in (first, other)]
    ids = [[item.GlobalId for item in file.by_type("IfcRoot")] for file in files]
    assert len(set(ids[0])) == len(ids[0])
    # Roads differ in their identifier, and so their objects in theirs.
    assert not set(ids[0]) & set(ids[1])
    assert "IFC4X3_ADD2" in first.read_text()[:400]


def test_roads_that_no_file_could_hold_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="up to 200 km"):
        write_ifc(_bent([(200_001.0, 0.0, 0.0)]), tmp_path / "twin.ifc")
    with pytest.raises(InputError, match=r"horizontal 1: length is 2.2e-313: .* a micrometre or more"):
        write_ifc(_bent([(20.0, 0.0, 0.0), (2.2e-313, 0.03, 0.0)]), tmp_path / "twin.ifc")
    assert not list(tmp_path.iterdir())


def test_only_with_ifcopenshell(monkeypatch, tmp_path) -> None:
    monkeypatch.setitem(sys.modules, "ifcopenshell", None)
    with pytest.raises(InputError, match=r"synthroads\[twin\]"):
        write_ifc(sample_road(scenario(length=20.0), 1), tmp_path / "twin.ifc")


@pytest.mark.slow
def test_whatever_is_a_road_can_be_written(tmp_path_factory: pytest.TempPathFactory) -> None:
    written_roads = 0

    @settings(max_examples=6, phases=[Phase.generate], deadline=None, suppress_health_check=list(HealthCheck))
    @given(data=road_data(*OBJECTS))
    def check(data: dict[str, Any]) -> None:
        nonlocal written_roads
        axis = data["objects"]["alignment"]
        # A coordinate system that every installation knows, no cliffs, and roads that take no minutes.
        data["metadata"]["referenceSystem"] = "https://www.opengis.net/def/crs/EPSG/0/25832"
        axis["vertical"] = axis["vertical"][:1]
        for element in axis["horizontal"]:
            element["length"] = min(max(element["length"], 1e-3), 40.0)
        for item in data["objects"].values():  # nor forests of a million trees
            if item["type"] == "Vegetation" and item["kind"] != "grass":
                item["density"] = min(item["density"], 1e-3)
            elif item["type"] == "Terrain":
                item["half_width"] = min(item["half_width"], 100.0)
        try:
            parameters = RoadParameters.from_dict(data)
            file = written(parameters, tmp_path_factory.mktemp("any"), 0.5)
        except InputError:
            return
        written_roads += 1
        # Where coordinates are huge strips of grass have no area left.
        _check_instances(file, parameters, "a-Vegetation/")
        assert issues(file) == []

    check()
    assert written_roads >= 3


def test_a_post_that_begins_above_its_beam_is_left_out(tmp_path) -> None:
    data = _bent([(100.0, 0.0, 0.0)]).to_dict()
    data["objects"]["gantry"] = full()["objects"]["gantry"] | {"station": 50.0, "elevation": 25.0}
    file = written(RoadParameters.from_dict(data), tmp_path)
    posts = [item for item in file.by_type("IfcColumn") if item.Name.startswith("gantry/post")]
    assert posts == []
    assert issues(file) == []


def test_a_median_beside_a_single_carriageway_is_named(tmp_path) -> None:
    data = _bent([(100.0, 0.0, 0.0)]).to_dict()
    del data["objects"]["left"]
    file = written(RoadParameters.from_dict(data), tmp_path)
    assert named(file, "median", "IfcRoadPart").PredefinedType == "CENTRALRESERVE"
    assert not [item for item in file.by_type("IfcEarthworksFill") if item.ObjectType == "median"]


def test_roads_shorter_than_a_millimetre_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="a millimetre or more"):
        write_ifc(_bent([(1e-7, 0.0, 0.0)]), tmp_path / "twin.ifc")
