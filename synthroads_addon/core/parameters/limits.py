"""Limits of the RAA 2008 by design class, and the standard cross-sections: the one table of both.

The limits are those that secondary sources print of the RAA; the crossfall over the radius, which the RAA shows as a
diagram, is derived from the shares of friction at its ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class DesignLimits:
    """Limits of one design class.

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
    """One direction of an RQ, m; lanes from outside to inside."""

    lanes: tuple[float, ...]
    hard_shoulder: float
    outer_edge_strip: float
    inner_edge_strip: float
    median: float
    verge: float = 1.5

    @property
    def paved_width(self) -> float:
        """Return the width from the inner edge strip to the hard shoulder, m."""
        return sum(self.lanes) + self.hard_shoulder + self.outer_edge_strip + self.inner_edge_strip


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


def design_class_of(cross_section: str, preferred: str) -> str:
    """Return the preferred design class if it may have a cross-section, else the first one that may."""
    if cross_section in SECTIONS_OF_CLASS[preferred]:
        return preferred
    return next(name for name, sections in SECTIONS_OF_CLASS.items() if cross_section in sections)


def curve_crossfall_percent(design_class: str, curvature: float) -> float:
    """Return the crossfall (%) towards the inside of a curve: 6 at the smallest radius, 2.5 from the largest.

    In between linear in log radius against log crossfall, rounded up to half a percent.
    """
    limits = LIMITS[design_class]
    radius = 1.0 / max(abs(curvature), 1e-9)
    ends = np.log([limits.radius, limits.radius_least_crossfall])
    values = np.log([LARGEST_CROSSFALL_PERCENT, LEAST_CROSSFALL_PERCENT])
    exact = float(np.exp(np.interp(np.log(radius), ends, values)))
    return float(np.ceil(2.0 * exact - 1e-9) / 2.0)


DELINEATOR_SPACING = ((20.0, 3.0), (50.0, 5.0), (100.0, 10.0), (300.0, 20.0), (600.0, 50.0))
"""Radius (m) and the spacing of delineators (m) outside the curve; 50 m from 600 m on."""
