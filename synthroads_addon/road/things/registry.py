"""All things of a road: those of the files beside this one, and the limits that they are sampled within."""

from collections.abc import Iterator

from pydantic import create_model

from ...base.discovery import discover_models
from ...base.schema import ClosedModel
from .limits import Limits
from .thing import Thing

THINGS = discover_models(__package__, Thing, "type")
"""Type in the parameter set and model of every thing."""


def limits_of(group: str = "") -> Iterator[tuple[type[Thing], type[Limits]]]:
    """Yield (thing class, its limits class) in the limits' order: all things with limits, or those of one group."""
    pairs = [(thing, thing.limits) for thing in THINGS.values() if thing.limits is not None]
    yield from sorted((pair for pair in pairs if group in ("", pair[1].group)), key=lambda pair: pair[1].place)


def limits_model(name: str, group: str, base: type[ClosedModel]) -> type[ClosedModel]:
    """Return a new pydantic class, a part of the scenario: the fields of its base, then of its things' limits."""
    # Of several bases pydantic takes the fields of the last first.
    bases = (*reversed([limits for _, limits in limits_of(group)]), base)
    return create_model(name, __base__=bases, __doc__=base.__doc__, __module__=__name__)
