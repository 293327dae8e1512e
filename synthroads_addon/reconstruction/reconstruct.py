"""The whole way from a cloud to a parameter set, stage by stage: each has one record, which holds those before it.

1. `FoundRoad`: the road in the cloud, before anything is fitted to it (`find_axis`).
2. `Course`: alignment and profile (`fit_course`).
3. `Carriageways`: lanes, edges, surfaces and emergency bays along the alignment (`measure_carriageways`).
4. `RoadMeasurements`: the same with what stands and lies beside the road (`measure_surroundings`), of which
   `assemble_parameters` makes the parameter set.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError
from ..base.maps.crs import MapSystem
from ..base.progress import Progress, part_of, silent
from ..fitting.fit import AxisFit, fit_axis
from ..road.parameters import RoadParameters
from .assemble import UNKNOWN_EPSG, RoadMeasurements, RotationAxis, assemble_parameters
from .axis import FoundRoad, Options, find_axis, straighten_path
from .cloud import RoadCloud
from .edges import Surface, fit_surface
from .judgement import Doubt, Judgement, judge
from .layout import RoadLayout
from .objects import face_guardrails, find_barriers, find_posts, measure_ground, standing_points
from .path import SPACING, CloudPath, alignment_path
from .profiles import STRETCH, Profiles
from .section import SIDES, MeasuredSection, Side, SideSection, carriageway_middles, measure_section, snap_to_standard
from .smoothing import robust_scale, smooth
from .views.fusion import FusedAxis
from .widenings import Bay, Unlike, find_widenings

_AROUND = 12.0
"""Distance beyond the profiles' reach in which barriers may stand, m. Chosen: as far as `objects` looks for them."""
_OUTLIER = 4.0
"""Deviations from the smoothed values from which on a measured one is a fault. Chosen: the fit smooths the others."""
_LEAST_DEVIATION = 1e-3
"""Least deviation, m, of values that are no faults. Chosen: what differs by less than 4 mm is no fault."""
_HEIGHT_WAVELENGTH, _FALL_WAVELENGTH = 30.0, 15.0
"""Waves of the height and the crossfall that keep half of their amplitude, m. Chosen: shorter than vertical curves, and
than the runs over which a crossfall changes."""
_FALL_STD = 0.002
"""Deviation of a stretch's crossfall that is nothing unusual, m/m. Chosen: 7 mm over a lane."""
_FEWEST_FALLS = 5
"""Stretches whose crossfall must be known to be smoothed. Chosen: more than the coefficients of a parabola."""
_INNER_SHARE, _INNER_ADVANTAGE = 0.5, 0.002
"""Share of the carriageways' height difference at the axis, and m less, that may be left at the inner edges if the
crossfall turns about these. Chosen: where the difference hardly tells both apart the usual axis of rotation stays."""


@dataclass(frozen=True)
class Course:
    """Alignment and profile fitted to the road in a cloud.

    Attributes:
        road: that they were fitted to.
        fit: alignment and profile.
        rotation: line about which the crossfall turns, whose height is the profile.
        path: the alignment, each metre.
    """

    road: FoundRoad
    fit: AxisFit
    rotation: RotationAxis
    path: CloudPath


@dataclass(frozen=True)
class Carriageways:
    """Cross-section and surfaces of a road, in K stretches along its alignment.

    Attributes:
        course: of the road.
        layout: that profiles along the alignment show.
        section: widths of lanes, strips and shoulders.
        surfaces: height and crossfall by side.
        bays: emergency bays.
        unlike: stretches whose pavement isn't as wide as the cross-section.
    """

    course: Course
    layout: RoadLayout
    section: MeasuredSection
    surfaces: dict[Side, Surface]
    bays: list[Bay]
    unlike: list[Unlike]

    @property
    def profiles(self) -> Profiles:
        """Return the profiles along the alignment."""
        return self.layout.profiles


@dataclass(frozen=True)
class Reconstruction:
    """A reconstructed road with all that it was made from.

    Attributes:
        parameters: the parameter set.
        measured: the same in numbers with standard deviations.
        carriageways: what was found along the alignment, and before it was fitted.
        judgement: where its axis isn't to be trusted.
        notes: what a reader must know.
    """

    parameters: RoadParameters
    measured: RoadMeasurements
    carriageways: Carriageways
    judgement: Judgement
    notes: list[str] = field(default_factory=list)


def reconstruct(cloud: RoadCloud, options: Options | None = None, progress: Progress = silent) -> Reconstruction:
    """Return the reconstruction of the road that a cloud shows: parameter set, measurements and assessment.

    Raises:
        InputError: no road can be made out in it.
    """
    options = options or Options()
    path, half = straighten_path(cloud, options, part_of(progress, 0.0, 0.3))
    road = find_axis(cloud.near(path, half + _AROUND), path, half, options, part_of(progress, 0.3, 0.5))
    progress("alignment", 0.5)
    course = fit_course(road, options.tolerance)
    progress("section", 0.6)
    carriageways = measure_carriageways(course, options.snap)
    measured = measure_surroundings(carriageways, cloud, options.title, progress)
    parameters = assemble_parameters(measured)
    judgement = judge_carriageways(carriageways)
    notes = [*carriageways.layout.notes, *_notes(measured)]
    return Reconstruction(parameters, measured, carriageways, judgement, notes)


def fit_course(road: FoundRoad, tolerance: float) -> Course:
    """Return the alignment and profile fitted to a road's axis, and the line about which the crossfall turns.

    The profile is the height of that line, the same for both carriageways: of the two lines that a parameter set can
    name, the one at which the carriageways' heights differ less.

    Args:
        road: found in a cloud.
        tolerance: of the alignment's fit to the axis, m (`fit_axis`).

    Raises:
        InputError: the surface's height isn't known, or no alignment fits.
    """
    rotation, heights = _rotation_and_heights(road)
    right, left = heights
    height = np.where(np.isfinite(left) & np.isfinite(right), 0.5 * (left + right), np.fmin(left, right))
    if not np.isfinite(height).any():
        height = _ground_heights(road)
    known = np.isfinite(road.axis.raw)
    first, last = np.flatnonzero(known)[[0, -1]]
    seen = slice(int(first), int(last) + 1)
    if not np.isfinite(height[seen]).any():
        raise InputError("road", None, "too few points of the road's surface to tell its height")
    smoothed = smooth(height, np.isfinite(height).astype(np.float64), STRETCH * SPACING, _HEIGHT_WAVELENGTH)
    offset = _replace_faults(road.axis.raw, road.axis.offsets)[seen]
    plan = road.path.place(road.axis.stations[seen], offset)
    fit = fit_axis(np.column_stack([plan, _replace_faults(height, smoothed.values)[seen]]), tolerance, True)
    return Course(road, fit, rotation, alignment_path(fit.alignment))


def _rotation_and_heights(road: FoundRoad) -> tuple[RotationAxis, tuple[Float, Float]]:
    """Return the line about which the crossfall turns, and the heights (K,), m, of right and left carriageway there."""
    edges = {sign: _carriageway_edges(road, sign) for sign in (-1, 1)}
    by_rotation: dict[RotationAxis, tuple[Float, Float]] = {}
    names: tuple[RotationAxis, ...] = ("carriageway_axis", "inner_edge")
    for rotation in names:
        right, left = (_fit_between(road.layout.profiles, sign, pair, rotation).height for sign, pair in edges.items())
        by_rotation[rotation] = right, left
    difference = {name: _height_difference(heights) for name, heights in by_rotation.items()}
    turns_inside = difference["inner_edge"] < _INNER_SHARE * difference["carriageway_axis"] - _INNER_ADVANTAGE
    chosen: RotationAxis = "inner_edge" if turns_inside else "carriageway_axis"
    return chosen, by_rotation[chosen]


def _carriageway_edges(road: FoundRoad, sign: int) -> tuple[Float, Float]:
    """Return the offsets (K,), m, of the inner and the outer edge of the right (-1) or left (+1) carriageway.

    Each edge keeps its median distance from the axis: single stretches, beside turnouts or where it is hidden, have no
    say. Of a single carriageway the axis is the inner edge.
    """
    layout, axis = road.layout, road.axis.offsets
    band = layout.bands[0 if sign < 0 else -1]
    outermost = sign * (band.guide(sign).offset - float(np.median(axis)))
    # Outwards from the outermost line, or from 1 m beside the axis where that lies nearer: paved for sure.
    begin = axis + sign * max(outermost, 1.0)
    outer = layout.pavement.edge(begin, sign).offsets
    outer = axis + float(np.nanmedian(begin - axis if np.isnan(outer).all() else outer - axis))
    if layout.kind == "single":
        return axis.copy(), outer
    innermost = sign * (band.guide(-sign).offset - float(np.median(axis)))
    inner = layout.pavement.edge(axis + sign * innermost, -sign, innermost).offsets
    distance = float(np.nanmedian(inner - axis)) if np.isfinite(inner).any() else sign * innermost
    return axis + distance, outer


def _fit_between(profiles: Profiles, sign: int, edges: tuple[Float, Float], rotation: RotationAxis) -> Surface:
    """Return the surface of the right (-1) or left (+1) carriageway between its edges, and its height at the rotation.

    Args:
        profiles: along a path or the alignment.
        sign: of the side.
        edges: (K,) offsets of the inner and the outer one, m.
        rotation: the line at which the height is taken.
    """
    inner, outer = edges
    pivot = inner if rotation == "inner_edge" else 0.5 * (inner + outer)
    low, high = (inner, outer) if sign > 0 else (outer, inner)
    return fit_surface(profiles, low, high, pivot)


def _height_difference(heights: tuple[Float, Float]) -> float:
    """Return the median absolute difference of the two carriageways' heights, m; 0 if unknown."""
    difference = np.abs(heights[1] - heights[0])
    return float(np.nanmedian(difference)) if np.isfinite(difference).any() else 0.0


def _ground_heights(road: FoundRoad) -> Float:
    """Return the median heights (K,), m, of the ground within a metre of the axis, for want of a pavement's."""
    profiles = road.layout.profiles
    result = np.full(profiles.stretches, np.nan)
    for number, offset in enumerate(road.axis.offsets):
        rows = slice(number * STRETCH, (number + 1) * STRETCH)
        ground = profiles.height[rows, profiles.column(offset - 1.0) : profiles.column(offset + 1.0) + 1]
        if np.isfinite(ground).any():
            result[number] = float(np.nanmedian(ground))
    return result


def _replace_faults(raw: Float, smoothed: Float) -> Float:
    """Return measured values (K,) with missing and outlying ones replaced by the smoothed ones.

    The fit smooths by itself: values that are smooth already would pass for exact and get an element for every bend.
    """
    residual = np.abs(raw - smoothed)
    deviation = max(robust_scale(residual[np.isfinite(residual)]), _LEAST_DEVIATION)
    return np.where(np.isfinite(raw) & (residual <= _OUTLIER * deviation), raw, smoothed)


def measure_carriageways(course: Course, snap: bool = False) -> Carriageways:
    """Return the cross-section and surfaces that the cloud shows along the alignment.

    Args:
        course: with the road that it was fitted to.
        snap: take the standard cross-section's widths where the measured ones are near enough.

    Raises:
        InputError: no carriageway can be made out along it.
    """
    road = course.road
    layout = road.layout_along(course.path, road.layout.kind)
    section = measure_section(layout, road.cloud.marked, _axis_std(road.axis))
    if snap:
        section = snap_to_standard(section)
    surfaces = {side: _surface(layout.profiles, section.sides[side], course.rotation) for side in SIDES}
    return Carriageways(course, layout, section, surfaces, *find_widenings(section, layout.profiles.middles))


def _axis_std(axis: FusedAxis) -> float:
    """Return the standard deviation, m, of where the axis lies along the whole road."""
    return float(np.median(axis.std[np.isfinite(axis.raw)]))


def _surface(profiles: Profiles, side: SideSection, rotation: RotationAxis) -> Surface:
    """Return height and crossfall of one carriageway's surface in each stretch along the alignment."""
    inner = np.full(len(side.usual), side.inner_offset.value)
    outer = inner + side.paved_width.value
    left = float(side.sign)  # distances from the axis become offsets to the left
    return _fit_between(profiles, side.sign, (left * inner, left * outer), rotation)


def measure_surroundings(
    carriageways: Carriageways, cloud: RoadCloud, title: str = "", progress: Progress = silent
) -> RoadMeasurements:
    """Return all measurements of a road: its carriageways, what stands beside them, and the ground.

    Args:
        carriageways: measured.
        cloud: the whole one: the ground reaches farther than the road's own points.
        title: of the parameter set.
        progress: is told of both stages, as of a reconstruction's.
    """
    course, section, profiles = carriageways.course, carriageways.section, carriageways.profiles
    progress("ground", 0.75)
    ground = measure_ground(cloud, course.path, section, course.fit.profile.elevation(course.path.stations))
    progress("objects", 0.85)
    standing = standing_points(course.road.cloud, profiles, section)
    barriers, barrier_points = find_barriers(standing)
    return RoadMeasurements(
        fit=course.fit,
        cloud=course.road.cloud,
        section=section,
        stations=profiles.middles,
        crossfall={side: _smooth_fall(surface) for side, surface in carriageways.surfaces.items()},
        rotation=course.rotation,
        barriers=face_guardrails(barriers, section),
        posts=find_posts(standing, barrier_points),
        ground=ground,
        title=title,
        bays=carriageways.bays,
    )


def _smooth_fall(surface: Surface) -> Float:
    """Return the crossfall (K,), m/m, smoothed along the road; as measured where too few are known."""
    known = np.isfinite(surface.fall)
    if known.sum() < _FEWEST_FALLS:
        return surface.fall
    weights, spacing = known.astype(np.float64), STRETCH * SPACING
    return smooth(surface.fall, weights, spacing, _FALL_WAVELENGTH, order=2, usual=_FALL_STD).values


def judge_carriageways(carriageways: Carriageways) -> Judgement:
    """Return where a road's axis, and its cross-section, aren't to be trusted, and why."""
    course, stations = carriageways.course, carriageways.profiles.middles
    rivals = course.road.open_along(course.path, stations)
    parted = course.road.parted_line(course.path, stations)
    judgement = judge(carriageways.layout, carriageway_middles(carriageways.section), rivals, parted)
    return replace(judgement, sections=tuple(map(_section_doubt, carriageways.unlike)))


def _section_doubt(stretch: Unlike) -> Doubt:
    """Return what is said of a stretch whose pavement is unlike the cross-section."""
    difference = f"{abs(stretch.wider_by):.1f} m {'wider' if stretch.wider_by > 0.0 else 'narrower'}"
    text = f"{stretch.side}: the pavement is {difference} than the cross-section"
    return Doubt(stretch.start, stretch.end, (text,))


def _notes(measured: RoadMeasurements) -> list[str]:
    """Return remarks on assumptions and gaps that a reader of the parameter set must know."""
    cloud, section = measured.cloud, measured.section
    single = "a single carriageway: written as two carriageways that meet in the middle line, one per direction"
    remarks = [
        (cloud.strays > 0, f"{cloud.strays:,} points lie far from all others and weren't used"),
        (cloud.epsg is None, _assumed_system(cloud)),
        (not cloud.labelled, "pavement was told from ground by brightness, as the cloud has no such classes"),
        (not cloud.marked, "paint was told from pavement by brightness: lines have the usual widths"),
        (section.kind == "single", single),
        (not measured.ground.verge_seen, "the verge's width is the usual one, as the cloud has no such class"),
        *(remark for side in section.sides.values() for remark in _remarks_on(side)),
    ]
    return [text for applies, text in remarks if applies]


def _assumed_system(cloud: RoadCloud) -> str:
    """Return what is said of the map system that was written for want of the cloud's own."""
    text = f"the cloud doesn't say its map system: EPSG:{UNKNOWN_EPSG} was written"
    if cloud.epsg is None and MapSystem.of(UNKNOWN_EPSG).outside(cloud.origin[None, :2]).max() > 0.0:
        text += ", for whose area its coordinates are none: the road's place on the map isn't known"
    return text


def _remarks_on(side: SideSection) -> Iterator[tuple[bool, str]]:
    """Yield for one side (whether it applies, remark) of each possible remark."""
    hidden, name = any(line is None for line in side.lines[1:-1]), side.side
    yield not side.edge_seen, f"{name}: the pavement's outer edge isn't in the cloud: 0.5 m beyond the outermost line"
    yield not side.closed, f"{name}: the outermost line is dashed: there may be further lanes beyond the cloud"
    if side.assumed:
        yield True, f"{name}: lines weren't seen: the lanes are those of {side.assumed}, about as wide as it"
    elif side.mirrored:
        yield True, f"{name}: the edge line was seen on the other side only and is taken to be as far away"
    else:
        yield hidden, f"{name}: a lane line isn't seen where it must be"
