"""Delineator posts."""

from __future__ import annotations

import numpy as np

from ...road.parameters import Delineator
from ..materials import material
from ..things.delineator import delineator_group
from ..things.model_builder import ModelBuilder


def build_delineators(builder: ModelBuilder) -> None:
    """Make all delineator posts as one object."""
    posts = list(builder.parameters.of_type(Delineator).values())
    if not posts:
        return
    inputs = {
        **builder.surfaces(),
        "White Material": material("plastic_white"),
        "Black Material": material("plastic_black"),
        "Reflector Material": material("reflector"),
    }
    heights = np.array([post.height for post in posts])
    builder.add("Delineators", builder.points("Delineators", posts, {"height": heights}), delineator_group(), inputs)
