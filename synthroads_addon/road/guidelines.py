"""Limits of the RAA 2008 by design class, and the standard cross-sections: the one table of both.

The limits are those that secondary sources print of the RAA; the crossfall over the radius, which the RAA shows as a
diagram, is derived from the shares of friction at its ends.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class DesignLimits:
    """Limits of the RAA for one design class of motorways.

    Attributes:
        speed: speed used for driving dynamics on a wet road, km/h.
        radius: smallest radius, m.
        clothoid: smallest clothoid parameter A, m.
        grade_percent: steepest longitudinal grade.
        crest, sag: smallest vertical radii, m.
        run_off_percent: largest slope of the pavement's edge against its rotation axis (4 m or more apart).
        radius_least_crossfall: radius from which the least crossfall suffices, m.
        radius_outwards: radius from which the crossfall may fall to the outside, m.
    """

    speed: float
    radius: float
    clothoid: float
    grade_percent: float
    crest: float
    sag: float
    run_off_percent: float
    radius_least_crossfall: float
    radius_outwards: float


LIMITS = {
    "EKA1A": DesignLimits(130, 900, 300, 4.0, 13000, 8800, 0.9, 3100, 4000),
    "EKA1B": DesignLimits(120, 720, 240, 4.5, 10000, 5700, 0.9, 2550, 4000),
    "EKA2": DesignLimits(100, 470, 160, 4.5, 5000, 4000, 0.9, 1700, 4000),
    "EKA3": DesignLimits(80, 280, 90, 6.0, 3000, 2600, 0.9, 1030, 1050),
}
LEAST_CROSSFALL_PERCENT = 2.5
LARGEST_CROSSFALL_PERCENT = 6.0
LONGEST_STRAIGHT = 2000.0


@dataclass(frozen=True)
class StandardCrossSection:
    """Widths of one carriageway of a standard cross-section (RQ), m; lanes from outside to inside."""

    lanes: tuple[float, ...]
    hard_shoulder: float
    outer_edge_strip: float
    inner_edge_strip: float
    median: float
    verge: float = 1.5

    @property
    def paved_width(self) -> float:
        """Return the width of one carriageway from the inner edge strip to the hard shoulder, m."""
        return math.fsum(self.lanes) + self.hard_shoulder + self.outer_edge_strip + self.inner_edge_strip


STANDARD_CROSS_SECTIONS = {
    "RQ43.5": StandardCrossSection((3.75, 3.75, 3.5, 3.5), 2.5, 0.5, 0.75, 4.0),
    "RQ38.5": StandardCrossSection((3.5, 3.5, 3.25, 3.25), 2.0, 0.5, 0.5, 2.5),
    "RQ36": StandardCrossSection((3.75, 3.5, 3.5), 2.5, 0.5, 0.75, 4.0),
    "RQ31.5": StandardCrossSection((3.5, 3.25, 3.25), 2.0, 0.5, 0.5, 2.5),
    "RQ31": StandardCrossSection((3.75, 3.75), 3.0, 0.75, 0.75, 4.0),
    "RQ28": StandardCrossSection((3.5, 3.5), 2.5, 0.5, 0.5, 4.0),
    "RQ25": StandardCrossSection((3.5, 3.25), 2.0, 0.5, 0.5, 2.5),
}


SECTIONS_OF_CLASS = {
    "EKA1A": ("RQ43.5", "RQ36", "RQ31"),
    "EKA1B": ("RQ43.5", "RQ36", "RQ31", "RQ28"),
    "EKA2": ("RQ36", "RQ31", "RQ28"),
    "EKA3": ("RQ38.5", "RQ31.5", "RQ25"),
}
"""Design class -> standard cross-sections that it may have."""
USUAL_SECTION = {"EKA1A": "RQ31", "EKA1B": "RQ31", "EKA2": "RQ28", "EKA3": "RQ25"}
"""Design class -> the cross-section that it has where none is given: of two lanes each way."""


def design_class_of(cross_section: str, preferred: str) -> str:
    """Return the preferred design class if it may have a cross-section, else the first one that may.

    Example:
        >>> design_class_of("RQ31", preferred="EKA1A"), design_class_of("RQ25", preferred="EKA1A")
        ('EKA1A', 'EKA3')
    """
    if cross_section in SECTIONS_OF_CLASS[preferred]:
        return preferred
    return next(name for name, sections in SECTIONS_OF_CLASS.items() if cross_section in sections)


def curve_crossfall_percent(design_class: str, curvature: float) -> float:
    """Return the crossfall (%) towards the inside of a curve: 6 at the smallest radius, 2.5 from the largest.

    In between linear in log radius against log crossfall, rounded up to half a percent.

    Example:
        >>> [float(curve_crossfall_percent("EKA1A", 1 / radius)) for radius in (900.0, 2000.0, 5000.0)]
        [6.0, 3.5, 2.5]
    """
    limits = LIMITS[design_class]
    radius = 1.0 / max(abs(curvature), 1e-9)
    share = math.log(radius / limits.radius) / math.log(limits.radius_least_crossfall / limits.radius)
    change = math.log(LEAST_CROSSFALL_PERCENT / LARGEST_CROSSFALL_PERCENT)
    exact = LARGEST_CROSSFALL_PERCENT * math.exp(change * min(1.0, max(0.0, share)))
    return math.ceil(2.0 * exact - 1e-9) / 2.0


DELINEATOR_SPACING = ((20.0, 3.0), (50.0, 5.0), (100.0, 10.0), (300.0, 20.0), (600.0, 50.0))
"""Radius (m) and the spacing of delineators (m) outside the curve; 50 m from 600 m on."""

# --- turnouts (RAA; all unconfirmed but the interchange spacing) ---------------------------------------------------

TURNOUT_LANE_LENGTH = {"EKA1A": 250.0, "EKA1B": 250.0, "EKA2": 200.0, "EKA3": 150.0}
"""Shortest deceleration or acceleration lane, m."""
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
INTERCHANGE_SPACING = {"EKA1A": 8000.0, "EKA1B": 5000.0, "EKA2": 5000.0, "EKA3": 0.0}
"""Least distance between two exits, or two entries, of one carriageway, m."""
LANE_TAPER_LENGTH = {"EKA1A": 120.0, "EKA1B": 120.0, "EKA2": 100.0, "EKA3": 80.0}
"""Shortest stretch over which a lane begins or ends, m."""

# --- earthworks and drainage (RAA, RAS-Ew; unconfirmed) ---------------------------------------------------------------

SWALE_DEPTH_SHARE = 0.2
"""Depth of a swale as a share of its width."""

# --- barriers (RPS) -----------------------------------------------------------------------------------------------

EMBANKMENT_HEIGHT, EMBANKMENT_RUN = 3.0, 3.0
"""An embankment higher (m) and steeper (run per height) than this needs barriers."""
TIGHT_CURVE = 1.25
"""Arcs of a radius below this times the design class's smallest have a barrier on their outer side (unconfirmed)."""
OBSTACLE_DISTANCE = {"EKA1A": 12.0, "EKA1B": 12.0, "EKA2": 12.0, "EKA3": 7.5}
"""From the paved edge: nearer than this (m), an obstacle (pier, gantry post, pole, noise barrier, tree, board on thick
posts) needs a barrier in front of it."""
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
