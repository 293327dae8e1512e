"""A road built and scanned by section gives the points of the road built and scanned whole."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.cameras import HAS_RETURN_CAMERA
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things import painted_area
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.jobs.scan.plan import Site
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import Crack, LineMarking
from synthroads_addon.road.surroundings import Vegetation
from synthroads_addon.road.things.concrete_barrier import ConcreteBarrier
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.noise_barrier import NoiseBarrier
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.beam import RINGS
from synthroads_addon.scanning.blocks import Blocks
from synthroads_addon.scanning.colour.colour import FROM_MATERIAL
from synthroads_addon.scanning.colour.difference import cie_lab, ciede2000
from synthroads_addon.scanning.sections import reached_stations, sections
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.scenes.sparse_scanner import sparse_scanner

CUT = 30.0
"""How far (m) from a stretch's ends the model is no longer that of where it is cut."""
OF_THE_FACE = ("incidence", "intensity", "red", "green", "blue")
"""Fields of a point that follow from the slope of the face that the ray met."""
ROUNDED = ("range", "true_range", "X", "Y", "Z", "true_x", "true_y", "true_z")
"""Lengths in steps of the file: of the same edge computed from another face the last may differ."""


def barriers() -> RoadParameters:
    """Return a curved road of 300 m on which everything runs along that there is, none of it at whole stations."""
    limits = {"length": 300.0, "radius": {"minimum": 900.0, "maximum": 1000.0}}
    parameters = sample_road(RoadScenario.from_dict(limits), 4)
    objects: dict[str, Any] = dict(parameters.objects)
    base = {"start_station": 7.31, "end_station": 291.7}
    objects["step"] = ConcreteBarrier(instance=901, offset=-17.0, **base)
    objects["wall"] = NoiseBarrier(instance=902, offset=-21.0, post_spacing=3.7, **base)
    objects["rail"] = Guardrail(instance=903, offset=17.3, faces="both", post_spacing=1.33, **base)
    return parameters.model_copy(update={"objects": objects})


def triangles_within(parameters: RoadParameters, low: float, high: float) -> dict[int, set[bytes]]:
    """Return the triangles of the open scene between two stations, to the bit, by instance."""
    mesh, alignment = scene_mesh(), RoadGeometry(parameters).alignment
    assert np.array_equal(mesh.origin, parameters.transform.translate)
    corners = mesh.vertices[mesh.triangles]
    station = alignment.project(corners.reshape(-1, 3)[:, :2].astype(np.float64))[0].reshape(-1, 3)
    inside = ((station > low) & (station < high)).all(axis=1)
    chosen, instance = corners[inside], mesh.instance_id[inside]
    return {int(i): {corner.tobytes() for corner in chosen[instance == i]} for i in np.unique(instance)}


@pytest.mark.any_blender
def test_a_stretch_has_the_whole_road_s_triangles() -> None:
    parameters, low, high = barriers(), 110.3, 160.9
    build_road(BuildRequest(parameters, 0.02, 0.1))
    whole = triangles_within(parameters, low, high)
    build_road(BuildRequest(parameters, 0.02, 0.1, stretch=(low - CUT, high + CUT)))
    part = triangles_within(parameters, low, high)
    numbers = RoadGeometry(parameters).numbers
    there = {type(parameters.objects[str(numbers.owner(number))]) for number in whole}
    assert there >= {Guardrail, ConcreteBarrier, NoiseBarrier, LineMarking, Vegetation}
    different = {i: len(whole[i] ^ part.get(i, set())) for i in whole if whole[i] != part.get(i)}
    assert not different, f"triangles that differ, by instance: {different}"
    assert whole.keys() == part.keys()


def job(folder: Path, section: float, **changes: Any) -> Scenario:
    data: dict[str, Any] = {
        "type": "Scenario", "version": "1.0", "seed": 4, "fidelity": "draft",
        "road": {"length": 170.0, "vehicles": {"per_km": {"minimum": 25.0, "maximum": 25.0}}},
        "scan": {
            "device": sparse_scanner(folder, kilohertz=20.0), "rays_per_pulse": 7, "section_length": section,
            "platform": {"speed": 30.0},
            "noise": {"dropout": 0.02, "position_sigma": 0.01, "angle_sigma_mrad": 0.1},
        },
        "cloud": {"attributes": ["range", "incidence", "noise_free", "material"]},
        "colour": {"source": "material"},
        "outputs": ["cloud"],
    }  # fmt: skip
    for name, value in changes.items():
        data["scan"][name] = value
    return Scenario.from_dict(data)


def cloud_of(folder: Path, scenario: Scenario) -> tuple[dict[str, Any], Any]:
    """Return the report of a job and its points in the order of time."""
    report = generate(Job(scenario, folder, new_file=True))
    cloud = laspy.read(folder / "cloud.laz")
    points = cloud.points.array
    return report, points[np.lexsort((points["point_source_id"], cloud.return_number, points["gps_time"]))]


@pytest.mark.slow
@pytest.mark.any_blender
@pytest.mark.parametrize("traffic", [0.0])
def test_the_points_don_t_depend_on_the_sections(tmp_path: Path, traffic: float) -> None:
    """Where points are and what of is the same; of two faces whose edge a ray meets either may be the one.

    Which one depends on the order of the caster's tree, and so on what else is built. The range is that of both.
    """
    whole, wanted = cloud_of(tmp_path / "whole", job(tmp_path, 100.0, traffic_speed_factor=traffic))
    report, found = cloud_of(tmp_path / "cut", job(tmp_path, 57.0, traffic_speed_factor=traffic))
    assert "sections" not in whole["counts"]
    assert report["counts"]["sections"] == 3
    assert report["counts"]["triangles"] < whole["counts"]["triangles"]
    assert len(wanted) > 13_000
    for name in set(wanted.dtype.names) - {"material", *OF_THE_FACE, *ROUNDED}:
        np.testing.assert_array_equal(found[name], wanted[name], err_msg=name)
    for name in ROUNDED:
        assert np.abs(found[name].astype(np.int64) - wanted[name]).max() <= 1, name
    on_other_faces = np.any([found[name] != wanted[name] for name in (*OF_THE_FACE, *ROUNDED)], axis=0)
    assert on_other_faces.sum() <= 1e-4 * len(wanted)
    same = ("pulses", "rays", "points", "below_threshold", "saturated", "points_by_class", "intensity_scale")
    assert {name: report["counts"][name] for name in same} == {name: whole["counts"][name] for name in same}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "median", "most", "share", "layers"),
    [
        # Images stand elsewhere along a section's part of the path: both clouds err, as docs/tradeoff.md measures.
        ("images", 1.0, 9.0, 0.95, 300),
        ("nodes", 1e-6, 0.01, 1.0, 0),
        pytest.param(
            # Positions of 32 bits in another section's frame: a pixel at a material's border may be beyond it.
            *("returns", 0.01, 0.1, 0.999, 2),
            marks=pytest.mark.skipif(not HAS_RETURN_CAMERA, reason="needs Blender 5"),
        ),
    ],
)
def test_rendered_colours_don_t_depend_on_the_sections(
    tmp_path: Path, source: str, median: float, most: float, share: float, layers: int
) -> None:
    """Colours (CIEDE2000), and layers (1e-4) of a share of the places, differ by no more than their source errs by."""
    clouds = []
    for section in (100.0, 57.0):
        data = job(tmp_path, section, traffic_speed_factor=0.0).to_dict()
        data["colour"] = {"source": source, "ground_sampling_distance": 0.25}
        data["cloud"]["attributes"] = ["roughness", "specular", "color_source"]
        clouds.append(cloud_of(tmp_path / str(section), Scenario.from_dict(data))[1])
    whole, cut = clouds
    for name in ("X", "Y", "Z"):
        np.testing.assert_array_equal(cut[name], whole[name], err_msg=name)
    for name in ("roughness", "specular"):
        off = np.abs(cut[name].astype(np.int64) - whole[name])
        assert np.quantile(off, share) <= layers
    seen = [np.mean(points["color_source"] != FROM_MATERIAL) for points in clouds]
    assert min(seen) > 0.9
    assert seen[1] == pytest.approx(seen[0], abs=0.01)
    rgb = [cie_lab(np.stack([points[name] for name in ("red", "green", "blue")], axis=1)) for points in clouds]
    apart = ciede2000(*rgb)
    assert np.median(apart) < median
    assert np.quantile(apart, 0.95) < most
    assert rgb[0][:, 0].std() > 5.0  # colours that differ


def test_only_the_whole_model_can_be_saved(tmp_path: Path) -> None:
    scenario = job(tmp_path, 57.0).model_copy(update={"outputs": ("scene", "cloud")})
    with pytest.raises(InputError, match=r"outputs is .* scan.section_length to 85 or more"):
        generate(Job(scenario, tmp_path / "out", new_file=True))
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


@pytest.mark.any_blender
@pytest.mark.parametrize(
    ("kind", "pitch", "beyond"), [("uav", 0.0, 40.0), ("uav", 30.0, 90.0), ("vehicle", 0.0, 600.0)]
)
def test_as_much_is_built_as_the_rays_reach(tmp_path: Path, kind: str, pitch: float, beyond: float) -> None:
    """All pulses of a section end between its stations, and not much more of the road is built."""
    scenario = job(tmp_path, 300.0, platform={"kind": kind, "pitch_deg": pitch, "speed": 40.0})
    geometry = RoadGeometry(sample_road(RoadScenario(length=1800.0), 4))
    path = Site.of_road(scenario, geometry, ScenarioInputs.read(scenario)).path
    cut = Blocks(scanner_setting(scenario.scan), path, len(RINGS[7]))
    parts = list(sections(cut, geometry, 300.0))
    assert [part.start for part in parts] == [300.0 * i for i in range(6)]
    assert sorted((s.index, b) for part in parts for s, b in part.blocks) == [(s.index, b) for s, b in cut.all()]
    for part in parts:
        low, high = reached_stations(cut, geometry, list(part.blocks))
        assert part.build_start <= max(low - 20.0, 0.0)
        assert part.build_end >= min(high + 20.0, geometry.length)
        assert part.start - part.build_start < 60.0 + beyond + 25.0
    tilted = parts[4].start - parts[4].build_start
    if pitch:
        assert tilted > 60.0 * np.tan(np.deg2rad(pitch))


@pytest.mark.any_blender
def test_only_damages_of_the_stretch_are_worked_out(monkeypatch: pytest.MonkeyPatch) -> None:
    parameters, low, high = sample_road(RoadScenario(length=600.0), 4), 250.0, 300.0
    stations: list[float] = []
    make = painted_area.crack_outlines

    def crack_outlines(crack: Crack) -> Iterator[Any]:
        stations.extend(station for line in crack.lines for station, _ in line)
        return make(crack)

    monkeypatch.setattr(painted_area, "crack_outlines", crack_outlines)
    build_road(BuildRequest(parameters, 0.02, 0.0, parts=("damaged_areas",), stretch=(low, high)))
    longest = 20.0
    assert stations
    assert min(stations) > low - longest
    assert max(stations) < high + longest
