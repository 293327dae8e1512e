"""Colours, layers and relief in the main job: only what is wanted is rendered, and it agrees with the materials."""

from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from synthroads_addon.base.classes import classes
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.materials.table import materials
from synthroads_addon.scenario.scenario import load_scenario

SMALL = ["fidelity=draft", "road.length=60", "road.half_width=25", "scan.platform.lateral_offsets=[5]"]
SMALL += ["scan.lines_per_second=25", "scan.platform.speed=20", 'outputs=["cloud"]', "scan.noise.range_sigma=0"]
MEANS = "colour.intensity_from_layers=never"
LAYERS = 'cloud.attributes=["roughness","metallic","specular","color_source"]'


def made(folder: Path, *changes: str) -> tuple[dict[str, Any], laspy.LasData]:
    counts = generate(Job(load_scenario("rq31-600m-even", [*SMALL, *changes]), folder))["counts"]
    return counts, laspy.read(folder / "cloud.laz")


def of_class(cloud: laspy.LasData, name: str) -> np.ndarray:
    return np.flatnonzero(np.asarray(cloud["class_id"]) == next(row.id for row in classes() if row.name == name))


def test_without_colours_and_layers_nothing_is_rendered(tmp_path: Path) -> None:
    counts, cloud = made(tmp_path, "colour.rgb=false", MEANS)
    assert counts["rendered"] == {}
    assert not np.asarray(cloud.red).any()


def test_layers_are_rendered_where_a_material_varies_and_else_its_own(tmp_path: Path) -> None:
    """Asphalt varies in roughness and specular, and is no metal anywhere; steel is less of one where it is dirty."""
    counts, cloud = made(tmp_path, "colour.rgb=false", LAYERS, MEANS)
    assert counts["rendered"]["layers"] == ["roughness", "metallic", "specular"]
    road = of_class(cloud, "road")
    assert len(road) > 1000
    row = materials()["asphalt"]
    assert not np.asarray(cloud["metallic"])[road].any()
    for name in ("roughness", "specular"):
        assert np.asarray(cloud[name])[road].std() >= 0.02
    rail = of_class(cloud, "guardrail")
    assert 0.01 < np.asarray(cloud["metallic"])[rail].std() < 0.06
    assert np.mean(np.asarray(cloud["roughness"])[road]) == pytest.approx(row.roughness, abs=0.05)


@pytest.mark.any_blender
def test_what_is_wanted_is_rendered_and_nothing_else(tmp_path: Path) -> None:
    counts, _ = made(tmp_path / "a", "colour.rgb=false", "colour.intensity_from_layers=true")
    assert counts["rendered"]["layers"] == ["base_color", "metallic", "specular"]
    counts, cloud = made(tmp_path / "b", LAYERS)
    # What reaches a point of the sun isn't rendered.
    assert counts["rendered"]["layers"] == ["base_color", "roughness", "metallic", "specular"]
    assert counts["points_by_colour_source"] == {"nodes": 1.0}
    counts, cloud = made(tmp_path / "c", LAYERS, "colour.source=images")
    assert "sun" in counts["rendered"]["layers"]
    assert counts["points_by_colour_source"].get("material", 0.0) < 0.05
    assert sum(counts["points_by_colour_source"].values()) == pytest.approx(1.0, abs=1e-5)
    by_material = np.mean(np.asarray(cloud["color_source"]) == 0)
    assert by_material == pytest.approx(counts["points_by_colour_source"].get("material", 0.0), abs=1e-5)
    road, paint = of_class(cloud, "road"), of_class(cloud, "road_marking")
    assert np.median(np.asarray(cloud.green)[paint]) > 1.3 * np.median(np.asarray(cloud.green)[road])


@pytest.mark.any_blender
def test_intensities_from_layers_are_the_materials_where_these_are_constant(tmp_path: Path) -> None:
    same = ("colour.rgb=false", "scan.relief=0")
    before, constant, patterned = (
        made(tmp_path / name, *same, *changes)[1]
        for name, changes in {
            "plain": (MEANS,),
            "constant": ("colour.intensity_from_layers=true", "colour.source=material"),
            "patterned": ("colour.intensity_from_layers=true",),
        }.items()
    )
    plain = np.asarray(before.intensity, dtype=float)
    assert np.abs(np.asarray(constant.intensity) - plain).max() <= 1.0  # a step of 16 bits
    road = of_class(before, "road")
    rendered = np.asarray(patterned.intensity, dtype=float)[road]
    assert rendered.std() > plain[road].std()
    assert rendered.mean() == pytest.approx(plain[road].mean(), rel=0.05)


@pytest.mark.any_blender
def test_relief_moves_points_to_its_height_and_none_is_none(tmp_path: Path) -> None:
    plain = made(tmp_path / "a", "colour.rgb=false", "scan.relief=0")[1]
    rough = made(tmp_path / "b", "colour.rgb=false", "scan.relief=3")[1]
    height = np.asarray(rough.z) - np.asarray(plain.z)
    road, ground = of_class(plain, "road"), of_class(plain, "ground")
    assert 1e-3 < height[road].std() < 4e-3
    assert height[ground].std() > 5.0 * height[road].std()
    assert abs(height[road].mean()) < 5e-4  # the pavement's own waves are longer than the road
    np.testing.assert_array_equal(np.asarray(rough.intensity), np.asarray(plain.intensity))
