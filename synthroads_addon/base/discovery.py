"""Models that are found by the files of a folder, so that a new file is all that a new kind costs."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Any, TypeVar, Union

from pydantic import BaseModel, BeforeValidator, Field

M = TypeVar("M", bound=BaseModel)
_LAST = 1000
"""Order of a model that has none."""


def discover_models(package: str, base: type[M], tag: str) -> dict[str, type[M]]:
    """Return tag -> pydantic model of all modules of a package, by the one value of each model's field ``tag``.

    They are ordered by their attribute ``order``; those without one come last, by name.

    Args:
        package: full name of the folder's package.
        base: class that all of them are made from.
        tag: field by which JSON data names the model, e.g. ``type``; a class without a value for it is none.

    Raises:
        ValueError: two models have the same value.
    """
    models: dict[str, type[M]] = {}
    for name, model in sorted(_tagged_models(package, base, tag), key=_place):
        if name in models:
            raise ValueError(f"{models[name].__module__} and {model.__module__} both have the {tag} {name!r}")
        models[name] = model
    return models


def discriminated_union(models: Mapping[str, type[BaseModel]], tag: str) -> Any:
    """Return the annotation of a field that holds one of several models, told apart by a tag; by default the first.

    A field that only other models have is refused with their names.

    Args:
        models: of `discover_models`.
        tag: field by which they differ.
    """

    def prepare(data: Any) -> Any:
        """Return a field's data with the tag filled in; ValueError for a field that only other models have."""
        if not isinstance(data, dict):
            return data
        if data.get(tag) is None:
            data = data | {tag: next(iter(models))}
        model = models.get(str(data[tag]))
        for key in data if model else ():
            others = [name for name, other in models.items() if key in other.model_fields]
            if others and data[tag] not in others:
                raise ValueError(f"{key} can't be given for {data[tag]}, only for {', '.join(others)}")
        return data

    return Annotated[Union[tuple(models.values())], Field(discriminator=tag), BeforeValidator(prepare)]  # noqa: UP007


def _place(pair: tuple[str, type[BaseModel]]) -> tuple[int, str]:
    """Return the sort key of a (name, model): the model's order, then the name."""
    return getattr(pair[1], "order", _LAST), pair[0]


def _tagged_models(package: str, base: type[M], tag: str) -> Iterator[tuple[str, type[M]]]:
    """Yield (tag's value, model) of the models that are defined in a package's modules."""
    for file in iter_modules(import_module(package).__path__):
        module = import_module(f"{package}.{file.name}")
        for model in vars(module).values():
            if isinstance(model, type) and issubclass(model, base) and model.__module__ == module.__name__:
                field = model.model_fields.get(tag)
                if field is not None and isinstance(field.default, str):
                    yield field.default, model
