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
from .country.standards import joined_falls
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
        road: the road in the cloud that both were fitted to.
        fit: alignment and profile.
        rotation: name of the line about which the crossfall turns; the profile is this line's height.
        path: the alignment as a path with a point each metre.
    """

    road: FoundRoad
    fit: AxisFit
    rotation: RotationAxis
    path: CloudPath


@dataclass(frozen=True)
class Carriageways:
    """Cross-section and surfaces of a road, in K stretches along its alignment.

    Attributes:
        course: alignment and profile, along which all was measured.
        layout: carriageways and lines that profiles along the alignment show.
        section: widths of lanes, strips and shoulders.
        surfaces: height and crossfall by side.
        bays: emergency bays.
        unlike: stretches whose pavement is wider or narrower than the cross-section, emergency bays apart.
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
    """A reconstructed road with the measurements that it was made from.

    Attributes:
        parameters: the parameter set.
        measured: the measurements behind the parameter set, with standard deviations.
        carriageways: cross-section and surfaces along the alignment, and the course that they were measured along.
        judgement: stretches where the reconstructed axis isn't to be trusted, with reasons.
        notes: assumptions and gaps that a reader of the parameter set must know.
    """

    parameters: RoadParameters
    measured: RoadMeasurements
    carriageways: Carriageways
    judgement: Judgement
    notes: list[str] = field(default_factory=list)


def reconstruct(cloud: RoadCloud, options: Options | None = None, progress: Progress = silent) -> Reconstruction:
    """Return the reconstruction of the road that a cloud shows: parameter set, measurements and assessment.

    Raises:
        InputError: no road can be made out in the cloud.
    """
    options = options or Options()
    path, half_width = straighten_path(cloud, options, part_of(progress, 0.0, 0.3))
    road = find_axis(cloud.near(path, half_width + _AROUND), path, half_width, options, part_of(progress, 0.3, 0.5))
    progress("alignment", 0.5)
    course = fit_course(road, options.tolerance)
    progress("section", 0.6)
    carriageways = measure_carriageways(course, options.snap)
    measurements = measure_surroundings(carriageways, cloud, options.title, progress)
    parameters = assemble_parameters(measurements)
    judgement = judge_carriageways(carriageways)
    notes = [*carriageways.layout.notes, *_notes(measurements)]
    return Reconstruction(parameters, measurements, carriageways, judgement, notes)


def fit_course(road: FoundRoad, tolerance: float) -> Course:
    """Return the alignment and profile fitted to a road's axis, and the line about which the crossfall turns.

    The profile is the height of that line, the same for both carriageways: of the two lines that a parameter set can
    name, the one at which the carriageways' heights differ less.

    Args:
        road: the road found in the cloud, with its measured axis.
        tolerance: root mean square distance that the alignment may keep from the axis, m (`fit_axis`).

    Raises:
        InputError: the surface's height isn't known, or no alignment fits.
    """
    rotation, heights = _rotation_and_heights(road)
    right_heights, left_heights = heights
    height = np.where(
        np.isfinite(left_heights) & np.isfinite(right_heights),
        0.5 * (left_heights + right_heights),
        np.fmin(left_heights, right_heights),
    )
    if not np.isfinite(height).any():
        height = _ground_heights(road)
    is_measured = np.isfinite(road.axis.raw)
    first_stretch, last_stretch = np.flatnonzero(is_measured)[[0, -1]]
    seen_stretches = slice(int(first_stretch), int(last_stretch) + 1)
    if not np.isfinite(height[seen_stretches]).any():
        raise InputError("road", None, "too few points of the road's surface to tell its height")
    smooth_height = smooth(height, np.isfinite(height).astype(np.float64), STRETCH * SPACING, _HEIGHT_WAVELENGTH)
    axis_offsets = _replace_faults(road.axis.raw, road.axis.offsets)[seen_stretches]
    axis_points = road.path.place(road.axis.stations[seen_stretches], axis_offsets)
    fit = fit_axis(
        np.column_stack([axis_points, _replace_faults(height, smooth_height.values)[seen_stretches]]), tolerance, True
    )
    return Course(road, fit, rotation, alignment_path(fit.alignment))


def _rotation_and_heights(road: FoundRoad) -> tuple[RotationAxis, tuple[Float, Float]]:
    """Return the line about which the crossfall turns, and the heights (K,), m, of right and left carriageway there."""
    edges = {sign: _carriageway_edges(road, sign) for sign in (-1, 1)}
    if road.layout.kind == "single":  # both directions' pavement turns about the line in which they meet
        right_heights, left_heights = (
            _fit_between(road.layout.profiles, sign, pair, "centreline").height for sign, pair in edges.items()
        )
        return "centreline", (right_heights, left_heights)
    by_rotation: dict[RotationAxis, tuple[Float, Float]] = {}
    names: tuple[RotationAxis, ...] = ("carriageway_axis", "inner_edge")
    for rotation in names:
        right_heights, left_heights = (
            _fit_between(road.layout.profiles, sign, pair, rotation).height for sign, pair in edges.items()
        )
        by_rotation[rotation] = right_heights, left_heights
    difference = {name: _height_difference(heights) for name, heights in by_rotation.items()}
    turns_about_edges = difference["inner_edge"] < _INNER_SHARE * difference["carriageway_axis"] - _INNER_ADVANTAGE
    rotation_line: RotationAxis = "inner_edge" if turns_about_edges else "carriageway_axis"
    return rotation_line, by_rotation[rotation_line]


def _carriageway_edges(road: FoundRoad, sign: int) -> tuple[Float, Float]:
    """Return the offsets (K,), m, of the inner and the outer edge of the right (-1) or left (+1) carriageway.

    Each edge keeps its median distance from the axis: single stretches, beside turnouts or where it is hidden, have no
    say. Of a single carriageway the axis is the inner edge.
    """
    layout, axis = road.layout, road.axis.offsets
    band = layout.bands[0 if sign < 0 else -1]
    outermost = sign * (band.guide(sign).offset - float(np.median(axis)))
    # Outwards from the outermost line, or from 1 m beside the axis where that lies nearer: paved for sure.
    search_start = axis + sign * max(outermost, 1.0)
    outer_offsets = layout.pavement.edge(search_start, sign).offsets
    outer_offsets = axis + float(
        np.nanmedian(search_start - axis if np.isnan(outer_offsets).all() else outer_offsets - axis)
    )
    if layout.kind == "single":
        return axis.copy(), outer_offsets
    innermost = sign * (band.guide(-sign).offset - float(np.median(axis)))
    inner_offsets = layout.pavement.edge(axis + sign * innermost, -sign, innermost).offsets
    distance = float(np.nanmedian(inner_offsets - axis)) if np.isfinite(inner_offsets).any() else sign * innermost
    return axis + distance, outer_offsets


def _fit_between(profiles: Profiles, sign: int, edges: tuple[Float, Float], rotation: RotationAxis) -> Surface:
    """Return the surface of the right (-1) or left (+1) carriageway between its edges, and its height at the rotation.

    Args:
        profiles: cross profiles along a path or the alignment, in K stretches.
        sign: -1 for the right carriageway, +1 for the left one.
        edges: offsets of the carriageway's inner and outer edge, (K,) each, m.
        rotation: line about which the crossfall turns, and at which the height is taken.
    """
    inner_offsets, outer_offsets = edges
    pivot = 0.5 * (inner_offsets + outer_offsets) if rotation == "carriageway_axis" else inner_offsets
    right_edge, left_edge = (inner_offsets, outer_offsets) if sign > 0 else (outer_offsets, inner_offsets)
    return fit_surface(profiles, right_edge, left_edge, pivot)


def _height_difference(heights: tuple[Float, Float]) -> float:
    """Return the median absolute difference of the two carriageways' heights, m; 0 if unknown."""
    difference = np.abs(heights[1] - heights[0])
    return float(np.nanmedian(difference)) if np.isfinite(difference).any() else 0.0


def _ground_heights(road: FoundRoad) -> Float:
    """Return the median heights (K,), m, of the ground within a metre of the axis, to use where no pavement is seen."""
    profiles = road.layout.profiles
    result = np.full(profiles.stretches, np.nan)
    for number, offset in enumerate(road.axis.offsets):
        rows = slice(number * STRETCH, (number + 1) * STRETCH)
        ground = profiles.height[rows, profiles.column(offset - 1.0) : profiles.column(offset + 1.0) + 1]
        if np.isfinite(ground).any():
            result[number] = float(np.nanmedian(ground))
    return result


def _replace_faults(measured_values: Float, smooth_values: Float) -> Float:
    """Return measured values (K,) with missing and outlying ones replaced by the smoothed ones.

    The fit smooths by itself: values that are smooth already would pass for exact and get an element for every bend.
    """
    residual = np.abs(measured_values - smooth_values)
    deviation = max(robust_scale(residual[np.isfinite(residual)]), _LEAST_DEVIATION)
    return np.where(np.isfinite(measured_values) & (residual <= _OUTLIER * deviation), measured_values, smooth_values)


def measure_carriageways(course: Course, snap: bool = False) -> Carriageways:
    """Return the cross-section and surfaces that the cloud shows along the alignment.

    Args:
        course: alignment and profile, with the road that they were fitted to.
        snap: whether measured widths near a standard cross-section's are replaced by the standard ones.

    Raises:
        InputError: no carriageway can be made out along the alignment.
    """
    road = course.road
    layout = road.layout_along(course.path, road.layout.kind)
    section = measure_section(layout, road.cloud.marked, _axis_std(road.axis))
    if snap:
        section = snap_to_standard(section)
    surfaces = {side: _surface(layout.profiles, section.sides[side], course.rotation) for side in SIDES}
    return Carriageways(course, layout, section, surfaces, *find_widenings(section, layout.profiles.middles))


def _axis_std(axis: FusedAxis) -> float:
    """Return the standard deviation, m, of the axis' offset: the median over the stretches in which it is seen."""
    return float(np.median(axis.std[np.isfinite(axis.raw)]))


def _surface(profiles: Profiles, side: SideSection, rotation: RotationAxis) -> Surface:
    """Return height and crossfall of one carriageway's surface in each stretch along the alignment."""
    inner_distance = np.full(len(side.usual), side.inner_offset.value)
    outer_distance = inner_distance + side.paved_width.value
    side_sign = float(side.sign)  # distances from the axis become offsets to the left
    return _fit_between(profiles, side.sign, (side_sign * inner_distance, side_sign * outer_distance), rotation)


def measure_surroundings(
    carriageways: Carriageways, cloud: RoadCloud, title: str = "", progress: Progress = silent
) -> RoadMeasurements:
    """Return all measurements of a road: its carriageways, what stands beside them, and the ground.

    Args:
        carriageways: cross-section and surfaces, as measured along the alignment.
        cloud: all points read: the ground reaches farther than the points near the road.
        title: title of the parameter set.
        progress: called with the name of each stage and its share of the whole reconstruction.
    """
    course, section, profiles = carriageways.course, carriageways.section, carriageways.profiles
    progress("ground", 0.75)
    ground = measure_ground(cloud, course.path, section, course.fit.profile.elevation(course.path.stations))
    crossfall, surface_form = _crossfalls(carriageways)
    progress("objects", 0.85)
    points_above_ground = standing_points(course.road.cloud, profiles, section)
    barriers, barrier_points = find_barriers(points_above_ground)
    return RoadMeasurements(
        fit=course.fit,
        cloud=course.road.cloud,
        section=section,
        stations=profiles.middles,
        crossfall=crossfall,
        surface_form=surface_form,
        rotation=course.rotation,
        barriers=face_guardrails(barriers, section),
        posts=find_posts(points_above_ground, barrier_points),
        ground=ground,
        title=title,
        bays=carriageways.bays,
    )


def _crossfalls(carriageways: Carriageways) -> tuple[dict[Side, Float], str]:
    """Return the smoothed crossfall (K,), m/m, by side, and the form of a single carriageway's surface, "" if none."""
    falls = {side: _smooth_fall(surface) for side, surface in carriageways.surfaces.items()}
    if carriageways.section.kind == "dual":
        return falls, ""
    form, joined = joined_falls({-1: falls["right"], 1: falls["left"]})
    return {"right": joined[-1], "left": joined[1]}, form


def _smooth_fall(surface: Surface) -> Float:
    """Return a surface's crossfall (K,), m/m, smoothed along the road; unsmoothed if too few stretches have one."""
    is_measured = np.isfinite(surface.fall)
    if is_measured.sum() < _FEWEST_FALLS:
        return surface.fall
    weights, spacing = is_measured.astype(np.float64), STRETCH * SPACING
    return smooth(surface.fall, weights, spacing, _FALL_WAVELENGTH, order=2, usual_std=_FALL_STD).values


def judge_carriageways(carriageways: Carriageways) -> Judgement:
    """Return the judgement of a reconstruction: where its axis and its cross-section aren't to be trusted, and why."""
    course, stations = carriageways.course, carriageways.profiles.middles
    rivals = course.road.open_along(course.path, stations)
    parted = course.road.parted_line(course.path, stations)
    judgement = judge(carriageways.layout, carriageway_middles(carriageways.section), rivals, parted)
    return replace(judgement, sections=tuple(map(_section_doubt, carriageways.unlike)))


def _section_doubt(stretch: Unlike) -> Doubt:
    """Return the doubt about a stretch whose pavement is wider or narrower than the cross-section."""
    difference = f"{abs(stretch.wider_by):.1f} m {'wider' if stretch.wider_by > 0.0 else 'narrower'}"
    text = f"{stretch.side}: the pavement is {difference} than the cross-section"
    return Doubt(stretch.start, stretch.end, (text,))


def _notes(measurements: RoadMeasurements) -> list[str]:
    """Return remarks on assumptions and gaps that a reader of the parameter set must know."""
    cloud, section = measurements.cloud, measurements.section
    single_carriageway = (
        "a single carriageway: written as two carriageways that meet in the middle line, one per direction"
        + {"plane": "; its surface is a plane", "roof": "; its surface is a roof"}.get(measurements.surface_form, "")
    )
    remarks = [
        (cloud.strays > 0, f"{cloud.strays:,} points lie far from all others and weren't used"),
        (cloud.epsg is None, _assumed_system(cloud)),
        (not cloud.labelled, "pavement was told from ground by brightness, as the cloud has no such classes"),
        (not cloud.marked, "paint was told from pavement by brightness: lines have the usual widths"),
        (section.kind == "single", single_carriageway),
        (not measurements.ground.verge_seen, "the verge's width is the usual one, as the cloud has no such class"),
        *(remark for side in section.sides.values() for remark in _remarks_on(side)),
    ]
    return [text for applies, text in remarks if applies]


def _assumed_system(cloud: RoadCloud) -> str:
    """Return the note on the map system that is written to the parameter set where the cloud names none."""
    text = f"the cloud doesn't say its map system: EPSG:{UNKNOWN_EPSG} was written"
    if cloud.epsg is None and MapSystem.of(UNKNOWN_EPSG).outside(cloud.origin[None, :2]).max() > 0.0:
        text += ", for whose area its coordinates are none: the road's place on the map isn't known"
    return text


def _remarks_on(side: SideSection) -> Iterator[tuple[bool, str]]:
    """Yield (whether it applies, text) for each possible remark on the measurement of one side of the road."""
    lacks_line, name = any(line is None for line in side.lines[1:-1]), side.side
    yield not side.edge_seen, f"{name}: the pavement's outer edge isn't in the cloud: 0.5 m beyond the outermost line"
    yield not side.closed, f"{name}: the outermost line is dashed: there may be further lanes beyond the cloud"
    if side.assumed:
        yield True, f"{name}: lines weren't seen: the lanes are those of {side.assumed}, about as wide as it"
    elif side.mirrored:
        yield True, f"{name}: the edge line was seen on the other side only and is taken to be as far away"
    else:
        yield lacks_line, f"{name}: a lane line isn't seen where it must be"
