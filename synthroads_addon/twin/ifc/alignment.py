"""The centreline in IFC 4.3: semantic segments and the curves that they mean, both from one table.

The plan is an IfcCompositeCurve of lines, arcs and clothoids, the profile an IfcGradientCurve over it of constant
grades and parabolas. Distances along are stations: horizontal lengths.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...road.alignment import Alignment
from ...road.geometry import RoadGeometry
from ...road.profile import Profile
from ...road.section import Carriageway
from .entities import Entity, Float, IfcFile, rounded

_HORIZONTAL = {"line": "LINE", "arc": "CIRCULARARC", "clothoid": "CLOTHOID"}
_SHORTEST = 1e-6
"""Pieces of the profile up to this length (m) are left out: roundings that touch."""
_SAME_GRADE = 1e-9
_STRAIGHT = 1e-300
"""Curvature (1/m) that is none: no file holds its radius as a number."""
_FAR_OUT = 1.0
"""A clothoid that begins where its spiral has turned by more than this (rad) is written with its curvature at the start
instead of as a piece of the spiral: readers integrate from the spiral's middle, and from 2 rad on they are millimetres
to kilometres off. The guidelines' clothoids (A up to R) begin within 0.5 rad."""
_NO_QUADRATIC = 1e9
"""Quadratic term (m) of a spiral that has none: over 1 km it turns by less than 1e-18 rad."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class PlanSegment:
    """One segment of the horizontal alignment: line, circular arc or clothoid.

    Attributes:
        kind: ``LINE``, ``CIRCULARARC``, ``CLOTHOID``.
        x, y: start, local, m.
        heading: at the start, rad.
        length: m.
        start_curvature, end_curvature: 1/m, positive to the left.
    """

    kind: str
    x: float
    y: float
    heading: float
    length: float
    start_curvature: float
    end_curvature: float


@dataclass(frozen=True)
class ProfileSegment:
    """One segment of the profile: ``height`` + u (``grade`` + u ``curvature`` / 2), u from 0 to ``length`` (m)."""

    station: float
    length: float
    height: float
    grade: float
    curvature: float


@dataclass(frozen=True)
class Axis:
    """The centreline in the IFC file: the IfcAlignment and its plan curve.

    Attributes:
        alignment: the IfcAlignment.
        plan: its IfcCompositeCurve: what distances along are measured on.
    """

    alignment: Entity
    plan: Entity


def plan_segments(alignment: Alignment) -> list[PlanSegment]:
    """Return the horizontal alignment's segments; a clothoid too flat for readers of IFC is an arc or a line."""
    starts = alignment.element_starts[:-1]
    position, heading, _ = alignment.frame(starts)
    segments = []
    for element, (x, y), angle in zip(alignment.elements, position.tolist(), heading.tolist(), strict=True):
        kind, mean_curvature = element.kind, element.mean_curvature
        start_curvature, end_curvature = (
            (element.curvature_start, element.curvature_end) if kind == "clothoid" else (mean_curvature, mean_curvature)
        )
        start_curvature, end_curvature = (
            0.0 if kind == "line" or abs(k) < _STRAIGHT else k for k in (start_curvature, end_curvature)
        )
        name = _HORIZONTAL[kind] if start_curvature or end_curvature else "LINE"
        segments.append(PlanSegment(name, x, y, angle, element.length, start_curvature, end_curvature))
    return segments


def profile_segments(profile: Profile, length: float) -> list[ProfileSegment]:
    """Return the profile's segments of constant curvature from station 0 to the road's length."""
    inner_breakpoints = profile.breakpoints[
        (profile.breakpoints > _SHORTEST) & (profile.breakpoints < length - _SHORTEST)
    ]
    stations = np.concatenate([[0.0], inner_breakpoints, [length]])
    keep_mask = np.append(np.diff(stations) > _SHORTEST, True)
    stations = stations[keep_mask]
    middle = (stations[:-1] + stations[1:]) / 2.0
    half_length, curvature = np.diff(stations) / 2.0, np.asarray(profile.curvature(middle))
    grade = profile.grade(middle) - curvature * half_length
    height = profile.elevation(middle) - half_length * (grade + 0.5 * curvature * half_length)
    rows = np.column_stack([stations[:-1], 2.0 * half_length, height, grade, curvature]).tolist()
    return [ProfileSegment(*row) for row in rows]


def write_alignment(ifc: IfcFile, geometry: RoadGeometry) -> Axis:
    """Add the IfcAlignment with its layouts, curves and referents to the file; return it with its plan curve."""
    name, item = next((n, o) for n, o in geometry.parameters.objects.items() if o is geometry.parameters.alignment)
    horizontal, vertical = _Plan(ifc, name), _Profile(ifc, name)
    plan_curve = horizontal.write(geometry.alignment)
    gradient_curve = vertical.write(geometry.profile, geometry.length, plan_curve)
    shapes = [
        ifc.add("IfcShapeRepresentation", ifc.contexts["Axis"], "FootPrint", "Curve2D", [plan_curve]),
        ifc.add("IfcShapeRepresentation", ifc.contexts["Axis"], "Axis", "Curve3D", [gradient_curve]),
    ]
    alignment = ifc.add_root(
        "IfcAlignment",
        name,
        Name=name,
        ObjectPlacement=ifc.local_frame,
        Representation=ifc.add("IfcProductDefinitionShape", None, None, shapes),
    )
    ifc.note_relation("IfcRelAggregates", ifc.project, [alignment])
    ifc.note_relation("IfcRelNests", alignment, [horizontal.layout, vertical.layout])
    values = {key: value for key, value in ifc.parameters_of(item).items() if key not in ("horizontal", "vertical")}
    ifc.add_properties(alignment, "SynthRoads", values | {"length": ifc.value(geometry.length, "m")})
    axis = Axis(alignment, plan_curve)
    _write_referents(ifc, geometry, axis)
    return axis


class _Layout:
    """Base of horizontal and vertical layout: segments with their curves, the last of length 0 as IFC demands."""

    entity: str

    def __init__(self, ifc: IfcFile, name: str) -> None:
        self.ifc, self.name = ifc, name
        self.layout = ifc.add_root(self.entity, name)
        self.line = ifc.add(
            "IfcLine",
            ifc.point(0.0, 0.0),
            ifc.add("IfcVector", ifc.direction(1.0, 0.0), 1.0),
        )
        self.curves: list[Entity] = []

    def segment(self, number: int, design: Entity, curve: Entity) -> None:
        """Add an IfcAlignmentSegment with its design parameters and keep its curve for the composite curve."""
        key = f"{self.name}/{number}"
        entity = self.ifc.add_root("IfcAlignmentSegment", f"{self.entity}/{key}", Name=key, DesignParameters=design)
        self.ifc.note_relation("IfcRelNests", self.layout, [entity])
        self.curves.append(curve)

    def curve(self, placement: Entity, parent: tuple[Entity, float, float], transition: str) -> Entity:
        """Add an IfcCurveSegment: a piece (curve, start, length) of a parent curve, moved to a placement."""
        curve, start, length = parent
        return self.ifc.add(
            "IfcCurveSegment",
            Transition=transition,
            Placement=placement,
            SegmentStart=self.ifc.length_measure(start),
            SegmentLength=self.ifc.length_measure(length),
            ParentCurve=curve,
        )


class _Plan(_Layout):
    """Writer of the horizontal layout: lines, circular arcs and clothoids."""

    entity = "IfcAlignmentHorizontal"

    def write(self, alignment: Alignment) -> Entity:
        """Add all horizontal segments; return the IfcCompositeCurve."""
        segments = plan_segments(alignment)
        end, heading, _ = alignment.frame(np.array([alignment.length]))
        x, y = end[0].tolist()
        segments.append(PlanSegment("LINE", x, y, float(heading[0]), 0.0, 0.0, 0.0))
        for number, segment in enumerate(segments):
            self._write(number, segment, _plan_transition(*segments[number : number + 2]))
        return self.ifc.add("IfcCompositeCurve", self.curves, False)

    def _write(self, number: int, segment: PlanSegment, transition: str) -> None:
        """Add a horizontal segment: its design parameters and its piece of a line, circle or spiral."""
        ifc = self.ifc
        angle = rounded(math.remainder(segment.heading, 2.0 * math.pi), 12)
        radii = [1.0 / k if k else 0.0 for k in (segment.start_curvature, segment.end_curvature)]
        start = ifc.add("IfcCartesianPoint", rounded([segment.x, segment.y], 9))
        design = ifc.add(
            "IfcAlignmentHorizontalSegment",
            StartPoint=start,
            StartDirection=angle,
            StartRadiusOfCurvature=radii[0],
            EndRadiusOfCurvature=radii[1],
            SegmentLength=segment.length,
            PredefinedType=segment.kind,
        )
        placement = ifc.add("IfcAxis2Placement2D", start, ifc.heading(angle))
        self.segment(number, design, self.curve(placement, self._parent(segment), transition))

    def _parent(self, segment: PlanSegment) -> tuple[Entity, float, float]:
        """Return a segment's parent curve, and the start and length of the piece along it, m."""
        ifc, start_curvature, length = self.ifc, segment.start_curvature, segment.length
        if segment.kind == "LINE":
            return self.line, 0.0, length
        axes = ifc.axes_2d(0.0, 0.0, 0.0)
        if segment.kind == "CIRCULARARC":
            return ifc.add("IfcCircle", axes, 1.0 / abs(start_curvature)), 0.0, math.copysign(length, start_curvature)
        # IfcClothoid: curvature k(s) = s / (A |A|) at arc length s from the point of curvature 0. So |A| is the root of
        # length over change of curvature, and the piece starts where the spiral's curvature is the segment's first.
        curvature_change = segment.end_curvature - start_curvature
        clothoid_constant = math.copysign(math.sqrt(length / abs(curvature_change)), curvature_change)
        start_along_spiral = start_curvature * length / curvature_change
        if abs(start_curvature * start_along_spiral) / 2.0 > _FAR_OUT:
            return (
                ifc.add(
                    "IfcSecondOrderPolynomialSpiral", axes, _NO_QUADRATIC, clothoid_constant, 1.0 / start_curvature
                ),
                0.0,
                length,
            )
        return ifc.add("IfcClothoid", axes, clothoid_constant), start_along_spiral, length


class _Profile(_Layout):
    """Writer of the vertical layout: constant grades and parabolas."""

    entity = "IfcAlignmentVertical"

    def write(self, profile: Profile, length: float, plan: Entity) -> Entity:
        """Add all vertical segments; return the IfcGradientCurve over the plan curve."""
        segments = profile_segments(profile, length)
        last_segment = segments[-1]
        grade = last_segment.grade + last_segment.curvature * last_segment.length
        height = last_segment.height + last_segment.length * (
            last_segment.grade + 0.5 * last_segment.curvature * last_segment.length
        )
        segments.append(ProfileSegment(length, 0.0, height, grade, 0.0))
        for number, segment in enumerate(segments):
            self._write(number, segment, _profile_transition(*segments[number : number + 2]))
        return self.ifc.add("IfcGradientCurve", self.curves, False, plan, None)

    def _write(self, number: int, segment: ProfileSegment, transition: str) -> None:
        """Add a vertical segment: its design parameters and its piece of a line or parabola over the plan."""
        ifc, curvature, grade, length = self.ifc, segment.curvature, segment.grade, segment.length
        design = ifc.add(
            "IfcAlignmentVerticalSegment",
            StartDistAlong=segment.station,
            HorizontalLength=length,
            StartHeight=rounded(segment.height, 9),
            StartGradient=grade,
            EndGradient=grade + curvature * length,
            RadiusOfCurvature=1.0 / curvature if curvature else None,
            PredefinedType="PARABOLICARC" if curvature else "CONSTANTGRADIENT",
        )
        start = ifc.add("IfcCartesianPoint", rounded([segment.station, segment.height], 9))
        slope = ifc.direction(1.0 / math.hypot(1.0, grade), grade / math.hypot(1.0, grade))
        placement = ifc.add("IfcAxis2Placement2D", start, slope)
        slope_length = _slope_length(grade, curvature, length)
        parent = self.line
        if curvature:
            parent = ifc.add(
                "IfcPolynomialCurve",
                Position=ifc.axes_2d(0.0, 0.0, 0.0),
                CoefficientsX=[0.0, 1.0],
                CoefficientsY=[rounded(segment.height, 9), grade, curvature / 2.0],
            )
        self.segment(number, design, self.curve(placement, (parent, 0.0, slope_length), transition))


def _plan_transition(segment: PlanSegment, next_segment: PlanSegment | None = None) -> str:
    """Return the IfcTransitionCode from a plan segment to the next; DISCONTINUOUS if there is none."""
    if next_segment is None:
        return "DISCONTINUOUS"
    same_curvature = segment.end_curvature == next_segment.start_curvature
    return "CONTSAMEGRADIENTSAMECURVATURE" if same_curvature else "CONTSAMEGRADIENT"


def _profile_transition(segment: ProfileSegment, next_segment: ProfileSegment | None = None) -> str:
    """Return the IfcTransitionCode from a profile segment to the next; CONTINUOUS where the grade jumps."""
    if next_segment is None:
        return "DISCONTINUOUS"
    grade = segment.grade + segment.curvature * segment.length
    if abs(grade - next_segment.grade) > _SAME_GRADE:
        return "CONTINUOUS"
    return "CONTSAMEGRADIENTSAMECURVATURE" if segment.curvature == next_segment.curvature else "CONTSAMEGRADIENT"


def _slope_length(grade: float, curvature: float, length: float) -> float:
    """Return the arc length of a parabola or grade over a horizontal length, m, by Gauss-Legendre quadrature."""
    distances = (_NODES + 1.0) / 2.0 * length
    return float(np.sqrt(1.0 + (grade + curvature * distances) ** 2) @ _WEIGHTS * length / 2.0)


# --- referents ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Referent:
    """A point of the alignment with properties: its station (m), name, predefined type, and one property set."""

    station: float
    name: str
    kind: str
    properties: str
    values: Mapping[str, Any]


def _write_referents(ifc: IfcFile, geometry: RoadGeometry, axis: Axis) -> None:
    """Nest IfcReferents in the alignment by station: its start, crossfall points and width changes."""
    stationing = geometry.parameters.alignment
    start_values = {"Station": ifc.add("IfcLengthMeasure", rounded(stationing.counted(0.0)))}
    referents = [_Referent(0.0, "station-0", "STATION", "Pset_Stationing", start_values)]
    for number, equation in enumerate(stationing.equations):
        incoming = stationing.counted(float(np.nextafter(equation.station, -np.inf)))
        values = {"IncomingStation": incoming, "Station": equation.ahead}
        measures = {key: ifc.add("IfcLengthMeasure", rounded(value)) for key, value in values.items()}
        referents.append(_Referent(equation.station, f"equation-{number}", "STATION", "Pset_Stationing", measures))
    for name, carriageway in geometry.parameters.of_type(Carriageway).items():
        referents += _superelevation(ifc, name, carriageway)
        referents += _widths(ifc, geometry, name, carriageway)
    # What lies before or behind the road isn't on the curve.
    on_road = [item for item in referents if 0.0 <= item.station <= geometry.length]
    for item in sorted(on_road, key=lambda item: item.station):
        attributes = {"Name": item.name, "ObjectPlacement": linear_placement(ifc, geometry, axis, item.station)}
        referent = ifc.add_root("IfcReferent", item.name, **attributes, PredefinedType=item.kind)
        ifc.add_properties(referent, item.properties, item.values)
        if item.kind != "STATION":
            ifc.add_properties(
                referent, "Pset_Stationing", {"Station": ifc.value(stationing.counted(item.station), "m")}
            )
        ifc.note_relation("IfcRelNests", axis.alignment, [referent], "referents")


def _superelevation(ifc: IfcFile, name: str, carriageway: Carriageway) -> Iterator[_Referent]:
    """Yield a referent per crossfall point of a carriageway, as a ratio, positive where it falls to the right."""
    for number, point in enumerate(carriageway.crossfall):
        values = {
            "Side": [carriageway.side.upper()],
            "Superelevation": ifc.add("IfcRatioMeasure", rounded(point.crossfall_percent / 100.0, 9)),
            "TransitionSuperelevation": ["LINEAR"],
        }
        key = f"{name}/crossfall-{number}"
        yield _Referent(point.station, key, "SUPERELEVATIONEVENT", "Pset_Superelevation", values)


def _widths(ifc: IfcFile, geometry: RoadGeometry, name: str, carriageway: Carriageway) -> Iterator[_Referent]:
    """Yield a referent with the paved width at station 0 and wherever the width of a carriageway's strips bends."""
    section = geometry.sections[carriageway.side]
    for number, station in enumerate(sorted({0.0, *section.kinks()})):
        distances = section.distances(station)[0]
        values = {
            "Side": [carriageway.side.upper()],
            "TransitionWidth": ["LINEAR"],
            "NominalWidth": ifc.add("IfcNonNegativeLengthMeasure", rounded(distances[-2] - distances[0])),
        }
        yield _Referent(station, f"{name}/width-{number}", "WIDTHEVENT", "Pset_Width", values)


# --- placing --------------------------------------------------------------------------------------------------------


def linear_placement(
    ifc: IfcFile, geometry: RoadGeometry, axis: Axis, station: float, offset: float = 0.0, height: float | None = None
) -> Entity:
    """Add and return an IfcLinearPlacement along the alignment, upright: x along it, y to the left, z up.

    Distances are along the plan, which is flat: so heights are elevations, and nothing leans with the grade. The
    directions are those of the curve, which all readers take alike. The same as Cartesian coordinates stands beside it
    for readers that know no linear placement.

    Args:
        station, offset: m.
        height: local elevation, m; None for the profile's.
    """
    position, heading, _ = geometry.alignment.frame(np.array([station]))
    angle = float(heading[0])
    z = float(geometry.profile.elevation(station)) if height is None else height
    x, y = (position[0] + offset * np.array([-math.sin(angle), math.cos(angle)])).tolist()
    point = ifc.add(
        "IfcPointByDistanceExpression",
        DistanceAlong=ifc.length_measure(station),
        OffsetLateral=rounded(offset, 9),
        OffsetVertical=rounded(z),
        BasisCurve=axis.plan,
    )
    relative = ifc.add("IfcAxis2PlacementLinear", point, ifc.direction(0.0, 0.0, 1.0), None)
    return ifc.add("IfcLinearPlacement", None, relative, ifc.axes_3d((x, y, z), angle))


def local_placement(ifc: IfcFile, origin: Float, angle: float) -> Entity:
    """Add and return an IfcLocalPlacement at a local point (3,), turned about z by an angle (rad)."""
    return ifc.add("IfcLocalPlacement", None, ifc.axes_3d(origin.tolist(), angle))
