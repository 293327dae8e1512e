"""Networks by task and name: each file in a task's folder of networks registers its own by the decorator `network`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, TypeVar

from synthroads_addon.base.discovery import discriminated_union

from .configuration import Part

P = TypeVar("P", bound=Part)

FOLDERS = {"segmentation": "ml.networks.segmentation", "centerline": "ml.networks.centerline"}
"""Task -> package whose files are looked through for its networks."""
_NETWORKS: dict[str, dict[str, type[Part]]] = {task: {} for task in FOLDERS}


def network(task: str) -> Callable[[type[P]], type[P]]:
    """Register a network's options, which know how to build it, under the one value of their field ``name``.

    Args:
        task: that it learns, out of `FOLDERS`.

    Raises:
        ValueError: another network of the task has this name.
    """

    def register(options: type[P]) -> type[P]:
        name = options.model_fields["name"].default
        known = _NETWORKS[task].setdefault(name, options)
        if known is not options:
            raise ValueError(f"{known.__module__} and {options.__module__} both have a network named {name!r}")
        return options

    return register


def networks(task: str) -> dict[str, type[Part]]:
    """Return the options of all networks of a task by name, those of its folder's files included."""
    for file in iter_modules(import_module(FOLDERS[task]).__path__):
        import_module(f"{FOLDERS[task]}.{file.name}")
    return dict(sorted(_NETWORKS[task].items()))


def network_union(task: str, usual: str) -> Any:
    """Return the type of a configuration's field ``network``: any of a task's; the usual one where it has no name."""
    models = networks(task)
    return discriminated_union({usual: models[usual], **models}, "name")
