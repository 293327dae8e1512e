"""Catalogue of learning, with key figures; read without PyTorch."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from synthroads_addon.base.catalogue import Entry, Kind, figures
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import read_yaml

from .cards import model_names, read_card
from .configuration import EXPERIMENTS, SHIPPED, Schedule, names_in, shipped_file
from .data.classes import MAPPINGS, load_mapping
from .data.yardsticks import YARDSTICKS, load_yardstick

_YAML = (".yaml", ".yml", ".json")


def _training(name: str) -> Entry:
    """Return the entry of a shipped training: its task, epochs and the data that it learns from."""
    file = shipped_file("configuration", SHIPPED, name)
    data = _object(file)
    section = data.get("data")
    sources = section if isinstance(section, dict) else {}
    key_figures = {
        "task": data.get("task"),
        "epochs": Schedule.from_dict(data.get("schedule", {}), f"{name}: schedule").epochs,
        "data": _paths([sources.get(key, ()) for key in ("data_sets", "measured", "synthetic", "real")]),
    }
    return Entry(name, str(data.get("title", "")), file, key_figures)


def _experiment(name: str) -> Entry:
    """Return the entry of a shipped experiment: its configuration and the names of its variants."""
    file = shipped_file("experiment", EXPERIMENTS, name)
    data = _object(file)
    variants = data.get("variants")
    key_figures = {
        "configuration": data.get("configuration"),
        "variants": list(variants) if isinstance(variants, dict) else [],
    }
    return Entry(name, str(data.get("title", "")), file, key_figures)


def _model(name: str) -> Entry:
    """Return the entry of a shipped model: its task, domain, size, figures and limits."""
    card = read_card(name)
    least_density, largest_density = card.domain.density
    megabytes = round(card.weights.stat().st_size / 1e6, 2) if card.weights.is_file() else None
    key_figures = {
        "task": card.task,
        "density": f"{least_density:g} to {largest_density:g}",
        "platforms": list(card.domain.platforms),
        "ground_only": card.domain.ground_only,
        "megabytes": megabytes,
        "figures": [figure.to_dict() for figure in card.figures],
        "limits": list(card.limits),
    }
    return Entry(name, card.title, card.weights.with_suffix(".json"), key_figures, " ".join(card.limits))


def _mapping(name: str) -> Entry:
    """Return the entry of a shipped mapping of classes: the attribute that it reads, and its classes."""
    mapping = load_mapping(name)
    key_figures = {"field": mapping.field, "classes": list(dict.fromkeys(mapping.classes.values()))}
    return Entry(name, mapping.title, shipped_file("mapping", MAPPINGS, name, [".json"]), key_figures)


def _yardstick(name: str) -> Entry:
    """Return the entry of a public data set: the form of its files, its splits and classes."""
    yardstick = load_yardstick(name)
    key_figures = {
        "form": yardstick.form,
        "splits": list(yardstick.splits),
        "classes": list(dict.fromkeys(yardstick.mapping.classes.values())),
    }
    return Entry(
        name, yardstick.title, shipped_file("yardstick", YARDSTICKS, name, [".json"]), key_figures, yardstick.source
    )


def _object(file: Path) -> Mapping[str, Any]:
    """Return the content of a YAML file; InputError unless it is an object."""
    data = read_yaml(file)
    if not isinstance(data, dict):
        raise InputError(str(file), None, "must be an object")
    return data


def _paths(data: Any) -> list[str]:
    """Return a flat list of the paths in nested lists of paths and of objects with a `path` or `cloud`."""
    if isinstance(data, str):
        return [data]
    if isinstance(data, dict):
        return _paths(data.get("path", data.get("cloud", ())))
    return [path for part in data for path in _paths(part)] if isinstance(data, (list, tuple)) else []


KINDS = {
    "trainings": Kind(
        "Trainings",
        "synthroads train NAME",
        partial(names_in, SHIPPED),
        _training,
        _YAML,
        ("what it is", "task", "epochs", "learned from"),
        figures("task", "epochs", "data"),
    ),
    "experiments": Kind(
        "Experiments",
        "synthroads experiment NAME",
        partial(names_in, EXPERIMENTS),
        _experiment,
        _YAML,
        ("what it is", "from", "variants"),
        figures("configuration", "variants", variants="; ".join),
    ),
    "models": Kind(
        "Trained models that come with the package",
        "synthroads predict NAME CLOUD, synthroads centerline CLOUD --run NAME",
        model_names,
        _model,
        (".json",),
        ("what it is", "task", "points/m2", "platforms", "MB"),
        figures("task", "density", "platforms", "megabytes"),
    ),
    "mappings": Kind(
        "Mappings of the classes of others",
        "synthroads evaluate --mapping NAME",
        partial(names_in, MAPPINGS),
        _mapping,
        (".json",),
        ("what it is", "attribute", "classes"),
        figures("field", "classes"),
    ),
    "yardsticks": Kind(
        "Public data sets of others that are evaluated on",
        "synthroads evaluate RUN FOLDER --yardstick NAME",
        partial(names_in, YARDSTICKS),
        _yardstick,
        (".json",),
        ("what it is", "files", "splits", "classes"),
        figures("form", "splits", "classes"),
    ),
}
"""Kinds of learning that can be listed, by name."""
