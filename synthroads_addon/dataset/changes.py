"""Changes to the scenarios of a recipe, after the recipe's own."""

from collections.abc import Sequence

from ..base.errors import InputError
from ..scenario.scenario import scenario_changes
from .recipe import Recipe, SceneGroup, path_within


def change_recipe(recipe: Recipe, changes: Sequence[str]) -> Recipe:
    """Return a copy of a recipe with further changes (``path=value``) to the scenarios of all its groups.

    Example:
        >>> from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
        >>> shorter = change_recipe(load_recipe("small-roads"), ["road.length=50"])
        >>> {job.scenario.road.length for job in scene_jobs(shorter)}
        {50.0}
    """
    if not changes:
        return recipe
    values = dict(scenario_changes(list(changes)))
    groups = []
    for group in recipe.groups:
        draws = {
            path: drawn_value
            for path, drawn_value in group.draw.items()
            if not any(path_within(path, changed_path) for changed_path in values)
        }
        variants = tuple(each | values for each in group.variants)
        update = {"set": group.set | values, "draw": draws, "variants": variants}
        groups.append(group.model_copy(update=update))
    return Recipe.from_dict(recipe.model_copy(update={"groups": tuple(groups)}).to_dict(), "recipe")


MOST_SCENES = 10_000
"""Most scenes that a recipe is resized to: those of one group."""


def resize_recipe(recipe: Recipe, scenes: int) -> Recipe:
    """Return a copy of a recipe with another number of scenes in all, divided among groups and splits as before.

    Groups that get no scene are left out. Scenes of both recipes that have the same name are made alike.

    Raises:
        InputError: the number isn't 1 to `MOST_SCENES`.

    Example:
        >>> from synthroads_addon.dataset.recipe import load_recipe
        >>> group = resize_recipe(load_recipe("small-roads"), 4).groups[0]
        >>> group.scenes, group.split
        (4, {'train': 3, 'validation': 1, 'test': 0})
    """
    if not 1 <= scenes <= MOST_SCENES:
        raise InputError("scenes", scenes, f"must be 1 to {MOST_SCENES}")
    counts = _divide(scenes, [group.scenes for group in recipe.groups])
    groups = [_resize_group(group, count) for group, count in zip(recipe.groups, counts, strict=True) if count]
    return Recipe.from_dict(recipe.model_copy(update={"groups": tuple(groups)}).to_dict(), "recipe")


def _resize_group(group: SceneGroup, scenes: int) -> SceneGroup:
    """Return a copy of a group with another number of scenes, divided among its splits as before."""
    split = group.split
    if isinstance(split, dict):
        split = dict(zip(split, _divide(scenes, list(split.values())), strict=True))
    return group.model_copy(update={"scenes": scenes, "split": split})


def _divide(total: int, weights: Sequence[int]) -> list[int]:
    """Return whole numbers of a total in the ratio of weights: the largest remainders are rounded up."""
    shares = [total * weight / sum(weights) for weight in weights]
    counts = [int(share) for share in shares]
    by_remainder = sorted(range(len(weights)), key=lambda place: counts[place] - shares[place])
    for place in by_remainder[: total - sum(counts)]:
        counts[place] += 1
    return counts
