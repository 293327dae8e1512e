"""Cross-sections and outlines of furniture that its parameters don't give: the 3D model's and the twin's alike."""

from __future__ import annotations

GUARDRAIL_BEAM = (
    (0.010, 0.000), (0.040, -0.006), (0.074, -0.030), (0.081, -0.052), (0.074, -0.080), (0.012, -0.124),
    (0.003, -0.140), (0.003, -0.170), (0.012, -0.186), (0.074, -0.230), (0.081, -0.258), (0.074, -0.280),
    (0.040, -0.304), (0.010, -0.310),
)  # fmt: skip
"""A guardrail's beam, the A profile of 0.31 m: depth towards traffic, height under its top edge (m)."""
GUARDRAIL_POST = (0.10, 0.055)
"""A guardrail's post: across the road, along it (m)."""
GUARDRAIL_POST_TOP = 0.03
"""A guardrail's posts end so far (m) below the top of its beam."""
GUARDRAIL_LOWEST_POST = 0.15
"""Where the beam's top is lower than this (m), a terminal has no posts."""
GUARDRAIL_TIP = -0.02
"""Top of a guardrail's beam at its very ends above the surface, m."""
GUARDRAIL_SPACER = {"left": 0.07, "right": 0.07, "both": 0.20}
"""Distance between posts and beam, m: a single rail's face stands 0.2 m from the posts' axis."""

CONCRETE_FLANKS = {
    "step": ((1.0, 0.0), (0.945, 0.275), (0.70, 0.29), (0.445, 0.972), (0.40, 1.0)),
    "new_jersey": ((1.0, 0.0), (1.0, 0.095), (0.44, 0.41), (0.31, 0.972), (0.265, 1.0)),
}
"""One flank of a concrete barrier from the foot to the top, as shares of half the foot's width and of the height
(EN 1317 barriers of 0.54 m x 0.90 m and 0.60 m x 0.81 m)."""
CONCRETE_TIP = 0.08
"""Height at which a concrete barrier's ramped end breaks off, m."""

TEMPORARY_FLANKS = {
    "steel": (
        (1.0, -0.02), (1.0, 0.05), (0.5, 0.17), (0.3, 0.3), (0.3, 0.62), (0.5, 0.72), (0.5, 0.92), (0.36, 1.0),
    ),
    "plastic": (
        (1.0, -0.02), (1.0, 0.16), (0.66, 0.4), (0.58, 0.62), (0.62, 0.66), (0.62, 0.78), (0.55, 0.82), (0.45, 1.0),
    ),
}  # fmt: skip
"""One flank of a movable barrier's element, as those of concrete barriers; a little sunk."""
TEMPORARY_GAP = 0.03
"""Gap between two elements of a movable barrier, m."""
LONGEST_PLASTIC = 2.5
"""Elements up to this length (m) are of plastic, by turns red and white; longer ones are of steel."""
SHORTEST_ELEMENT = 0.1
"""A rest of this share of an element (of a bay of a noise barrier) makes the last one longer instead of one more."""

DELINEATOR = (
    (-0.06, -0.050), (-0.045, -0.055), (0.05, -0.014), (0.06, 0.0), (0.05, 0.014), (-0.045, 0.055), (-0.06, 0.05),
)  # fmt: skip
"""A delineator's cross-section from above, x away from the road, y along the driver's way: a triangle 0.12 m wide."""

_OCTAGON = 0.20710678118654752
SIGN_OUTLINES = {
    "rectangle": ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)),
    "triangle": ((0.0, 0.5), (-0.5, -0.5), (0.5, -0.5)),
    "octagon": (
        (0.5, _OCTAGON), (_OCTAGON, 0.5), (-_OCTAGON, 0.5), (-0.5, _OCTAGON),
        (-0.5, -_OCTAGON), (-_OCTAGON, -0.5), (_OCTAGON, -0.5), (0.5, -_OCTAGON),
    ),
    "arrow": ((0.5, 0.0), (0.3, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.3, -0.5)),
}  # fmt: skip
"""Corners of a sign's face, anticlockwise, in shares of its width and height around the middle; others are round."""
SIGN_RAIL = 0.04
"""Depth of the rails between a sign's face and its posts, m."""
KILOMETRE_POST = 0.042
"""Diameter of a kilometre board's post, m."""

TRAFFIC_LIGHT_POST = 0.089
"""Diameter of a traffic light's post, m."""

BEACON_FOOT = (0.40, 0.80, 0.11)
"""A beacon's rubber foot: across the blade, along the road, height (m)."""
BEACON_BLADE_BOTTOM = 0.16
"""Lower edge of a beacon's blade above the surface, m."""
BEACON_BLADE = 0.045
"""Thickness of a beacon's blade, m."""

GANTRY_HANGER = 0.18
"""Distance between a gantry's beam and its boards, m."""
GANTRY_BOARD, GANTRY_DISPLAY = 0.05, 0.28
"""Depth of a painted board and of a display, m."""
GANTRY_OVERHANG = 0.3
"""Share of what a board is higher than a gantry's beam that hangs below it."""

BRIDGE_DECK = ((0.18, 0.6), (0.24, 0.0), (0.52, 0.0), (0.6, 0.62), (0.985, 0.78), (0.985, 1.0))
"""Half of a deck's section, from the middle of the lower side to the top: shares of half its width, of its height."""
BRIDGE_SEAT = 0.9
"""Depth of an abutment's bearing seat, m."""
BRIDGE_ABUTMENT = 1.5
"""Depth of an abutment, m."""
BRIDGE_BEARING = 0.1
"""Height of a bridge's bearings, m."""
BRIDGE_PIER_LENGTH = 0.5
"""Length of a pier as a share of the deck's width."""
BRIDGE_BURIED = 0.8
"""Depth of a bridge's walls and piers below the ground, m."""

#: From a guardrail's axis to the face of its beam, and to the rear of its posts, m.
BEAM_REACH, POST_REACH = 0.2, 0.05
#: Half the width of a delineator, and half the depth of a sign's face, a board's post and a beacon, m.
DELINEATOR_REACH, FACE_REACH, BOARD_POST_REACH, BEACON_REACH = 0.06, 0.03, 0.03, 0.1
