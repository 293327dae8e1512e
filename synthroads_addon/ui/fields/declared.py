"""Declarations of the scenario's fields as the panel is set: which kind of a part is chosen decides what a field is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ...base.schema import note_of
from ...base.typed_text import alternatives
from ...scenario.road import Interval
from ...scenario.scenario import Scenario

BY_HAND = "BY_HAND"
"""Item of a choice that stands for a part by hand."""
BY_HAND_ENDING = "_by_hand"
"""Ending of the property of a part by hand, beside the choice of a standard one."""


class Declaration(NamedTuple):
    """A field of the schema, the model that declares it, and the property group beside it."""

    info: FieldInfo
    model: type[BaseModel]
    owner: Any

    @property
    def is_interval(self) -> bool:
        """Return whether it holds the two ends of an interval."""
        return Interval in alternatives(self.info.annotation)


def declaration(settings: Any, path: str) -> Declaration | None:
    """Return the declaration of a field as the panel is set; None if the chosen kind of its part has no such field."""
    *parts, name = path.split(".")
    model: type[BaseModel] = Scenario
    owner = settings
    for part in parts:
        owner = getattr(owner, part)
        info = model.model_fields[part.removesuffix(BY_HAND_ENDING)]
        model = _chosen_model([kind for kind in alternatives(info.annotation) if _is_part(kind)], owner)
    info_of_field = model.model_fields.get(name)
    return None if info_of_field is None else Declaration(info_of_field, model, owner)


def _chosen_model(models: list[type[BaseModel]], owner: Any) -> type[BaseModel]:
    """Return the model, of the kinds of a part, whose constants its property group shows."""
    for model in models:
        constants = {name: info.default for name, info in model.model_fields.items() if is_constant(info)}
        if all(getattr(owner, name) == value for name, value in constants.items()):
            return model
    return models[0]


def is_constant(info: FieldInfo) -> bool:
    """Return whether a field can have one value only, as the tag of a kind."""
    return get_origin(info.annotation) is Literal and len(get_args(info.annotation)) == 1


def optional_fields(model: type[BaseModel] = Scenario, path: str = "") -> Iterator[str]:
    """Yield the paths of all fields that may be left out."""
    for name, info in model.model_fields.items():
        kinds = list(alternatives(info.annotation))
        if type(None) in kinds:
            yield f"{path}{name}"
        for kind in kinds:
            if _is_part(kind):
                yield from optional_fields(kind, f"{path}{name}.")


def _is_part(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel) and kind is not Interval


def has_effect(settings: Any, path: str) -> bool:
    """Return whether a field means something as the panel is set; the schema says it with ``only_with``."""
    declared = declaration(settings, path)
    if declared is None:
        return False
    needed = (note_of(declared.info, "only_with") or {}).items()
    return all(getattr(declared.owner, name) in values for name, values in needed)
