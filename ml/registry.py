"""Networks and effects by task: each registers itself by a decorator, in a file that is found by its folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, TypeVar

import numpy as np
from pydantic import create_model

from synthroads_addon.base.discovery import discriminated_union

from .configuration import Part

P = TypeVar("P", bound=Part)

FOLDERS = {"segmentation": "ml.networks.segmentation", "centerline": "ml.networks.centerline"}
"""Task -> package whose files are looked through for its networks."""
EFFECTS = "ml.data.effects"
"""Package whose files are looked through for effects of all tasks."""
_NETWORKS: dict[str, dict[str, type[Part]]] = {task: {} for task in FOLDERS}
_EFFECTS: dict[str, dict[str, Effect]] = {task: {} for task in FOLDERS}
Change = Callable[[Any, Any, np.random.Generator], None]
"""Function that changes a `Sample` in place: called with the sample, the options of effects and a random stream."""
F = TypeVar("F", bound=Change)


@dataclass(frozen=True)
class Effect:
    """A registered augmentation of training samples.

    Attributes:
        change: function that changes a sample.
        order: effects with a lower order come first, those below 0 before a sample is thinned out.
        fields: fields that the effect adds to the options.
    """

    change: Change
    order: int
    fields: Mapping[str, Any]


def network(task: str) -> Callable[[type[P]], type[P]]:
    """Return a class decorator that registers a network's options for a task, by the default of their ``name``.

    Args:
        task: task of the network, out of `FOLDERS`.

    Raises:
        ValueError: another network of the task has this name.
    """

    def register(options: type[P]) -> type[P]:
        """Register a class of options under the default of its ``name``."""
        _register(_NETWORKS[task], options.model_fields["name"].default, options, options.__module__)
        return options

    return register


def networks(task: str) -> dict[str, type[Part]]:
    """Return the options classes of all networks of a task by name, importing the files of its folder."""
    _import_files(FOLDERS[task])
    return dict(sorted(_NETWORKS[task].items()))


def network_union(task: str, default: str) -> Any:
    """Return the type annotation of a field ``network``: options of any network of a task, `default` without a name."""
    models = networks(task)
    return discriminated_union({default: models[default], **models}, "name")


def effect(*tasks: str, order: int = 100, **fields: Any) -> Callable[[F], F]:
    """Return a decorator that registers a function as an augmentation of some tasks, under the function's name.

    Args:
        tasks: tasks on whose samples the effect acts, out of `FOLDERS`.
        order: order of the effect (`Effect`); those that come with the package are below 100.
        fields: fields declared by `quantity`, with a default at which the effect does and draws nothing. A
            configuration's ``effects`` get them.

    Raises:
        ValueError: another effect of a task has this name.
    """

    def register(change: F) -> F:
        """Register a function for each of the tasks."""
        for task in tasks:
            _register(_EFFECTS[task], change.__name__, Effect(change, order, fields), change.__module__)
        return change

    return register


def effect_options(task: str, base: type[P]) -> type[P]:
    """Return a subclass of `base`'s options with the fields that registered effects of a task add."""
    _import_files(EFFECTS)
    new_fields = {name: field for effect in _EFFECTS[task].values() for name, field in effect.fields.items()}
    fields: Any = {name: (type(field.default), field) for name, field in new_fields.items()}
    return create_model(base.__name__, __base__=base, __module__=EFFECTS, __doc__=base.__doc__, **fields)


def apply_effects(
    task: str, sample: Any, options: Part, random: np.random.Generator, *, before_thinning: bool = False
) -> None:
    """Apply a task's effects to a sample in order, in place: of order below 0 if `before_thinning`, else the others."""
    for effect in sorted(_EFFECTS[task].values(), key=lambda item: item.order):
        if (effect.order < 0) == before_thinning:
            effect.change(sample, options, random)


def _register(registered: dict[str, Any], name: str, thing: Any, module: str) -> None:
    """Add a named network or effect to a table; ValueError if another one has the name."""
    if registered.setdefault(name, thing) is not thing:
        first_module = getattr(registered[name], "change", registered[name]).__module__
        kind = "effect" if isinstance(thing, Effect) else "network"
        raise ValueError(f"{first_module} and {module} both have the {kind} {name!r}")


def _import_files(package: str) -> None:
    """Import all modules of a package, which register what they define."""
    for file in iter_modules(import_module(package).__path__):
        import_module(f"{package}.{file.name}")
