"""Textures that are worked out give what Cycles gives, near and far; those whose last digits are others are refused."""

from __future__ import annotations

from typing import Any

import bpy
import pytest

from tests.helpers.scenes.node_cases import Case, deviations

CLOSEST = 1e-5
OLDER = bpy.app.version < (5, 0, 0)
DIMENSIONS = ("1D", "2D", "3D", "4D")
_PLACE: dict[str, Any] = {"Vector": ("a", None)}
_PLACES: dict[str, Any] = {"Vector": ("a", None), "W": ("a", 0)}


def _outputs(kind: str, **properties: Any) -> list[str]:
    """Return the identifiers of the outputs that a texture has."""
    tree = bpy.data.node_groups.new("Looked at", "ShaderNodeTree")
    node = tree.nodes.new(f"ShaderNodeTex{kind}")
    for name, value in properties.items():
        setattr(node, name, value)
    found = [output.identifier for output in node.outputs if output.enabled]
    bpy.data.node_groups.remove(tree)
    return found


def _checked(cases: dict[str, Case]) -> None:
    assert {name: found for name, found in deviations(cases).items() if found != pytest.approx(0.0, abs=CLOSEST)} == {}


@pytest.mark.parametrize("dimensions", DIMENSIONS)
def test_noise(dimensions: str) -> None:
    cases = {}
    constants = {"Scale": 0.7, "Detail": 2.6, "Roughness": 0.6, "Lacunarity": 2.3, "Offset": 0.4, "Gain": 1.2}
    kinds = ("FBM", "MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN")
    for output in _outputs("Noise"):
        for kind, normalized in [("FBM", True), *((kind, False) for kind in kinds)]:
            settings = {"noise_dimensions": dimensions, "noise_type": kind, "normalize": normalized}
            cases[f"{kind} {normalized} {output}"] = Case("TexNoise", output, _PLACES, constants, settings, "far")
        fed = {**_PLACES, "Detail": ("a", 1), "Roughness": ("b", 1), "Lacunarity": ("c", 1), "Scale": ("c", 2)}
        cases[f"fed {output}"] = Case("TexNoise", output, fed, {}, {"noise_dimensions": dimensions}, "far")
    _checked(cases)


@pytest.mark.parametrize("dimensions", DIMENSIONS)
def test_white_noise(dimensions: str) -> None:
    settings = {"noise_dimensions": dimensions}
    fed = {"Vector": ("a", None), "W": ("b", 0)}
    _checked({output: Case("TexWhiteNoise", output, fed, {}, settings, "extreme") for output in ("Value", "Color")})


@pytest.mark.parametrize("dimensions", DIMENSIONS)
def test_cells(dimensions: str) -> None:
    cases = {}
    constants = {"Scale": 1.3, "Roughness": 0.6, "Lacunarity": 2.2}
    constants |= {"Smoothness": 0.7, "Exponent": 1.5, "Randomness": 0.9}
    for feature in ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS"):
        several = feature in ("F1", "F2", "SMOOTH_F1") and dimensions != "1D"
        if (feature, dimensions) == ("SMOOTH_F1", "4D"):
            several = False  # each looks at 625 cells
        for metric in ("EUCLIDEAN", "MANHATTAN", "CHEBYCHEV", "MINKOWSKI") if several else ("EUCLIDEAN",):
            shape = {"voronoi_dimensions": dimensions, "feature": feature, "distance": metric}
            for output in _outputs("Voronoi", **shape):
                settings = {**shape, "normalize": output == "Distance" and metric != "CHEBYCHEV"}
                own = {**constants, "Detail": 0.0 if metric == "CHEBYCHEV" else 1.5}
                cases[f"{feature} {metric} {output}"] = Case("TexVoronoi", output, _PLACES, own, settings, "far")
    _checked(cases)


def test_squares_and_bricks() -> None:
    fed = {**_PLACE, "Color1": ("b", None)}
    cases = {output: Case("TexChecker", output, fed, {"Scale": 1.7}, {}, "far") for output in _outputs("Checker")}
    settings = {"offset_frequency": 3, "squash_frequency": 2, "squash": 0.7}
    constants = {"Scale": 1.7, "Mortar Smooth": 0.3, "Bias": 0.1}
    for output in _outputs("Brick"):
        cases[f"brick {output}"] = Case("TexBrick", output, fed, constants, settings, "far")
        cases[f"sharp brick {output}"] = Case("TexBrick", output, fed, {"Mortar Smooth": 0.0}, {})
    _checked(cases)


def test_gradients() -> None:
    kinds = ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "SPHERICAL", "QUADRATIC_SPHERE", "RADIAL")
    _checked(
        {
            f"{kind} {output}": Case("TexGradient", output, _PLACE, {}, {"gradient_type": kind})
            for kind in kinds
            for output in _outputs("Gradient")
        }
    )


def _waves() -> dict[str, Case]:
    cases = {}
    for kind, other, settings in (("BANDS", "DIAGONAL", "bands_direction"), ("RINGS", "SPHERICAL", "rings_direction")):
        for direction in ("X", "Y", "Z", other):
            for profile in ("SIN", "SAW", "TRI"):
                own = {"wave_type": kind, settings: direction, "wave_profile": profile}
                values = "far" if profile == "SIN" else "small"
                for output in _outputs("Wave"):
                    name = f"{kind} {direction} {profile} {output}"
                    cases[name] = Case("TexWave", output, _PLACE, {"Scale": 0.9, "Phase Offset": 0.4}, own, values)
    return cases


def _magic() -> dict[str, Case]:
    return {
        f"{depth} {output}": Case("TexMagic", output, _PLACE, {"Scale": 1.4}, {"turbulence_depth": depth})
        for depth in (0, 1, 2, 3, 5, 7, 10)
        for output in _outputs("Magic")
    }


def test_waves_since_5_and_magic_until_then() -> None:
    _checked(_magic() if OLDER else _waves())


def test_what_makes_more_of_the_last_digits_is_left_to_cycles() -> None:
    distorted = {
        "noise": Case("TexNoise", _outputs("Noise")[0], _PLACE, {"Distortion": 0.5}),
        "fed": Case("TexNoise", _outputs("Noise")[0], {**_PLACE, "Distortion": ("b", 0)}),
        "wave": Case("TexWave", "Color", _PLACE, {"Distortion": 1.5}),
    }
    assert deviations(distorted) == {
        "noise": "Noise Texture: Distortion",
        "fed": "Noise Texture: Distortion",
        "wave": "Wave Texture: Distortion",
    }
    others = deviations(_waves() if OLDER else _magic())
    assert set(others.values()) == {"Wave Texture: Distortion" if OLDER else "Magic Texture: Distortion"}
