"""The whole way from a cloud to a parameter set, step by step."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.arrays import Bool, Float
from ..base.errors import InputError
from ..base.maps.crs import MapSystem
from ..base.progress import Progress, part_of, silent
from ..fitting.fit import AxisFit, fit_axis
from ..road.parameters import RoadParameters
from .assemble import UNKNOWN_EPSG, RoadMeasurements, RotationAxis, assemble_parameters
from .axis import FoundRoad, Options, find_axis, straighten_path
from .cloud import RoadCloud
from .edges import Surface, fit_surface, paved_edge
from .judgement import Doubt, Judgement, judge
from .layout import RoadLayout, find_layout
from .lines import find_lines
from .objects import face_guardrails, find_barriers, find_posts, measure_ground, standing_points
from .path import SPACING, CloudPath, alignment_path
from .profiles import STRETCH, Profiles, make_profiles
from .section import SIDES, MeasuredSection, Side, SideSection, carriageway_middles, measure_section, snap_to_standard
from .smoothing import robust_scale, smooth
from .views.fusion import FusedAxis
from .widenings import Unlike, find_widenings

_AROUND = 12.0  # m beyond the profiles' reach in which barriers may stand


@dataclass(frozen=True)
class Reconstruction:
    """A reconstructed road with all that it was made from.

    Attributes:
        parameters: the parameter set.
        measured: the same in numbers with standard deviations.
        centre: the axis as all views of it show it, along ``path``.
        path: parallel to the road, along which the lines were found.
        profiles, layout: along the alignment.
        surfaces: by side, along the alignment.
        judgement: where its axis isn't to be trusted.
        unlike: stretches whose pavement isn't as wide as the cross-section.
        notes: what a reader must know.
    """

    parameters: RoadParameters
    measured: RoadMeasurements
    centre: FusedAxis
    path: CloudPath
    profiles: Profiles
    layout: RoadLayout
    surfaces: dict[Side, Surface]
    judgement: Judgement
    unlike: list[Unlike] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def reconstruct(cloud: RoadCloud, options: Options | None = None, progress: Progress = silent) -> Reconstruction:
    """Return the reconstruction of the road that a cloud shows: parameter set, measurements and assessment.

    Raises:
        InputError: no road can be made out in it.
    """
    options = options or Options()
    path, half = straighten_path(cloud, options, part_of(progress, 0.0, 0.3))
    whole, cloud = cloud, cloud.near(path, half + _AROUND)
    road = find_axis(cloud, path, half, options, part_of(progress, 0.3, 0.5))
    path, profiles, layout = road.path, road.profiles, road.layout
    progress("alignment", 0.5)
    fit, rotation = fit_axis_and_profile(profiles, layout, road.axis, options.tolerance)
    progress("section", 0.6)
    along = alignment_path(fit.alignment)
    profiles = make_profiles(cloud, along, half, exact=True)
    layout = find_layout(profiles, find_lines(profiles), layout.kind)
    section = measure_section(profiles, layout, cloud.marked, _axis_std(road.axis))
    if options.snap:
        section = snap_to_standard(section)
    surfaces = {side: _surface(profiles, section, side, rotation) for side in SIDES}
    progress("ground", 0.75)
    ground = measure_ground(whole, along, section, fit.profile.elevation(along.stations))
    progress("objects", 0.85)
    standing = standing_points(cloud, along, profiles, section)
    barriers, used = find_barriers(standing)
    bays, others = find_widenings(section, profiles.middles)
    measured = RoadMeasurements(
        fit=fit,
        cloud=cloud,
        section=section,
        stations=profiles.middles,
        crossfall={side: _smooth_fall(surfaces[side]) for side in SIDES},
        rotation=rotation,
        barriers=face_guardrails(barriers, section),
        posts=find_posts(standing, used),
        ground=ground,
        title=options.title,
        bays=bays,
    )
    parameters = assemble_parameters(measured)
    notes = [*layout.notes, *_notes(cloud, section, measured)]
    parted = road.parted_line(along, profiles.middles)
    judgement = judge(profiles, layout, carriageway_middles(section), _rivals_along(road, along, profiles), parted)
    judgement = replace(judgement, sections=tuple(map(_section_doubt, others)))
    return Reconstruction(parameters, measured, road.axis, path, profiles, layout, surfaces, judgement, others, notes)


def _axis_std(axis: FusedAxis) -> float:
    """Return the standard deviation, m, of where the axis lies along the whole road."""
    return float(np.median(axis.std[np.isfinite(axis.raw)]))


def _section_doubt(other: Unlike) -> Doubt:
    """Return what is said of a stretch whose pavement is unlike the cross-section."""
    unlike = f"{abs(other.wider_by):.1f} m {'wider' if other.wider_by > 0.0 else 'narrower'}"
    return Doubt(other.start, other.end, (f"{other.side}: the pavement is {unlike} than the cross-section",))


def _rivals_along(road: FoundRoad, along: CloudPath, profiles: Profiles) -> Bool:
    """Return a mask (K,) of the alignment's stretches beside which the views of the axis disagree."""
    station, _ = along.project(road.path.place(road.axis.stations, road.axis.offsets))
    return np.interp(profiles.middles, station, road.axis.open.astype(np.float64)) > 0.5


def fit_axis_and_profile(
    profiles: Profiles, layout: RoadLayout, centre: FusedAxis, tolerance: float
) -> tuple[AxisFit, RotationAxis]:
    """Return the fitted alignment and profile, and the line about which the crossfall turns.

    The profile is the height of that line, the same for both carriageways: of the two lines that a parameter set can
    name, the one at which the carriageways' heights differ less.
    """
    heights = {name: _pivot_heights(profiles, layout, centre, name) for name in ("carriageway_axis", "inner_edge")}
    rotation: RotationAxis = "carriageway_axis"
    if _height_difference(heights["inner_edge"]) < 0.5 * _height_difference(heights["carriageway_axis"]) - 0.002:
        rotation = "inner_edge"
    right, left = heights[rotation]
    height = np.where(np.isfinite(left) & np.isfinite(right), 0.5 * (left + right), np.fmin(left, right))
    if not np.isfinite(height).any():
        height = _ground_heights(profiles, centre)
    known = np.isfinite(centre.raw)
    first, last = np.flatnonzero(known)[[0, -1]]
    kept = slice(int(first), int(last) + 1)
    if not np.isfinite(height[kept]).any():
        raise InputError("road", None, "too few points of the road's surface to tell its height")
    smoothed = smooth(height, np.isfinite(height).astype(np.float64), STRETCH * SPACING, 30.0)
    offset = _replace_faults(centre.raw, centre.offsets)[kept]
    plan = profiles.path.place(centre.stations[kept], offset)
    return fit_axis(np.column_stack([plan, _replace_faults(height, smoothed.values)[kept]]), tolerance, True), rotation


def _ground_heights(profiles: Profiles, centre: FusedAxis) -> Float:
    """Return the median heights (K,), m, of the ground within a metre of the axis, for want of a pavement's."""
    result = np.full(profiles.stretches, np.nan)
    for number, offset in enumerate(centre.offsets):
        rows = slice(number * STRETCH, (number + 1) * STRETCH)
        near = profiles.height[rows, profiles.column(offset - 1.0) : profiles.column(offset + 1.0) + 1]
        if np.isfinite(near).any():
            result[number] = float(np.nanmedian(near))
    return result


def _replace_faults(raw: Float, smoothed: Float) -> Float:
    """Return measured values (K,) with missing and outlying ones replaced by the smoothed ones.

    The fit smooths by itself: values that are smooth already would pass for exact and get an element for every bend.
    """
    apart = np.abs(raw - smoothed)
    usual = robust_scale(apart[np.isfinite(apart)])
    return np.where(np.isfinite(raw) & (apart <= 4.0 * max(usual, 1e-3)), raw, smoothed)


def _pivot_heights(profiles: Profiles, layout: RoadLayout, centre: FusedAxis, rotation: str) -> tuple[Float, Float]:
    """Return the heights (K,), m, of right and left carriageway at the line that the crossfall turns about."""
    result = []
    axis = centre.offsets
    for name, sign in (("right", -1), ("left", 1)):
        band = layout.bands[0] if name == "right" or layout.kind == "single" else layout.bands[1]
        outermost = sign * (band.guide(sign).offset - float(np.median(axis)))
        begin = axis + sign * max(outermost, 1.0)
        outer = paved_edge(profiles, layout.paved, begin, sign).offsets
        outer = axis + float(np.nanmedian(np.append(outer - axis, begin - axis if np.isnan(outer).all() else [])))
        inner = axis.copy()
        if layout.kind == "dual":
            innermost = sign * (band.guide(-sign).offset - float(np.median(axis)))
            edge = paved_edge(profiles, layout.paved, axis + sign * innermost, -sign, innermost).offsets
            inner = axis + (float(np.nanmedian(edge - axis)) if np.isfinite(edge).any() else sign * innermost)
        low, high = (inner, outer) if sign > 0 else (outer, inner)
        pivot = inner if rotation == "inner_edge" else 0.5 * (inner + outer)
        result.append(fit_surface(profiles, low, high, pivot).height)
    return result[0], result[1]


def _height_difference(heights: tuple[Float, Float]) -> float:
    """Return the median absolute difference of the two carriageways' heights, m; 0 if unknown."""
    difference = np.abs(heights[1] - heights[0])
    return float(np.nanmedian(difference)) if np.isfinite(difference).any() else 0.0


def _surface(profiles: Profiles, section: MeasuredSection, side: Side, rotation: RotationAxis) -> Surface:
    """Return height and crossfall of one carriageway's surface in each stretch along the alignment."""
    measured_side = section.sides[side]
    count = len(measured_side.usual)
    inner = np.full(count, measured_side.inner_offset.value)
    outer = inner + measured_side.paved_width.value
    pivot = inner if rotation == "inner_edge" else 0.5 * (inner + outer)
    low, high = (inner, outer) if measured_side.sign > 0 else (-outer, -inner)
    return fit_surface(profiles, low, high, float(measured_side.sign) * pivot)


def _smooth_fall(measured: Surface) -> Float:
    """Return the crossfall (K,), m/m, smoothed along the road; as measured where too few are known."""
    known = np.isfinite(measured.fall)
    if known.sum() < 5:
        return measured.fall
    return smooth(measured.fall, known.astype(np.float64), STRETCH * SPACING, 15.0, order=2, usual=0.002).values


def _notes(cloud: RoadCloud, section: MeasuredSection, measured: RoadMeasurements) -> list[str]:
    """Return remarks on assumptions and gaps that a reader of the parameter set must know."""
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
