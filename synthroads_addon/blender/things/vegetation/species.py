"""The species of plants: shapes of height 1, as inputs of the node groups."""

from __future__ import annotations

TREES: dict[str, dict[str, float]] = {
    "maple": {
        "Crown Bottom": 0.2, "Crown Radius": 0.35, "Crown Widest": 0.45, "Crown Fullness": 0.5,
        "Branch Rise": 0.7, "Leafy Share": 0.3, "Cluster Radius": 0.12,
        "Leaf Length": 0.042, "Leaf Width": 0.044, "Leaf Order": 0.2, "Leaf Droop": 0.3,
        "Branches": 28, "Leaves": 2300, "Trunk Radius": 0.024,
    },
    "birch": {
        "Crown Bottom": 0.22, "Crown Radius": 0.22, "Crown Widest": 0.35, "Crown Fullness": 0.75,
        "Branch Rise": 1.1, "Leafy Share": 0.45, "Cluster Radius": 0.08,
        "Leaf Length": 0.036, "Leaf Width": 0.024, "Leaf Order": 0.1, "Leaf Droop": 1.2,
        "Branches": 28, "Leaves": 2250, "Trunk Radius": 0.013,
    },
    "poplar": {
        "Crown Bottom": 0.08, "Crown Radius": 0.115, "Crown Widest": 0.4, "Crown Fullness": 0.6,
        "Branch Rise": 3.0, "Leafy Share": 0.6, "Cluster Radius": 0.055,
        "Leaf Length": 0.029, "Leaf Width": 0.026, "Leaf Order": 0.5, "Leaf Droop": 0.0,
        "Branches": 34, "Leaves": 2250, "Trunk Radius": 0.02,
    },
    "spruce": {
        "Crown Bottom": 0.05, "Crown Radius": 0.21, "Crown Widest": 0.06, "Crown Fullness": 0.8,
        "Branch Rise": -0.25, "Leafy Share": 0.9, "Cluster Radius": 0.03,
        "Leaf Length": 0.055, "Leaf Width": 0.024, "Leaf Order": 0.6, "Leaf Droop": 0.5,
        "Branches": 54, "Leaves": 2050, "Trunk Radius": 0.017,
    },
    "pine": {
        "Crown Bottom": 0.52, "Crown Radius": 0.25, "Crown Widest": 0.6, "Crown Fullness": 0.45,
        "Branch Rise": 0.35, "Leafy Share": 0.25, "Cluster Radius": 0.07,
        "Leaf Length": 0.04, "Leaf Width": 0.017, "Leaf Order": 0.35, "Leaf Droop": -0.3,
        "Branches": 17, "Leaves": 2400, "Trunk Radius": 0.018,
    },
}  # fmt: skip
"""Species of tree -> inputs of SR Tree."""

SHRUBS: dict[str, dict[str, float]] = {
    "hawthorn": {
        "Crown Bottom": 0.08, "Crown Radius": 0.48, "Crown Widest": 0.55, "Crown Fullness": 0.45,
        "Leafy Share": 0.5, "Cluster Radius": 0.18,
        "Leaf Length": 0.075, "Leaf Width": 0.075, "Leaf Order": 0.2, "Leaf Droop": 0.1,
        "Branches": 14, "Leaves": 640, "Stem Radius": 0.016,
    },
    "hazel": {
        "Crown Bottom": 0.3, "Crown Radius": 0.46, "Crown Widest": 0.65, "Crown Fullness": 0.5,
        "Leafy Share": 0.5, "Cluster Radius": 0.15,
        "Leaf Length": 0.1, "Leaf Width": 0.095, "Leaf Order": 0.25, "Leaf Droop": 0.5,
        "Branches": 13, "Leaves": 560, "Stem Radius": 0.012,
    },
    "blackthorn": {
        "Crown Bottom": 0.05, "Crown Radius": 0.75, "Crown Widest": 0.4, "Crown Fullness": 0.4,
        "Leafy Share": 0.65, "Cluster Radius": 0.2,
        "Leaf Length": 0.1, "Leaf Width": 0.06, "Leaf Order": 0.4, "Leaf Droop": -0.1,
        "Branches": 18, "Leaves": 700, "Stem Radius": 0.011,
    },
}  # fmt: skip
"""Species of shrub -> inputs of SR Shrub."""

GRASSES: dict[str, dict[str, float]] = {
    "meadow": {
        "Blades": 10, "Blade Width": 0.11, "Spread": 0.28, "Lean": 1.1, "Stalks": 1, "Ear Width": 0.06,
        "Blade Height": 0.85,
    },
    "ryegrass": {
        "Blades": 8, "Blade Width": 0.08, "Spread": 0.22, "Lean": 0.75, "Stalks": 2, "Ear Width": 0.04,
        "Blade Height": 0.8,
    },
    "reed": {
        "Blades": 6, "Blade Width": 0.07, "Spread": 0.25, "Lean": 0.5, "Stalks": 3, "Ear Width": 0.07,
        "Blade Height": 0.9,
    },
}  # fmt: skip
"""Species of grass -> inputs of SR Grass."""
