"""Inputs of a node group as the fields of a class: each is named, limited and described in one place.

A field's name gives the input's: `post_spacing` is "Post Spacing" in Blender. If a group has the same inputs several
times, words in front of the names distinguish them: "Left Lane Line 1 Width".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from itertools import groupby
from typing import Any

from .builder import Tree, Value

INSTANCES = (-(2**31), 2**31 - 1)
"""Limits of instance numbers: 32 bits, with a sign in the nodes and without one elsewhere."""
FAR = (-1000.0, 1000.0)
"""Limits of offsets and heights, m."""


class Input:
    """Descriptor of a field of `Inputs`: reading it gives the value of the group's input.

    Args:
        declare: method of `Tree` that declares the input.
        panel: heading above it in the modifier; neighbouring fields with the same panel share one heading.
        settings: further arguments of the method.
    """

    def __init__(self, declare: Callable[..., Value], panel: str = "", **settings: Any) -> None:
        self.declare, self.panel, self.settings = declare, panel, settings
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, inputs: Inputs, owner: type | None = None) -> Value:
        return inputs.values[self.name]


class Inputs:
    """Inputs of a node group; a subclass has them as fields, after those of its bases.

    Args:
        tree: the group in which they are declared.
        words: words in front of each input's name.
        heading: heading of the fields that have no panel.
        defaults: default values, by field, that replace the fields' own.

    Attributes:
        tree: the group.
        values: the inputs' values by field, as `Tree.call` expects them.
    """

    def __init__(
        self, tree: Tree, words: str = "", heading: str = "", defaults: Mapping[str, float] | None = None
    ) -> None:
        self.tree = tree
        self.values: dict[str, Value] = {}
        for panel, fields in groupby(self.fields(), lambda field: field.panel or heading):
            with tree.panel(panel) if panel else nullcontext():
                for field in fields:
                    settings = dict(field.settings)
                    if defaults and field.name in defaults:
                        settings["default"] = defaults[field.name]
                    self.values[field.name] = field.declare(tree, input_name(field.name, words), **settings)

    @classmethod
    def fields(cls) -> Iterator[Input]:
        """Yield the class's input fields in order, bases first; one that a subclass redeclares keeps its place."""
        fields = {name: item for base in reversed(cls.__mro__) for name, item in vars(base).items()}
        yield from (item for item in fields.values() if isinstance(item, Input))


def inputs_class(name: str, fields: Mapping[str, Input]) -> type[Inputs]:
    """Create a subclass of `Inputs` with fields that are only known when a group is made."""
    return type(name, (Inputs,), dict(fields))


def input_name(field: str, words: str = "") -> str:
    """Return a field's input name, its words in title case, after `words`: "post_spacing" -> "Post Spacing"."""
    name = field.rstrip("_").replace("_", " ").title()
    return f"{words} {name}" if words else name


def number(default: float, limits: tuple[float, float], description: str, *, unit: str = "", panel: str = "") -> Input:
    """Return the field of a float input."""
    return Input(Tree.number, panel, default=default, limits=limits, unit=unit, description=description)


def metres(default: float, limits: tuple[float, float], description: str) -> Input:
    """Return the field of a float input that is a length, m."""
    return number(default, limits, description, unit="m")


def share(default: float, limits: tuple[float, float], description: str, *, panel: str = "") -> Input:
    """Return the field of a float input that is a share, shown as a slider."""
    return number(default, limits, description, unit="share", panel=panel)


def integer(default: int, limits: tuple[int, int], description: str, *, panel: str = "") -> Input:
    """Return the field of an integer input."""
    return Input(Tree.integer, panel, default=default, limits=limits, description=description)


def boolean(default: bool, description: str, *, panel: str = "") -> Input:
    """Return the field of a boolean input."""
    return Input(Tree.boolean, panel, default=default, description=description)


def socket(kind: str, description: str, *, panel: str = "") -> Input:
    """Return the field of an input of a socket kind: ``Geometry``, ``Object``, ``Vector``, ``String``, ..."""
    return Input(Tree.input, panel, kind=kind, description=description)


def material_of(part: str, default: str = "", *, panel: str = "") -> Input:
    """Return the field of an input "Material of `part`", by default an entry of the material table."""
    return Input(Tree.material, panel, default=default, description=f"Material of {part}")


def instance_number() -> Input:
    """Return the field of the integer input for the faces' instance number."""
    return integer(0, INSTANCES, "Instance number of the faces")


def backbone_socket(kind: str = "Geometry") -> Input:
    """Return the field of the input for a road's backbone or a curve, as ``Geometry`` or ``Object``."""
    return socket(kind, "Backbone of a road, or any curve")
