"""`Recipe`: a data set in one file: groups of scenes, each scene with a seed of its own."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from ..base.errors import InputError
from ..base.files import PRESETS, preset_names, preset_path
from ..base.random_streams import stream
from ..base.schema import ClosedModel, Finite, first_repeated, quantity, read_yaml
from ..scenario.scenario import Scenario, load_scenario, with_changes

RECIPES = PRESETS / "recipes"

Layout = Literal["pointcept", "semantickitti"]
Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,60}$")]
Split = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,30}$")]

NEEDED_OUTPUTS = ("parameters", "cloud", "centerline")
_UNSTABLE = "scene"
"""A .blend file is never the same twice, so that its checksum would say nothing."""
LARGEST_SEED = 2**63
_DIGITS = 4
"""Digits of drawn numbers: enough to tell them apart, and few enough to read."""


class DrawnValue(ClosedModel):
    """Values of a field of which each scene draws one: any number of a range, or one of some values."""

    minimum: Finite | None = Field(None, description="Smallest number that is drawn.")
    maximum: Finite | None = Field(None, description="Largest number that is drawn.")
    scale: Literal["linear", "logarithmic"] = Field(
        "linear", description="All numbers of a range are as likely, or all ratios."
    )
    one_of: tuple[Any, ...] = Field((), description="Values that are drawn alike often, instead of a range.")

    @model_validator(mode="after")
    def _check_range(self) -> Self:
        """Refuse neither or both of a range and values, an empty range, and ratios of numbers up to 0."""
        limits = (self.minimum, self.maximum)
        if self.one_of:
            if limits != (None, None):
                raise ValueError("one_of and a range, minimum and maximum, can't both be given")
        elif None in limits:
            raise ValueError("minimum and maximum, or one_of, must be given")
        elif self.minimum >= self.maximum:  # type: ignore[operator]
            raise ValueError(f"minimum {self.minimum:g} must be below maximum, {self.maximum:g}")
        elif self.scale == "logarithmic" and self.minimum <= 0.0:  # type: ignore[operator]
            raise ValueError(f"minimum {self.minimum:g} must be above 0 on a logarithmic scale")
        return self

    def draw(self, random: np.random.Generator) -> Any:
        """Return a value, a number of a range to `_DIGITS` digits.

        Example:
            >>> import numpy as np
            >>> visibility = DrawnValue(minimum=500.0, maximum=23_000.0, scale="logarithmic")
            >>> 500.0 <= visibility.draw(np.random.default_rng(1)) <= 23_000.0
            True
        """
        if self.one_of:
            return self.one_of[int(random.integers(len(self.one_of)))]
        assert self.minimum is not None
        assert self.maximum is not None
        share = float(random.random())
        if self.scale == "logarithmic":
            value = self.minimum * (self.maximum / self.minimum) ** share
        else:
            value = self.minimum + share * (self.maximum - self.minimum)
        return min(max(float(f"{value:.{_DIGITS}g}"), self.minimum), self.maximum)

    def text(self) -> str:
        """Return the range or the values in words, for people.

        Example:
            >>> DrawnValue(minimum=500.0, maximum=23_000.0, scale="logarithmic").text()
            '500 to 23000, by ratio'
        """
        if self.one_of:
            return "one of " + ", ".join(json.dumps(value) for value in self.one_of)
        return f"{self.minimum:g} to {self.maximum:g}" + (", by ratio" if self.scale == "logarithmic" else "")


Draws = dict[str, DrawnValue]


def path_within(path: str, other_path: str) -> bool:
    """Return whether a field, by its dotted path, is another one or a part of it."""
    return path == other_path or path.startswith(f"{other_path}.")


def _check_draws(set_paths: Iterable[str], drawn_paths: Iterable[str]) -> None:
    """Refuse a field that is drawn and also set, as a whole or in part, in the same place."""
    for path, drawn_path in product(set_paths, drawn_paths):
        if path_within(path, drawn_path):
            raise ValueError(f"set and draw both name {path}")


class SceneGroup(ClosedModel):
    """Scenes that differ in their seeds, variants and drawn values."""

    name: Name = Field(description="Name of the group; its scenes are NAME-01, NAME-02 and so on.")
    scenes: int = quantity(..., "1", "Number of scenes.", (1, 10_000))
    split: Split | dict[Split, int] = Field(
        "train", description="Split that all scenes belong to, or the number of scenes of each, in order."
    )
    scenario: str | None = Field(None, description="Built-in scenario or file; the recipe's if not given.")
    set: dict[str, Any] = Field({}, description="Changes of the scenario, path: value, after the recipe's own.")
    draw: Draws = Field(
        {}, description="Fields of the scenario of which each scene draws its own value, path: range or values."
    )
    variants: tuple[dict[str, Any], ...] = Field(
        (), description="Further changes of which each scene gets one: all as often, in an order drawn from the seed."
    )

    @model_validator(mode="after")
    def _check_split(self) -> Self:
        """Refuse fields both set and drawn, and splits whose counts don't add up to the scenes."""
        _check_draws(self.set, self.draw)
        if isinstance(self.split, dict) and (sum(self.split.values()) != self.scenes or min(self.split.values()) < 0):
            raise ValueError(f"split counts {dict(self.split)} must add up to scenes, {self.scenes}")
        return self

    def splits(self) -> list[str]:
        """Return the split's name of each scene of the group, in order."""
        if isinstance(self.split, str):
            return [self.split] * self.scenes
        return [name for name, count in self.split.items() for _ in range(count)]


class Recipe(ClosedModel):
    """A data set."""

    type: Literal["Recipe"] = "Recipe"
    version: Literal["1.0"] = "1.0"
    title: str = Field(min_length=1, max_length=200, description="Title.")
    description: str = Field("", description="What the set is for, in a few sentences: it stands in the data card.")
    licence: str = Field("CC-BY-4.0", min_length=1, description="Licence of the data (SPDX identifier).")
    seed: int = quantity(1, "1", "Seed of all random choices.", (0, LARGEST_SEED - 1))
    scenario: str = Field("rq31-600m", description="Built-in scenario or file that the groups start from.")
    set: dict[str, Any] = Field({}, description="Changes of every group's scenario, path: value.")
    draw: Draws = Field(
        {}, description="Fields of which each scene of every group draws its own value, path: range or values."
    )
    layouts: tuple[Layout, ...] = Field((), description="Layouts for training, beside each scene's own files.")
    tile: float = quantity(60.0, "m", "Edge of the layouts' tiles.", (5, 1000))
    point_spacing: float | None = quantity(
        0.04, "m", "Grid of which the layouts keep one point per cell; null: all.", (0.005, 10)
    )
    smallest_tile: int = quantity(1000, "1", "Tiles of fewer points are left out.", (1, None))
    epochs: int | None = quantity(
        None,
        "1",
        "Epochs of every scene: the same road surveyed so often, see road.changes; one if not given.",
        (2, 100),
    )
    groups: tuple[SceneGroup, ...] = Field(min_length=1, max_length=1000, description="Groups of scenes.")

    @field_validator("groups")
    @classmethod
    def _refuse_repetitions(cls, groups: tuple[SceneGroup, ...]) -> tuple[SceneGroup, ...]:
        """Refuse two groups of one name."""
        if (repeated_name := first_repeated([group.name for group in groups])) is not None:
            raise ValueError(f"two groups are named {repeated_name}")
        return groups

    @model_validator(mode="after")
    def _check_fields(self) -> Self:
        """Refuse fields both set and drawn."""
        _check_draws(self.set, self.draw)
        return self


@dataclass(frozen=True)
class SceneJob:
    """One scene of a data set: its name, split and scenario.

    Attributes:
        name: of its folder.
        number: from 0, in the recipe's order.
        split: ``train`` and the like.
        scenario: all that it is made from.
    """

    name: str
    number: int
    split: str
    scenario: Scenario


def recipe_names() -> list[str]:
    """Return the names of the built-in recipes, sorted."""
    return preset_names(RECIPES, ".yaml")


def load_recipe(name_or_file: str) -> Recipe:
    """Return a built-in recipe or one from a YAML or JSON file.

    Raises:
        MissingFileError: there is no such file.
        InputError: it isn't YAML, or a field is unknown or out of its limits.

    Example:
        >>> recipe = load_recipe("small-roads")
        >>> [group.name for group in recipe.groups], recipe.seed
        (['roads'], 11)
    """
    path = preset_path(RECIPES, name_or_file, "recipe", (".yaml", ".yml", ".json"))
    return Recipe.from_dict(read_yaml(path), source=str(name_or_file))


def scene_jobs(recipe: Recipe) -> list[SceneJob]:
    """Return all scenes of a recipe in order, each with its name, split and scenario.

    A scene's seed and variant follow from the recipe's seed and the scene's name alone: a group can be added, made
    longer or removed without changing the other scenes.

    Raises:
        InputError: a scenario or a change is wrong; the message names the group.

    Example:
        >>> jobs = scene_jobs(load_recipe("small-roads"))
        >>> len(jobs), jobs[0].name, jobs[0].split
        (8, 'roads-01', 'train')
    """
    scenario_data: dict[str, Any] = {}
    return [_job(recipe, scenario_data, number, *place) for number, place in enumerate(scene_places(recipe))]


def scene_places(recipe: Recipe) -> list[tuple[SceneGroup, int, str]]:
    """Return each scene's group, place in the group and split, in the recipe's order."""
    return [(group, place, split) for group in recipe.groups for place, split in enumerate(group.splits())]


def scene_job(recipe: Recipe, number: int) -> SceneJob:
    """Return the scene of a number from 0 in the recipe's order; see `scene_jobs`."""
    return _job(recipe, {}, number, *scene_places(recipe)[number])


def _job(
    recipe: Recipe, scenario_data: dict[str, Any], number: int, group: SceneGroup, place: int, split: str
) -> SceneJob:
    """Return a scene; the data of scenarios read so far are in `scenario_data`, by name, to which its own is added."""
    name = f"{group.name}-{place + 1:0{max(2, len(str(group.scenes)))}d}"
    try:
        scenario = _scenario(recipe, scenario_data, group, name, place)
    except InputError as error:
        raise InputError(f"groups.{group.name}: {error.field}", error.value, error.allowed) from None
    return SceneJob(name, number, split, scenario)


def _scenario(recipe: Recipe, scenario_data: dict[str, Any], group: SceneGroup, name: str, place: int) -> Scenario:
    """Return the scenario of a scene: its group's, with seed, changes, drawn values and variant."""
    scenario_name = group.scenario or recipe.scenario
    if scenario_name not in scenario_data:
        scenario_data[scenario_name] = load_scenario(scenario_name).to_dict()
    seed = int(stream(recipe.seed, "scene", name).integers(LARGEST_SEED))
    draws = [_drawn_values(recipe.seed, name, part.draw) for part in (recipe, group)]
    changes = [{"seed": seed}, recipe.set, draws[0], group.set, draws[1]]
    if group.variants:
        turn, place_in_turn = divmod(place, len(group.variants))
        order = stream(recipe.seed, "variants", group.name, turn).permutation(len(group.variants))
        changes.append(group.variants[order[place_in_turn]])
    pairs = (pair for values in changes for pair in values.items())
    scenario = Scenario.from_dict(with_changes(scenario_data[scenario_name], pairs))
    if _UNSTABLE in group_outputs(group, recipe):
        raise InputError("outputs", list(scenario.outputs), f"a data set can't hold {_UNSTABLE}: it differs each time")
    outputs = dict.fromkeys((*NEEDED_OUTPUTS, *(name for name in scenario.outputs if name != _UNSTABLE)))
    return scenario.model_copy(update={"outputs": tuple(outputs)})


def _drawn_values(seed: int, scene: str, draws: Draws) -> dict[str, Any]:
    """Return the values that a scene draws, by path: each depends on seed, scene and path alone."""
    return {path: value.draw(stream(seed, "draw", scene, path)) for path, value in draws.items()}


def group_outputs(group: SceneGroup, recipe: Recipe) -> list[str]:
    """Return the outputs that the recipe itself names for a group; empty if it names none."""
    outputs = group.set.get("outputs", recipe.set.get("outputs", []))
    return list(outputs) if isinstance(outputs, list) else []
