"""Nodes of numbers and vectors give what Cycles gives, for small, large, whole and no numbers."""

from __future__ import annotations

from typing import Any

import bpy
import pytest

from tests.helpers.scenes.node_cases import Case, deviations

CLOSEST = 1e-5
_NUMBERS = {"Value": ("a", 0), "Value_001": ("b", 0), "Value_002": ("c", 0)}
_VECTORS = {"Vector": ("a", None), "Vector_001": ("b", None), "Vector_002": ("c", None), "Scale": ("c", 0)}
_TO_NUMBERS = ("DOT_PRODUCT", "LENGTH", "DISTANCE")


def _operations(kind: str) -> list[str]:
    return [item.identifier for item in getattr(bpy.types, kind).bl_rna.properties["operation"].enum_items]


def _checked(cases: dict[str, Case], varying: bool = True) -> None:
    found = deviations(cases, varying)
    assert {name: apart for name, apart in found.items() if apart != pytest.approx(0.0, abs=CLOSEST)} == {}


@pytest.mark.parametrize("clamped", [False, True])
def test_every_operation_on_numbers(clamped: bool) -> None:
    properties = {"use_clamp": clamped}
    _checked(
        {
            name: Case("Math", "Value", _NUMBERS, {}, {"operation": name, **properties}, "extreme")
            for name in _operations("ShaderNodeMath")
        },
        varying=not clamped,  # a hyperbolic cosine is 1 then
    )


def test_every_operation_on_vectors() -> None:
    cases = {}
    for name in _operations("ShaderNodeVectorMath"):
        output = "Value" if name in _TO_NUMBERS else "Vector"
        values = "far" if name == "REFRACT" else "extreme"
        cases[name] = Case("VectorMath", output, _VECTORS, {}, {"operation": name}, values)
    _checked(cases)


def test_ranges() -> None:
    cases = {}
    number = {"Value": ("a", 0), "From Min": ("b", 0), "From Max": ("b", 1)}
    number |= {"To Min": ("c", 0), "To Max": ("c", 1), "Steps": ("a", 2)}
    vector = {"Vector": ("a", None), "From_Min_FLOAT3": ("b", None), "From_Max_FLOAT3": ("c", None)}
    vector |= {"To_Min_FLOAT3": ("c", None), "To_Max_FLOAT3": ("a", None), "Steps_FLOAT3": ("b", None)}
    for kind in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"):
        for clamp in (False, True):
            settings = {"interpolation_type": kind, "clamp": clamp}
            cases[f"{kind} {clamp}"] = Case("MapRange", "Result", number, {}, settings, "extreme")
            settings = {"data_type": "FLOAT_VECTOR", **settings}
            cases[f"{kind} {clamp} of vectors"] = Case("MapRange", "Vector", vector, {}, settings, "extreme")
    limits = {"Value": ("a", 0), "Min": ("b", 0), "Max": ("c", 0)}
    for kind in ("MINMAX", "RANGE"):
        cases[kind] = Case("Clamp", "Result", limits, {}, {"clamp_type": kind}, "extreme")
    _checked(cases)


def test_places_are_moved_and_turned() -> None:
    cases = {}
    fed = {"Vector": ("a", None), "Rotation": ("b", None), "Scale": ("c", None)}
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):
        moved = {"Location": ("b", None)} if kind in ("POINT", "TEXTURE") else {}
        cases[kind] = Case("Mapping", "Vector", fed | moved, {}, {"vector_type": kind}, "extreme")
    fed = {"Vector": ("a", None), "Center": ("b", None), "Axis": ("c", None)}
    fed |= {"Angle": ("c", 0), "Rotation": ("c", None)}
    for kind in ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"):
        for back in (False, True):
            settings = {"rotation_type": kind, "invert": back}
            cases[f"{kind} {back}"] = Case("VectorRotate", "Vector", fed, {}, settings, "extreme")
    _checked(cases)


def _tilt(node: Any) -> None:
    node.outputs[0].default_value = (0.3, 0.5, 0.8)


def test_parts_and_directions() -> None:
    cases = {axis: Case("SeparateXYZ", axis, {"Vector": ("a", None)}) for axis in "XYZ"}
    cases["together"] = Case("CombineXYZ", "Vector", {"X": ("a", 0), "Z": ("b", 1)}, {"Y": 0.25})
    cases["along a direction"] = Case("Normal", "Dot", {"Normal": ("a", None)}, set_up=_tilt)
    _checked(cases)
    _checked({"a direction": Case("Normal", "Normal", {"Normal": ("a", None)}, set_up=_tilt)}, varying=False)
