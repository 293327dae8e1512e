"""Changes to the scenarios of a recipe, after the recipe's own."""

from collections.abc import Sequence

from ..scenario.scenario import scenario_changes
from .recipe import Recipe, path_within


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
