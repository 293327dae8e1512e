"""Small things beside the road: files of this folder register what plans them by `small_thing`."""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import NamedTuple

import numpy as np

from .layout import Layout

Plan = Callable[[Layout, np.random.Generator], None]
_LAST = 1000
"""Order of a plan that has none."""


class SmallThing(NamedTuple):
    """Registered plan of small things, which the layout builds once the barriers stand.

    Attributes:
        order, stream: its place among the plans, and the name of its random numbers; plans of one name share them.
        plan: puts the things' spots into a layout.
    """

    order: int
    stream: str
    plan: Plan


_PLANS: list[SmallThing] = []


def small_thing(stream: str, order: int = _LAST) -> Callable[[Plan], Plan]:
    """Return a decorator that registers a plan of small things, by the safety rules and at random alike.

    Args:
        stream: name of its random numbers; one of its own, so that no other thing changes with it.
        order: place among the plans.
    """

    def register(plan: Plan) -> Plan:
        """Add a plan to the registered ones, and return it unchanged."""
        _PLANS.append(SmallThing(order, stream, plan))
        return plan

    return register


@cache
def small_things() -> tuple[SmallThing, ...]:
    """Return all registered plans of small things in their order, their files imported once."""
    for file in iter_modules(import_module(__package__).__path__):
        import_module(f"{__package__}.{file.name}")
    return tuple(sorted(_PLANS, key=lambda item: item[:2]))
