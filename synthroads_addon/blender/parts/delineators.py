"""Delineator posts."""

from __future__ import annotations

import numpy as np

from ...core.parameters.model import Delineator
from ..materials import material
from ..model_builder import ModelBuilder
from ..nodes.delineator import delineator_group


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
