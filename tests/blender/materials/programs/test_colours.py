"""Nodes of colours give what Cycles gives: mixes, ramps, curves, other ways to write a colour."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import pytest

from tests.helpers.scenes.node_cases import Case, deviations

CLOSEST = 1e-5


def _checked(cases: dict[str, Case]) -> None:
    assert {name: found for name, found in deviations(cases).items() if found != pytest.approx(0.0, abs=CLOSEST)} == {}


def test_every_way_to_blend_colours() -> None:
    cases = {}
    kinds = [item.identifier for item in bpy.types.ShaderNodeMix.bl_rna.properties["blend_type"].enum_items]
    fed = {"Factor_Float": ("c", 0), "A_Color": ("a", None), "B_Color": ("b", None)}
    older = {"Fac": ("c", 0), "Color1": ("a", None), "Color2": ("b", None)}
    for kind in kinds:
        settings = {"data_type": "RGBA", "blend_type": kind, "clamp_result": False, "clamp_factor": True}
        cases[kind] = Case("Mix", "Result_Color", fed, {}, settings, "positive")
        cases[f"{kind}, older"] = Case("MixRGB", "Color", older, {}, {"blend_type": kind, "use_clamp": True})
    assert len(kinds) >= 19
    _checked(cases)


def test_mixes_of_numbers_and_vectors() -> None:
    cases = {}
    for clamped in (False, True):
        settings: dict[str, Any] = {"data_type": "FLOAT", "clamp_factor": clamped}
        fed: dict[str, Any] = {"Factor_Float": ("c", 0), "A_Float": ("a", 0), "B_Float": ("b", 0)}
        cases[f"numbers {clamped}"] = Case("Mix", "Result_Float", fed, {}, settings, "extreme")
        settings = {"data_type": "VECTOR", "clamp_factor": clamped}
        fed = {"Factor_Float": ("c", 0), "A_Vector": ("a", None), "B_Vector": ("b", None)}
        cases[f"vectors {clamped}"] = Case("Mix", "Result_Vector", fed, {}, settings, "extreme")
        settings = {**settings, "factor_mode": "NON_UNIFORM"}
        fed = {"Factor_Vector": ("c", None), "A_Vector": ("a", None), "B_Vector": ("b", None)}
        cases[f"by vectors {clamped}"] = Case("Mix", "Result_Vector", fed, {}, settings, "extreme")
    _checked(cases)


def test_colours_in_other_ways_and_changed() -> None:
    cases = {}
    for mode in ("RGB", "HSV", "HSL"):
        for part in ("Red", "Green", "Blue"):
            whole = {"Color": ("a", None)}
            cases[f"{mode} {part}"] = Case("SeparateColor", part, whole, {}, {"mode": mode}, "positive")
        parts = {"Red": ("b", 0), "Green": ("b", 1), "Blue": ("b", 2)}
        cases[mode] = Case("CombineColor", "Color", parts, {}, {"mode": mode})
    color: dict[str, Any] = {"Color": ("a", None)}
    cases["grey"] = Case("RGBToBW", "Val", color, {}, {}, "extreme")
    cases["gamma"] = Case("Gamma", "Color", {**color, "Gamma": ("b", 0)})
    contrast = {**color, "Bright": ("b", 0), "Contrast": ("c", 0)}
    cases["contrast"] = Case("BrightContrast", "Color", contrast, {}, {}, "extreme")
    cases["invert"] = Case("Invert", "Color", {**color, "Fac": ("c", 0)}, {}, {}, "extreme")
    hue = {**color, "Hue": ("b", 0), "Saturation": ("b", 1), "Value": ("c", 0), "Fac": ("c", 1)}
    cases["hue"] = Case("HueSaturation", "Color", hue, {}, {}, "positive")
    _checked(cases)


def _ramp(kind: str, mode: str) -> Callable[[Any], None]:
    def set_up(node: Any) -> None:
        ramp = node.color_ramp
        ramp.color_mode, ramp.interpolation = mode, kind
        for place in (0.27, 0.53):
            ramp.elements.new(place)
        for number, element in enumerate(ramp.elements):
            element.color = tuple((number * step + first) % 1.0 for step, first in _STEPS)

    return set_up


_STEPS = ((0.37, 0.0), (0.61, 0.2), (0.83, 0.1), (0.29, 0.3))


def test_ramps() -> None:
    cases = {}
    for output in ("Color", "Alpha"):
        for kind in ("LINEAR", "CONSTANT", "EASE", "CARDINAL", "B_SPLINE"):
            cases[f"{kind} {output}"] = Case("ValToRGB", output, {"Fac": ("b", 0)}, set_up=_ramp(kind, "RGB"))
        cases[f"HSV {output}"] = Case("ValToRGB", output, {"Fac": ("b", 0)}, set_up=_ramp("LINEAR", "HSV"))
    _checked(cases)


def _curves(extend: str) -> Callable[[Any], None]:
    def set_up(node: Any) -> None:
        mapping = node.mapping
        mapping.extend = extend
        for number, curve in enumerate(mapping.curves):
            curve.points.new(0.3, 0.2 + 0.15 * number)
            curve.points.new(0.7, 0.4 + 0.1 * number)
        mapping.update()

    return set_up


def test_curves() -> None:
    cases = {}
    for extend in ("HORIZONTAL", "EXTRAPOLATED"):
        fed: dict[str, Any] = {"Factor": ("b", 0), "Value": ("a", 0)}
        cases[f"number {extend}"] = Case("FloatCurve", "Value", fed, set_up=_curves(extend))
        fed = {"Fac": ("b", 0), "Color": ("a", None)}
        cases[f"colour {extend}"] = Case("RGBCurve", "Color", fed, set_up=_curves(extend))
        fed = {"Fac": ("b", 0), "Vector": ("a", None)}
        cases[f"vector {extend}"] = Case("VectorCurve", "Vector", fed, set_up=_curves(extend))
    _checked(cases)
