"""Numerical extremes that no other test covers; docs/extremes.md lists them all, and is held to what it says."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import Model, read_json, read_yaml
from synthroads_addon.cloud.formats.las import LasWriter
from synthroads_addon.dataset.recipe import RECIPES, load_recipe, scene_jobs
from synthroads_addon.materials.table import MaterialTable
from synthroads_addon.road.alignment import Alignment, Element, clip_offset
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import LineMarking
from synthroads_addon.road.stretches import stretches
from synthroads_addon.road.tessellation import sample_stations
from synthroads_addon.road.things.sign_catalogue import SignCatalogue
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.devices.device import DEVICES, Device
from synthroads_addon.scenario.assets import LIBRARIES, AssetLibrary
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import SCENARIOS, Scenario
from tests.helpers.roads.checker_full_road import full
from tests.helpers.scenes.scan_scenes import ORIGIN, altered, mesh_of, middle_pulses, plane, scan_of

ROOT = Path(__file__).parents[2]
PRESETS = ROOT / "synthroads_addon" / "presets"


# --- the alignment -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("radius", [280.0, 900.0, 1e5, 1e8, 1e12, math.inf])
def test_a_circle_of_any_radius_is_met_up_to_the_straight_line(radius: float) -> None:
    """The sagitta s^2 / 2 R by its series, which holds where R - R cos(s / R) has no digits left."""
    k = 1.0 / radius
    s = np.linspace(0.0, 400.0, 41)
    x, y = Alignment([Element(400.0, k, k)]).position(s).T
    series = sum((-1) ** n * k ** (2 * n + 1) * s ** (2 * n + 2) / math.factorial(2 * n + 2) for n in range(8))
    np.testing.assert_allclose(y, series, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(x, s if radius == math.inf else radius * np.sin(s / radius), atol=1e-6)
    assert np.isfinite(Alignment([Element(400.0, k, 0.0)]).position(s)).all()


def test_an_offset_curve_that_folds_is_cut_and_does_not_cross_the_centre() -> None:
    axis = Alignment([Element(200.0, 1 / 50, 1 / 50)])
    position, heading, curvature = axis.frame(np.linspace(0.0, 200.0, 201))
    normal = np.stack([-np.sin(heading), np.cos(heading)], axis=1)

    def along(offset: Any) -> np.ndarray:
        steps = np.diff(position + np.asarray(offset)[:, None] * normal, axis=0)
        return (steps * np.stack([np.cos(heading), np.sin(heading)], axis=1)[:-1]).sum(axis=1)

    assert along(np.full(201, 60.0)).max() < 0.0  # beyond the centre it runs backwards
    assert along(clip_offset(np.full(201, 60.0), curvature)).min() > 0.0


# --- stations ------------------------------------------------------------------------------------------------------


def test_stations_are_multiples_of_their_step_and_never_sums() -> None:
    """Dashes of 1.1 m and 0.7 m, which no binary number is, along 100 km."""
    data = full()
    data["objects"]["axis"]["horizontal"] = [
        {"kind": "line", "length": 100_000.0, "curvature_start": 0.0, "curvature_end": 0.0}
    ]
    geometry = RoadGeometry(RoadParameters.from_dict(data))
    line = next(iter(geometry.parameters.of_type(LineMarking).values()))
    line = line.model_copy(update={"start_station": 0.0, "end_station": 1e5, "dash_length": 1.1, "gap_length": 0.7})
    starts = geometry.dashes(line)[:, 0]
    assert len(starts) == 55_556
    period = 1.1 + 0.7
    assert np.abs(starts - np.arange(len(starts)) * period).max() == 0.0
    assert np.abs(np.cumsum(np.full(len(starts), period)) - period - starts).max() > 1e-8  # what it is there for


@pytest.mark.parametrize("length", [1.0, 100_000.0])
def test_a_road_of_a_metre_and_one_of_a_hundred_kilometres(length: float) -> None:
    geometry = RoadGeometry(sample_road(RoadScenario(length=length), 2))
    assert geometry.length == pytest.approx(length, abs=1e-6)
    stations = sample_stations(geometry, 0.005, max(0.0, length - 300.0))
    assert stations[-1] == pytest.approx(length, abs=1e-6)
    assert np.isfinite(geometry.offsets(stations)).all()
    parts = stretches(length)
    assert parts[0][0] == 0.0
    assert parts[-1][1] == length


# --- the scanner ---------------------------------------------------------------------------------------------------


def test_map_coordinates_of_5600_km_are_exact_to_a_tenth_of_a_millimetre_at_any_station() -> None:
    """Float32 has steps of half a metre there: the scene is local, the sum with its origin is not."""
    rng = np.random.default_rng(1)
    parameters = sample_road(RoadScenario(length=5000.0), 3)
    geometry = RoadGeometry(parameters)
    station = np.sort(rng.uniform(0.0, geometry.length, 2000))
    local = geometry.point(station, rng.uniform(-10.0, 10.0, 2000))
    on_map = local + np.array(parameters.transform.translate)
    assert on_map[:, 1].min() > 5.6e6
    again, _ = geometry.alignment.project(on_map[:, :2] - np.array(parameters.transform.translate)[:2])
    assert np.abs(again - station).max() < 1e-4
    assert np.abs(on_map.astype(np.float32) - on_map).max() > 0.1  # what it is there for


@pytest.mark.parametrize("distance", [1e-3, 1.0, 60.0, 1000.0])
def test_a_surface_on_edge_gives_no_point_and_one_nearly_so_a_finite_one(distance: float) -> None:
    """A wall that the beam runs along, at any distance beside it."""
    wall = mesh_of([(0, -distance, -900), (0, distance, -900), (0, 0, 900)], [(0, 1, 2)])
    with np.errstate(invalid="raise", divide="raise"):
        points = middle_pulses(scan_of(wall, 7, minimum_range=0.0), 20).points
    assert np.isfinite(points.xyz).all()
    assert (points.intensity >= 0.0).all()
    assert (points.incidence_deg <= 90.0).all()


def test_denormal_intensities_are_zero_and_no_point() -> None:
    """exp(-0.2 d) is a denormal number from 3.5 km on and nothing from 3.8 km: neither traps nor slows down."""
    scan = altered(scan_of(plane(20_000.0)), attenuation=12.0)
    with np.errstate(all="raise", under="ignore"):
        points = middle_pulses(altered(scan, setting=replace(scan.setting, threshold=1e-300)), 50).points
    assert len(points) == 0


# --- LAS -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("north", [0.0, 5.6e6, -1e7])
def test_the_offset_in_las_is_chosen_near_the_points(tmp_path: Path, points: Any, north: float) -> None:
    """Integers of 32 bits in millimetres reach 2147 km, so far from the offset and not from the map's origin."""
    place = np.array([294_000.7, north + 0.3, 180.2])
    moved = replace(points, xyz=points.xyz - ORIGIN + place)
    with LasWriter(tmp_path / "cloud.laz", None, place, 1.0) as writer:
        writer.write(moved)
    read = laspy.read(tmp_path / "cloud.laz")
    assert np.abs(read.header.offsets - np.floor(place)).max() == 0.0
    assert max(np.abs(np.asarray(read[axis])).max() for axis in "XYZ") < 1e6
    assert np.abs(read.xyz - moved.xyz).max() <= 0.0005 + 1e-9


# --- NaN in any input ----------------------------------------------------------------------------------------------


def documents() -> Iterator[tuple[str, Any, type[Model]]]:
    """Yield name, content and class of a valid file of each kind, with as many fields as possible."""
    yield "road", full(), RoadParameters
    yield "scenario", Scenario().to_dict(), Scenario
    for path in sorted(SCENARIOS.glob("*.json")):
        yield path.stem, read_json(path), Scenario
    for path in sorted(DEVICES.glob("*.json")):
        yield path.stem, read_json(path), Device
    yield "materials", read_json(PRESETS / "materials.json"), MaterialTable
    yield "signs", read_json(PRESETS / "signs.json"), SignCatalogue
    for path in sorted(LIBRARIES.glob("*/library.json")):
        yield path.parent.name, read_json(path), AssetLibrary


def numbers(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the paths of all numbers in JSON data."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from numbers(item, (*path, key))
    elif isinstance(value, list):
        for place, item in enumerate(value):
            yield from numbers(item, (*path, place))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def with_number(data: Any, path: tuple[Any, ...], number: float) -> Any:
    if not path:
        return number
    copy = dict(data) if isinstance(data, dict) else list(data)
    copy[path[0]] = with_number(copy[path[0]], path[1:], number)
    return copy


def kind_of(data: Any, path: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return a path without the numbers of entries and the ids of objects, which have their types instead."""
    kinds: list[Any] = []
    for key in path:
        data = data[key]
        named = data.get("type") if isinstance(data, dict) else None
        kinds.append(named or (None if isinstance(key, int) else key))
    return tuple(kinds)


@pytest.mark.parametrize(
    ("name", "data", "kind"), list(documents()), ids=lambda value: value if isinstance(value, str) else ""
)
def test_nan_and_infinity_are_refused_by_name_in_every_number(name: str, data: Any, kind: type[Model]) -> None:
    kind.from_dict(data)
    seen: set[tuple[Any, ...]] = set()
    for place, path in enumerate(numbers(data)):
        if kind_of(data, path) in seen:
            continue
        seen.add(kind_of(data, path))
        number = (math.nan, math.inf, -math.inf)[place % 3]
        with pytest.raises(InputError) as caught:
            kind.from_dict(with_number(data, path, number))
        told = f"{'.'.join(map(str, path))} is {number}: must be a"
        assert any(f"{told} {kind} number" in str(caught.value) for kind in ("finite", "whole")), caught.value
    assert seen, f"{name} has no numbers"


def test_nan_in_a_recipe_s_changes_is_refused_by_name(tmp_path: Path) -> None:
    data = read_yaml(RECIPES / "small-roads.yaml")
    path = tmp_path / "recipe.yaml"
    for text in (".nan", ".inf", "-.inf"):
        path.write_text(f"title: x\nset: {{road.length: {text}}}\ngroups: [{{name: a, scenes: 1}}]\n")
        with pytest.raises(InputError, match=r"recipe\.yaml"):
            load_recipe(str(path))
    assert scene_jobs(load_recipe("small-roads"))[0].scenario.road.length == data["set"].get("road.length", 600.0)


# --- the table -----------------------------------------------------------------------------------------------------

_TEST = re.compile(r"`(tests/[\w/]+\.py)((?:::\w+)+)`")


def test_the_table_of_extremes_names_tests_that_exist() -> None:
    text = (ROOT / "docs" / "extremes.md").read_text(encoding="utf-8")
    rows = [row for row in text.splitlines() if row.startswith("| ") and not row.startswith(("| extreme", "| fault"))]
    assert len(rows) >= 30
    for row in rows:
        named = _TEST.findall(row.rsplit("|", 2)[1])
        assert named, f"no test: {row}"
        for file, names in named:
            source = (ROOT / file).read_text(encoding="utf-8")
            for part in names.split("::")[1:]:
                assert re.search(rf"^\s*(def|class) {part}\b", source, re.MULTILINE), f"{file} has no {part}"
        assert row.count("tests/") == len(named), f"a test is not named as FILE::NAME: {row}"
