"""How well the segments of an IFC alignment meet, by closed formulas: it shares no code with the writer or a reader."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

from scipy.integrate import quad
from scipy.special import fresnel

Pose = tuple[float, float, float]
"""x and y, m (station and height in the profile), and direction, rad."""


def gaps(file: Any) -> dict[str, float]:
    """Return the largest gap between consecutive segments: in place (m) and in direction (rad), by kind.

    Each segment's end is compared with the next one's start: of the semantic segments (``plan``, ``profile``) and of
    the curves that stand for them (``plan curve``, ``profile curve``). A kink that the file calls one is none.
    """
    found: dict[str, float] = {}
    for name, kind, end in (
        ("plan", "IfcAlignmentHorizontal", _plan_end),
        ("profile", "IfcAlignmentVertical", _profile_end),
    ):
        for layout in file.by_type(kind):
            # The referents are nested in the alignment itself.
            designs = [part.DesignParameters for relation in layout.IsNestedBy for part in relation.RelatedObjects]
            curve = file.by_type("IfcCompositeCurve" if name == "plan" else "IfcGradientCurve", include_subtypes=False)
            segments = curve[0].Segments
            kinks = [segment.Transition == "CONTINUOUS" for segment in segments]
            _note(found, name, designs, end, _plan_start if name == "plan" else _profile_start, kinks)
            _note(found, f"{name} curve", segments, _curve_end, _curve_start, kinks)
    return found


def _note(
    found: dict[str, float],
    name: str,
    items: list[Any],
    end: Callable[[Any], Pose],
    start: Callable[[Any], Pose],
    kinks: list[bool],
) -> None:
    for (before, after), kink in zip(pairwise(items), kinks[:-1], strict=True):
        x, y, direction = end(before)
        there = start(after)
        turn = 0.0 if kink else abs(math.remainder(direction - there[2], 2.0 * math.pi))
        for key, gap in ((f"{name}: place", math.hypot(x - there[0], y - there[1])), (f"{name}: direction", turn)):
            found[key] = max(found.get(key, 0.0), gap)


# --- semantic segments ----------------------------------------------------------------------------------------------


def _plan_start(item: Any) -> Pose:
    return (*item.StartPoint.Coordinates, item.StartDirection)


def _plan_end(item: Any) -> Pose:
    first, last = (1.0 / r if r else 0.0 for r in (item.StartRadiusOfCurvature, item.EndRadiusOfCurvature))
    x, y, turn = _bent(first, last, item.SegmentLength)
    return _moved(_plan_start(item), (x, y, turn))


def _profile_start(item: Any) -> Pose:
    return item.StartDistAlong, item.StartHeight, math.atan(item.StartGradient)


def _profile_end(item: Any) -> Pose:
    rise = item.HorizontalLength * (item.StartGradient + item.EndGradient) / 2.0
    return item.StartDistAlong + item.HorizontalLength, item.StartHeight + rise, math.atan(item.EndGradient)


# --- curves ---------------------------------------------------------------------------------------------------------


def _curve_start(item: Any) -> Pose:
    x, y = item.Placement.RefDirection.DirectionRatios
    return (*item.Placement.Location.Coordinates, math.atan2(y, x))


def _curve_end(item: Any) -> Pose:
    start, length = item.SegmentStart.wrappedValue, item.SegmentLength.wrappedValue
    parent = item.ParentCurve
    if parent.is_a("IfcPolynomialCurve"):
        return _parabola_end(item, length)
    if parent.is_a("IfcLine"):
        first = last = 0.0
    elif parent.is_a("IfcCircle"):
        first = last = math.copysign(1.0 / parent.Radius, length)
    elif parent.is_a("IfcClothoid"):
        rate = 1.0 / (parent.ClothoidConstant * abs(parent.ClothoidConstant))
        first, last = rate * start, rate * (start + length)
    else:
        assert parent.is_a("IfcSecondOrderPolynomialSpiral")
        first = 1.0 / parent.ConstantTerm
        last = first + length / (parent.LinearTerm * abs(parent.LinearTerm))
    return _moved(_curve_start(item), _bent(first, last, abs(length)))


def _parabola_end(item: Any, length: float) -> Pose:
    """Return the end of a piece of a parabola that begins at its parameter 0 and is so long (m) along itself."""
    x, y, direction = _curve_start(item)
    _, grade, bend = item.ParentCurve.CoefficientsY
    assert abs(math.atan(grade) - direction) < 1e-9

    def along(u: float) -> float:
        return math.hypot(1.0, grade + 2.0 * bend * u)

    across = length
    for _ in range(20):
        across -= (quad(along, 0.0, across, epsabs=1e-12)[0] - length) / along(across)
    return x + across, y + across * (grade + bend * across), math.atan(grade + 2.0 * bend * across)


def _moved(start: Pose, by: Pose) -> Pose:
    cosine, sine = math.cos(start[2]), math.sin(start[2])
    return start[0] + cosine * by[0] - sine * by[1], start[1] + sine * by[0] + cosine * by[1], start[2] + by[2]


def _bent(first: float, last: float, length: float) -> Pose:
    """Return the end of a line from the origin along x whose curvature (1/m) goes linearly from first to last."""
    turn = (first + last) / 2.0 * length
    if length == 0.0 or first == last:
        if abs(turn) < 1e-12:
            return length, 0.0, turn
        return math.sin(turn) / first, (1.0 - math.cos(turn)) / first, turn
    rate = (last - first) / length
    scale, sign = math.sqrt(math.pi / abs(rate)), math.copysign(1.0, rate)
    low, high = (k / rate / scale for k in (first, last))
    (sin0, cos0), (sin1, cos1) = fresnel(low), fresnel(high)
    along, across = scale * (cos1 - cos0), sign * scale * (sin1 - sin0)
    back = -(first**2) / (2.0 * rate)
    cosine, sine = math.cos(back), math.sin(back)
    return float(along * cosine - across * sine), float(along * sine + across * cosine), turn
