"""`Recipe`: a data set in one file: groups of scenes, each scene with a seed of its own."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from ..base.errors import InputError
from ..base.files import PRESETS, preset_names, preset_path
from ..base.random_streams import stream
from ..base.schema import ClosedModel, first_repeated, quantity, read_yaml
from ..scenario.scenario import Scenario, load_scenario, with_changes

RECIPES = PRESETS / "recipes"

Layout = Literal["pointcept", "semantickitti"]
Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,60}$")]
Split = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,30}$")]

NEEDED_OUTPUTS = ("parameters", "cloud", "centerline")
_UNSTABLE = "scene"
"""A .blend file is never the same twice, so that its checksum would say nothing."""
_LARGEST_SEED = 2**63


class SceneGroup(ClosedModel):
    """Scenes that differ in their seeds and variants."""

    name: Name = Field(description="Name of the group; its scenes are NAME-01, NAME-02 and so on.")
    scenes: int = quantity(..., "1", "Number of scenes.", (1, 10_000))
    split: Split | dict[Split, int] = Field(
        "train", description="Split that all scenes belong to, or the number of scenes of each, in order."
    )
    scenario: str | None = Field(None, description="Built-in scenario or file; the recipe's if not given.")
    set: dict[str, Any] = Field({}, description="Changes of the scenario, path: value, after the recipe's own.")
    variants: tuple[dict[str, Any], ...] = Field(
        (), description="Further changes of which each scene gets one: all as often, in an order drawn from the seed."
    )

    @model_validator(mode="after")
    def _check_split(self) -> Self:
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
    seed: int = quantity(1, "1", "Seed of everything random.", (0, _LARGEST_SEED - 1))
    scenario: str = Field("rq31-600m", description="Built-in scenario or file that the groups start from.")
    set: dict[str, Any] = Field({}, description="Changes of every group's scenario, path: value.")
    layouts: tuple[Layout, ...] = Field((), description="Layouts for training, beside each scene's own files.")
    tile: float = quantity(60.0, "m", "Edge of the layouts' tiles.", (5, 1000))
    point_spacing: float | None = quantity(
        0.04, "m", "Grid of which the layouts keep one point per cell; null: all.", (0.005, 10)
    )
    smallest_tile: int = quantity(1000, "1", "Tiles of fewer points are left out.", (1, None))
    groups: tuple[SceneGroup, ...] = Field(min_length=1, max_length=1000, description="Groups of scenes.")

    @field_validator("groups")
    @classmethod
    def _refuse_repetitions(cls, groups: tuple[SceneGroup, ...]) -> tuple[SceneGroup, ...]:
        if (twice := first_repeated([group.name for group in groups])) is not None:
            raise ValueError(f"two groups are named {twice}")
        return groups


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
    """
    path = preset_path(RECIPES, name_or_file, "recipe", (".yaml", ".yml", ".json"))
    return Recipe.from_dict(read_yaml(path), source=str(name_or_file))


def scene_jobs(recipe: Recipe) -> list[SceneJob]:
    """Return all scenes of a recipe in order, each with its name, split and scenario.

    A scene's seed and variant follow from the recipe's seed and the scene's name alone: a group can be added, made
    longer or removed without changing the other scenes.

    Raises:
        InputError: a scenario or a change is wrong; the message names the group.
    """
    jobs: list[SceneJob] = []
    for group in recipe.groups:
        for place, split in enumerate(group.splits()):
            name = f"{group.name}-{place + 1:0{max(2, len(str(group.scenes)))}d}"
            try:
                scenario = _scenario(recipe, group, name, place)
            except InputError as error:
                raise InputError(f"groups.{group.name}: {error.field}", error.value, error.allowed) from None
            jobs.append(SceneJob(name, len(jobs), split, scenario))
    return jobs


def _scenario(recipe: Recipe, group: SceneGroup, name: str, place: int) -> Scenario:
    seed = int(stream(recipe.seed, "scene", name).integers(_LARGEST_SEED))
    changes = [{"seed": seed}, recipe.set, group.set]
    if group.variants:
        turn, place_in_turn = divmod(place, len(group.variants))
        order = stream(recipe.seed, "variants", group.name, turn).permutation(len(group.variants))
        changes.append(group.variants[order[place_in_turn]])
    data = load_scenario(group.scenario or recipe.scenario).to_dict()
    pairs = (pair for values in changes for pair in values.items())
    scenario = Scenario.from_dict(with_changes(data, pairs))
    if _UNSTABLE in group_outputs(group, recipe):
        raise InputError("outputs", list(scenario.outputs), f"a data set can't hold {_UNSTABLE}: it differs each time")
    outputs = dict.fromkeys((*NEEDED_OUTPUTS, *(name for name in scenario.outputs if name != _UNSTABLE)))
    return scenario.model_copy(update={"outputs": tuple(outputs)})


def group_outputs(group: SceneGroup, recipe: Recipe) -> list[str]:
    """Return the outputs that the recipe itself names for a group; empty if it names none."""
    outputs = group.set.get("outputs", recipe.set.get("outputs", []))
    return list(outputs) if isinstance(outputs, list) else []
