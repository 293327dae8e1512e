"""Limits of the guidelines by design class, and the standard cross-sections: the one table of both.

They are read from the files of `presets/guidelines`, and of the users' own folders that the environment variable
`SYNTHROADS_GUIDELINES` names: one for each guideline, with its classes, its quantities, each with its source and how
sure it is, its cross-sections, its signs, the side that traffic keeps to, and what a scenario of its classes has where
nothing is given. No code knows a country: what differs between countries is in these files.
"""

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from ..base.errors import InputError, MissingFileError
from ..base.files import PRESETS
from ..base.schema import ClosedModel, read_json
from .objects import Side

CentreLine = Literal["none", "single", "double", "strip"]
EdgeLine = Literal["none", "solid", "dashed"]
LineColor = Literal["white", "yellow"]
SignRole = Literal[
    "curve_left",
    "curve_right",
    "double_curve_left",
    "double_curve_right",
    "curve_board_left",
    "curve_board_right",
    "town_begin",
    "town_end",
    "bus_stop",
    "crossing",
    "signpost_left",
    "signpost_right",
    "give_way",
    "stop",
    "priority_road",
    "wrong_way",
    "motorway_left",
    "motorway_right",
    "town_speed",
    "island",
]
"""Purposes of signs that are placed by rule; the guideline says which sign of its country serves each."""


class Quantity(ClosedModel):
    """A quantity of a guideline: a number for all its classes, or one for each.

    A limit is what the checker asks for; a default is what the sampler does where the scenario says nothing else.
    """

    unit: str = Field(description="Unit of the values.")
    guideline: str = Field("", description="Guideline that it is from, where that is another one.")
    values: float | dict[str, float] = Field(description="Value, or value by class; a class left out has none.")
    use: Literal["limit", "default"] = Field(description="Whether roads are checked by it.")
    sure: Literal["confirmed", "derived", "unconfirmed", "chosen"] = Field(description="How sure it is.")
    source: str = Field(description="Where it is from; the guideline itself if empty.")


class _Section(ClosedModel):
    """A standard cross-section as a guideline's file has it: one direction, lanes from outside to inside; m."""

    lanes: tuple[float, ...]
    oncoming_lanes: tuple[float, ...] = ()
    hard_shoulder: float
    outer_edge_strip: float
    inner_edge_strip: float
    median: float
    verge: float
    centre_line: CentreLine = "none"
    edge_line: EdgeLine = "solid"
    overtaking_lane: float = 0.0
    sure: Literal["confirmed", "derived", "split", "chosen"]
    source: str


class _DesignClass(ClosedModel):
    """A design class: its names for people and in messages, its cross-sections and the one that it usually has."""

    label: str
    citation: str
    sections: tuple[str, ...] = Field(min_length=1)
    usual_section: str


class TrafficSide(ClosedModel):
    """The side that a country's traffic keeps to."""

    side: Side = Field(description="Side, seen by drivers.")
    sure: Literal["confirmed", "unconfirmed"] = Field(description="How sure it is.")
    source: str = Field(description="Law that says so.")


class Guideline(ClosedModel):
    """A guideline: design classes, limits, cross-sections, signs, defaults of scenarios; a JSON file."""

    name: str = Field(description="Short name in messages.")
    title: str = Field(description="Its name, and where the figures are from.")
    country: str = Field(pattern="^[A-Z]{2}$", description="Country by ISO 3166, as signs and OpenDRIVE name it.")
    traffic: TrafficSide = Field(description="Side that traffic keeps to.")
    carriageways: Literal[1, 2] = Field(description="Carriageways of its roads: one for both directions, or two.")
    centre_line_color: LineColor = Field("white", description="Colour of lines between the directions.")
    edge_line_color: LineColor = Field("white", description="Colour of lines at the pavement's edges.")
    classes: dict[str, _DesignClass] = Field(min_length=1)
    quantities: dict[str, Quantity]
    sections: dict[str, _Section]
    delineator_rule: str = Field("", description="Guideline that asks for delineators; none without.")
    sign_roles: dict[SignRole, str] = Field({}, description="Code of the sign that is placed by rule; none without.")
    signs: dict[str, dict[str, Any]] = Field(
        {}, description="Signs that it adds to the catalogue, by code; their fields are those of `presets/signs.json`."
    )
    destinations: tuple[str, ...] = Field(
        (), description="Names of places for its boards, four at least; those of the catalogue of signs without."
    )
    defaults: dict[str, Any] = Field(description="Fields of a road's scenario, where they aren't given.")


@dataclass(frozen=True)
class DesignLimits:
    """Limits and defaults of one design class. What a guideline doesn't have is 0, or infinite for an upper limit.

    Attributes:
        speed: speed used for driving dynamics on a wet road, or planning speed, km/h.
        radius: smallest radius, m.
        drawn_radius_least, drawn_radius_largest: radii that are drawn where the scenario says nothing, m.
        clothoid: smallest clothoid parameter A, m.
        clothoid_ratio: largest ratio of the parameters of an S-curve's clothoids.
        radius_ratio: largest ratio of neighbouring radii.
        curvature_jump_radius: arcs of a larger radius (m) may follow a straight without a clothoid.
        straight_longest: longest straight, m.
        straight_same_hand, straight_same_hand_radii: shortest straight between two curves of one direction, m, and as
            a multiple of the smaller radius.
        arc_length, arc_seconds: shortest arc, m, and as a time of travel, s.
        grade_percent: steepest longitudinal grade.
        crest, sag: smallest vertical radii, m.
        vertical_tangent: shortest tangent of a crest or sag, m.
        least_crossfall_percent, largest_crossfall_percent: of the pavement.
        radius_least_crossfall: radius from which the least crossfall suffices, m.
        radius_outwards: radius from which the crossfall may fall to the outside, m.
        run_off_percent: largest slope of the pavement's edge against its rotation axis.
        run_off_percent_per_metre: the same, of edges near the axis, per m of their distance from it.
        run_off_least_per_metre: least such slope while water could stand, % per m of the distance.
        turnout_lane_length: shortest deceleration or acceleration lane, m.
        interchange_spacing: least distance between two exits, or two entries, of one carriageway, m.
        lane_taper_length: shortest stretch over which a lane begins or ends, m.
        obstacle_distance: from the paved edge: nearer than this (m), an obstacle (pier, gantry post, pole, noise
            barrier, tree, board on thick posts) needs a barrier in front of it.
        tight_curve: arcs of a radius below this times the smallest have a barrier on their outer side.
        overtaking_sight: where drivers see as far as this (m), the line between the directions is dashed.
        prohibition_sight: where they see less than this (m), it is solid; 0: wherever it isn't dashed.
        warning_length: dashes of the warning pattern lead to a solid line over this distance, m.
        curve_sign_radius: arcs of a smaller radius (m) have danger signs before them, and boards outside if the
            guideline names some; 0: those of `tight_curve`.
        stopping_deceleration: of a vehicle that stops for what it sees, m/s2.
        unsigned_speed: speed limit where no sign says another, or the advised speed, km/h.
        broad_line, narrow_line: widths of lines, m.
        lane_dash, lane_gap: of lines between lanes, m.
        parking_width: of a bay for vehicles parallel to the road, m.
        bus_carriageway: of both directions where buses stop in villages, m.
        centre_dash, centre_gap: of a dashed line between the directions, m; 0: as between lanes.
        warning_dash, warning_gap: of the same where drivers are warned not to overtake, m; 0: there is no such line.
        edge_dash, edge_gap: of a dashed line at the pavement's edge, m; 0: as between lanes.
        edge_line_width: of the outer edge line, m; 0: broad on motorways, else narrow.
        solid_line_width: of a solid line between the directions of one carriageway, m; 0: narrow.
        solid_lines: number of solid lines beside each other there.
        double_line_gap: between two such lines, m.
        centre_lines: least number of lines between the directions of one carriageway.
        narrowest_centre_line_lane: lanes narrower than this (m) have no line between the directions.
        signed_curve_speed: speed limit before such arcs, km/h.
        danger_sign_nearest, danger_sign_farthest: distance of a danger sign before what it warns of, m; 0: two stand
            before a curve, as before motorways' curves.
        field_access: 1 where fields and farm tracks may have entrances from the road.
        plant_distance: from the paved edge to hedges, and to crowns up to `plant_clearance` high, m.
        plant_clearance: height up to which nothing grows over the pavement, m.
        give_way_block, give_way_gap, give_way_depth: of the line for giving way at a mouth, along it and across, m.
        give_way_rows, give_way_row_gap: number of its rows, and the distance between two, m.
        stop_depth: of the line for stopping, across it, m.
        mouth_sign_distance: so far from the road's edge (m) the sign for giving way or stopping stands at most; 0:
            none is asked for.
        mouth_dash, mouth_gap: of the edge line across a side road's mouth, m; 0: as of an edge line, or 3 m.
        town_dash, town_gap: of a dashed line between the directions in villages, m; 0: as outside of them.
        town_speed: speed limit in villages, km/h.
        crossing_speed: highest speed limit at a pedestrian crossing, km/h; 0: no rule for crossings.
    """

    speed: float
    radius: float
    drawn_radius_least: float
    drawn_radius_largest: float
    grade_percent: float
    crest: float
    sag: float
    least_crossfall_percent: float
    largest_crossfall_percent: float
    radius_least_crossfall: float
    radius_outwards: float
    run_off_percent: float
    run_off_least_per_metre: float
    obstacle_distance: float
    unsigned_speed: float
    broad_line: float
    narrow_line: float
    lane_dash: float
    lane_gap: float
    straight_longest: float
    overtaking_sight: float
    clothoid: float = 0.0
    clothoid_ratio: float = math.inf
    radius_ratio: float = math.inf
    curvature_jump_radius: float = math.inf
    straight_same_hand: float = 0.0
    straight_same_hand_radii: float = 0.0
    arc_length: float = 0.0
    arc_seconds: float = 0.0
    vertical_tangent: float = 0.0
    run_off_percent_per_metre: float = math.inf
    turnout_lane_length: float = 0.0
    interchange_spacing: float = 0.0
    lane_taper_length: float = 0.0
    tight_curve: float = 0.0
    stopping_deceleration: float = 0.0
    centre_lines: float = 0.0
    narrowest_centre_line_lane: float = 0.0
    parking_width: float = 0.0
    bus_carriageway: float = 0.0
    prohibition_sight: float = 0.0
    warning_length: float = 0.0
    curve_sign_radius: float = 0.0
    centre_dash: float = 0.0
    centre_gap: float = 0.0
    warning_dash: float = 0.0
    warning_gap: float = 0.0
    edge_dash: float = 0.0
    edge_gap: float = 0.0
    edge_line_width: float = 0.0
    solid_line_width: float = 0.0
    solid_lines: float = 1.0
    double_line_gap: float = 0.0
    signed_curve_speed: float = 0.0
    danger_sign_nearest: float = 0.0
    danger_sign_farthest: float = math.inf
    field_access: float = 0.0
    plant_distance: float = 0.0
    plant_clearance: float = 0.0
    give_way_block: float = 0.5
    give_way_gap: float = 0.25
    give_way_depth: float = 0.5
    give_way_rows: float = 1.0
    give_way_row_gap: float = 0.0
    stop_depth: float = 0.5
    mouth_sign_distance: float = 0.0
    mouth_dash: float = 0.0
    mouth_gap: float = 0.0
    town_dash: float = 0.0
    town_gap: float = 0.0
    town_speed: float = 50.0
    crossing_speed: float = 0.0

    @property
    def shortest_arc(self) -> float:
        """Return the length of the shortest arc, m."""
        return max(self.arc_length, self.arc_seconds * self.speed / 3.6)

    @property
    def stopping_sight(self) -> float:
        """Return the distance in which a vehicle stops, m: 2 s of travel and v^2 / (2 a); 0 where it isn't needed."""
        if not self.stopping_deceleration:
            return 0.0
        speed = self.speed / 3.6
        return REACTION_SECONDS * speed + speed**2 / (2.0 * self.stopping_deceleration)

    def straight_between(self, smaller_radius: float) -> float:
        """Return the length (m) of the shortest straight between two curves of one direction, by the smaller radius."""
        return max(self.straight_same_hand, self.straight_same_hand_radii * smaller_radius)


REACTION_SECONDS = 2.0
"""Time that a driver travels on before the brakes grip, s (RAA and RAL)."""


@dataclass(frozen=True)
class StandardCrossSection:
    """Widths of one direction of a standard cross-section (RQ), m; lanes from outside to inside.

    Attributes:
        lanes: of the right direction, or of both.
        hard_shoulder, outer_edge_strip, inner_edge_strip, median, verge: the other strips.
        oncoming_lanes: lanes of the left direction where they are others.
        single: whether both directions share one carriageway.
        centre_line, edge_line: lines of a single carriageway.
        overtaking_lane: width of a lane that either direction has in places, beside its own; 0 for none.
    """

    lanes: tuple[float, ...]
    hard_shoulder: float
    outer_edge_strip: float
    inner_edge_strip: float
    median: float
    verge: float = 1.5
    oncoming_lanes: tuple[float, ...] = field(default=(), compare=False)
    single: bool = False
    centre_line: CentreLine = "none"
    edge_line: EdgeLine = "solid"
    overtaking_lane: float = 0.0

    @property
    def paved_width(self) -> float:
        """Return the width of one direction's pavement from the inner edge strip to the hard shoulder, m."""
        return math.fsum(self.lanes) + self.hard_shoulder + self.outer_edge_strip + self.inner_edge_strip

    @property
    def total_width(self) -> float:
        """Return the width of the whole road, from verge to verge, m."""
        paved_width = math.fsum(self.of_side(side).paved_width for side in ("left", "right"))
        return paved_width + 2.0 * self.verge + self.median

    @property
    def lever(self) -> float:
        """Return the largest distance of a paved edge from the axis about which the crossfall turns, m."""
        if not self.single:
            return self.paved_width / 2.0
        return max(self.of_side("left").paved_width, self.of_side("right").paved_width)

    def of_side(self, side: Side) -> "StandardCrossSection":
        """Return the cross-section with the lanes of one side."""
        if side == "right" or not self.oncoming_lanes:
            return self
        return replace(self, lanes=self.oncoming_lanes, oncoming_lanes=())


OWN_GUIDELINES = "SYNTHROADS_GUIDELINES"
"""Environment variable with guidelines of one's own: JSON files, or folders of them, parted as in PATH."""
_FIRST_FILES = ("raa.json", "ral.json")
"""Files that come first, so that a scenario without a class is what it always was."""


def guideline_files(folders: str = "") -> list[Path]:
    """Return the files of guidelines: the shipped ones, and those of paths that are parted as in PATH.

    Raises:
        MissingFileError: one of the paths doesn't exist.
    """
    shipped_files = sorted(
        (PRESETS / "guidelines").glob("*.json"), key=lambda path: (path.name not in _FIRST_FILES, path.name)
    )
    added_files: list[Path] = []
    for part in filter(None, folders.split(os.pathsep)):
        path = Path(part).expanduser()
        if not path.exists():
            raise MissingFileError(part, None, f"no such file or folder; {OWN_GUIDELINES} names it")
        added_files += sorted(path.glob("*.json")) if path.is_dir() else [path]
    return [*shipped_files, *added_files]


def read_guidelines(paths: Iterable[Path]) -> dict[str, Guideline]:
    """Return the guidelines of files by name.

    Raises:
        InputError: a file is no guideline; or its name, or that of a class or cross-section, is another one's already.
    """
    guidelines: dict[str, Guideline] = {}
    taken: dict[str, Path] = {}
    for path in paths:
        guideline = Guideline.from_dict(read_json(path), str(path))
        for kind, names in (
            ("name", [guideline.name]),
            ("classes", guideline.classes),
            ("sections", guideline.sections),
            ("signs", guideline.signs),
        ):
            for name in names:
                if other := taken.get(f"{kind}.{name}"):
                    raise InputError(f"{path}: {kind}", name, f"{other.name} has that already; take another name")
                taken[f"{kind}.{name}"] = path
        guidelines[guideline.name] = guideline
    return guidelines


GUIDELINES: Mapping[str, Guideline] = read_guidelines(guideline_files(os.environ.get(OWN_GUIDELINES, "")))
"""Guidelines by name."""
GUIDELINE_OF_CLASS: Mapping[str, Guideline] = {
    name: guideline for guideline in GUIDELINES.values() for name in guideline.classes
}
"""Design class -> its guideline."""
DESIGN_CLASSES: tuple[str, ...] = tuple(GUIDELINE_OF_CLASS)
_QUANTITIES = frozenset(limit.name for limit in fields(DesignLimits))


def _limits(guideline: Guideline, design_class: str) -> DesignLimits:
    """Return the limits of a class; ValueError for a quantity that no code reads."""
    if unknown := sorted(set(guideline.quantities) - _QUANTITIES):
        raise ValueError(f"guideline {guideline.name}: unknown quantities {', '.join(unknown)}")
    values = {
        name: row.values if isinstance(row.values, float) else row.values.get(design_class)
        for name, row in guideline.quantities.items()
    }
    return DesignLimits(**{name: value for name, value in values.items() if value is not None})


def _section(row: _Section, guideline: Guideline) -> StandardCrossSection:
    """Return a cross-section of a guideline."""
    return StandardCrossSection(**row.model_dump(exclude={"sure", "source"}), single=guideline.carriageways == 1)


LIMITS = {name: _limits(guideline, name) for name, guideline in GUIDELINE_OF_CLASS.items()}
"""Design class -> its limits."""
STANDARD_CROSS_SECTIONS = {
    name: _section(row, guideline) for guideline in GUIDELINES.values() for name, row in guideline.sections.items()
}
"""Name -> standard cross-section."""
DUAL_CROSS_SECTIONS = {name: section for name, section in STANDARD_CROSS_SECTIONS.items() if not section.single}
"""Name -> standard cross-section of two carriageways."""
SECTIONS_OF_CLASS = {name: guideline.classes[name].sections for name, guideline in GUIDELINE_OF_CLASS.items()}
"""Design class -> standard cross-sections that it may have."""
USUAL_SECTION = {name: guideline.classes[name].usual_section for name, guideline in GUIDELINE_OF_CLASS.items()}
"""Design class -> the cross-section that it has where none is given."""
CLASS_LABELS = {name: guideline.classes[name].label for name, guideline in GUIDELINE_OF_CLASS.items()}
"""Design class -> its name for people."""
DUAL_CLASSES = tuple(name for name in DESIGN_CLASSES if GUIDELINE_OF_CLASS[name].carriageways == 2)
"""Design classes of roads with two carriageways."""


def is_single(design_class: str) -> bool:
    """Return whether roads of a design class have one carriageway for both directions."""
    return GUIDELINE_OF_CLASS[design_class].carriageways == 1


def design_class_of(cross_section: str, preferred: str) -> str:
    """Return the preferred design class if it may have a cross-section, else the first one that may.

    Example:
        >>> design_class_of("RQ31", preferred="EKA1A"), design_class_of("RQ25", preferred="EKA1A")
        ('EKA1A', 'EKA3')
    """
    if cross_section in SECTIONS_OF_CLASS[preferred]:
        return preferred
    return next(name for name, sections in SECTIONS_OF_CLASS.items() if cross_section in sections)


def sections_of_country(design_class: str) -> set[str]:
    """Return the names of the standard cross-sections of the country that a design class is of.

    Example:
        >>> "RQ11" in sections_of_country("EKA1A"), "S2" in sections_of_country("EKA1A")
        (True, False)
    """
    country = GUIDELINE_OF_CLASS[design_class].country
    return {
        section
        for name, sections in SECTIONS_OF_CLASS.items()
        if GUIDELINE_OF_CLASS[name].country == country
        for section in sections
    }


def curve_crossfall_percent(design_class: str, curvature: float) -> float:
    """Return the crossfall (%) towards the inside of a curve: the largest at the smallest radius, the least far above.

    In between linear in log radius against log crossfall, rounded up to half a percent.

    Example:
        >>> [float(curve_crossfall_percent("EKA1A", 1 / radius)) for radius in (900.0, 2000.0, 5000.0)]
        [6.0, 3.5, 2.5]
    """
    limits = LIMITS[design_class]
    radius = 1.0 / max(abs(curvature), 1e-9)
    smallest_radius = limits.drawn_radius_least
    share = math.log(radius / smallest_radius) / math.log(limits.radius_least_crossfall / smallest_radius)
    change = math.log(limits.least_crossfall_percent / limits.largest_crossfall_percent)
    exact = limits.largest_crossfall_percent * math.exp(change * min(1.0, max(0.0, share)))
    return math.ceil(2.0 * exact - 1e-9) / 2.0


DELINEATOR_SPACING = ((20.0, 3.0), (50.0, 5.0), (100.0, 10.0), (300.0, 20.0), (600.0, 50.0))
"""Radius (m) and the spacing of delineators (m) outside the curve; 50 m from 600 m on."""

# --- turnouts (RAA; all unconfirmed but the interchange spacing) ---------------------------------------------------

TURNOUT_LANE_WIDTH = 3.5
"""Narrowest deceleration or acceleration lane, m."""
TURNOUT_TAPER = 30.0
EMERGENCY_BAY_TAPER = 20.0
"""Shortest taper of a deceleration or acceleration lane, and of an emergency bay, m."""
EMERGENCY_BAY_WIDTH = 3.0
EMERGENCY_BAY_LENGTH = 40.0
"""Narrowest and shortest emergency bay at full width, m."""
TURNOUT_GAP = 20.0
"""Least distance between two turnouts of one carriageway, m."""

# --- earthworks and drainage (RAA, RAS-Ew; unconfirmed) ---------------------------------------------------------------

SWALE_DEPTH_SHARE = 0.2
"""Depth of a swale as a share of its width."""

# --- barriers (RPS) -----------------------------------------------------------------------------------------------

EMBANKMENT_HEIGHT, EMBANKMENT_RUN = 3.0, 3.0
"""An embankment higher (m) and steeper (run per height) than this needs barriers."""
OBSTACLE_POST = 0.1
"""Posts of signs thicker than this (m) are obstacles; thinner ones give way."""
OBSTACLE_LEAD, OBSTACLE_TAIL = 60.0, 10.0
"""A barrier begins so far before an obstacle, and ends so far behind it, in the direction of traffic, m."""
BARRIER_DISTANCE = 0.5
"""From the paved edge to a barrier's nearest part, m."""
SHORTEST_BARRIER = 60.0
BARRIER_GAP = 0.1
"""Barriers no farther apart along the road than this (m) leave no gap."""

# --- signs and equipment --------------------------------------------------------------------------------------------

SIGN_DISTANCE = 0.5
"""From the paved edge to a sign's nearest part, m."""
SIGN_LOWER_EDGE = 1.5
"""Lowest lower edge of a sign's face, m (beacons before exits and kilometre boards may be lower)."""
EXIT_SEQUENCE = {1000.0: "448", 500.0: "449", 300.0: "450-52", 200.0: "450-51", 100.0: "450-50"}
"""Distance before the beginning of an exit (m) -> code of the sign there; those before the road's begin fall away."""
EXIT_SIGN_ROOM = 5.0
"""A sign of the sequence may stand this far (m) from its place."""
GORE_SIGN = "333"
"""The exit board, which stands in the gore."""
CLEARANCE = 4.70
"""Least clearance over the pavement, m."""
KILOMETRE_BOARD_SPACING = 500.0
EMERGENCY_PHONE_SPACING = 2000.0
BEACON_SPACING, BEACON_SPACING_TAPER = 18.0, 9.0
"""Largest spacing of a construction zone's beacons along it and in its tapers, m."""
CONSTRUCTION_LANE_WIDTH = 2.5
"""Narrowest lane left open beside a construction zone, m."""
