"""Parts of a model: each file or folder beside this one registers the function that builds its part by `model_part`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from pkgutil import walk_packages
from typing import NamedTuple

from .model_builder import ModelBuilder

Build = Callable[[ModelBuilder], None]
_LAST = 1000
"""Order of a part that is registered without one."""


class ModelPart(NamedTuple):
    """A registered part of a road model: its building function and order.

    Attributes:
        order, name: its place in the order of building, and its name.
        build: function that adds its objects to a model.
        on_the_road: whether it needs no terrain; all other parts stand on the terrain.
    """

    order: int
    name: str
    build: Build
    on_the_road: bool


_PARTS: dict[str, ModelPart] = {}


def model_part(name: str, order: int = _LAST, on_the_road: bool = False) -> Callable[[Build], Build]:
    """Return a decorator that registers a function as the builder of a part, in the order of building.

    Raises:
        ValueError: another part has this name.
    """

    def register(build: Build) -> Build:
        part = _PARTS.setdefault(name, ModelPart(order, name, build, on_the_road))
        if part.build is not build:
            raise ValueError(f"{part.build.__module__} and {build.__module__} both have a part named {name!r}")
        return build

    return register


@cache
def model_parts() -> dict[str, ModelPart]:
    """Import all part modules and return the parts by name, in the order of building; cached."""
    for file in walk_packages(import_module(__package__).__path__, f"{__package__}."):
        import_module(file.name)
    return {part.name: part for part in sorted(_PARTS.values(), key=lambda part: part[:2])}


_NO_THINGS = frozenset({"road", "terrain", "painted_areas", "damaged_areas", "vegetation", "vehicles"})
"""Parts that are no things of the registry: what all else stands on, and what belongs to the whole road."""


def thing_parts() -> list[ModelPart]:
    """Return the parts that build things of the registry, each by itself."""
    return [part for name, part in model_parts().items() if name not in _NO_THINGS]


def required_parts(names: set[str]) -> set[str]:
    """Return the parts' names with the names of the road and the terrain, if the parts stand on them."""
    needs_terrain = any(not model_parts()[name].on_the_road for name in names)
    return names | ({"road"} if names else set()) | ({"terrain"} if needs_terrain else set())
