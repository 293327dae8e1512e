"""Cards of the models that come with the package: what each was trained on, where it is good, and where it fails.

Read without PyTorch, so that they can be listed where it isn't installed.
"""

from pathlib import Path
from typing import Literal

from pydantic import Field

from synthroads_addon.base.errors import InputError, nearest_name
from synthroads_addon.base.schema import quantity, read_json

from .configuration import Part

WEIGHTS = Path(__file__).parent / "weights"
"""Folder of the shipped models: of each a card, NAME.json, and weights, NAME.safetensors."""
LARGEST_MB = 10.0
"""Largest size of one model's weights, MB."""
Platform = Literal["airborne", "uav", "mobile", "tripod", "sweep"]
"""Kind of survey: what carried the scanner, or one sweep, a turn of a head on a car."""
Attribute = Literal["intensity", "color"]


class Domain(Part):
    """Domain that a model was trained on, in properties that can be measured on any cloud."""

    density: tuple[float, float] = Field(description="Least and largest density of points on the ground, 1/m2.")
    platforms: tuple[Platform, ...] = Field(min_length=1, description="Platforms that carried the scanner.")
    needs: tuple[Attribute, ...] = Field((), description="Attributes that points must have for this model.")
    ground_only: bool = Field(False, description="Whether nothing may stand in the clouds: ground and road alone.")


class Figure(Part):
    """One measured figure of a model, with that of the best untrained rule where there is one."""

    name: str = Field(min_length=1, description="Figure that was measured, and the clouds it was measured on.")
    value: float = quantity(unit="1", description="Value of the model, in `unit`.")
    rule: float | None = quantity(None, unit="1", description="Value of the best rule without learning, in `unit`.")
    unit: str = Field(description="Unit of the values: m, %, ...")
    inside: bool = Field(description="Whether the test clouds are like the training clouds.")


class ModelCard(Part):
    """Card of a shipped model."""

    name: str = Field(pattern=r"^[a-z0-9-]+$", description="Name that commands accept.")
    title: str = Field(min_length=1, description="Title of the model, in one line.")
    task: Literal["centerline", "segmentation"] = Field(description="Task that the model was trained for.")
    domain: Domain = Field(description="Clouds that the model was trained on.")
    recipe: tuple[str, ...] = Field(min_length=1, description="Commands that train the model again.")
    commit: str = Field(min_length=7, description="Commit of the source code used for the training.")
    seed: int = quantity(ge=0, unit="1", description="Of the training.")
    scenes: int = quantity(ge=1, unit="1", description="Number of synthetic roads in the training data.")
    epochs: int = quantity(ge=1, unit="1", description="Of the training.")
    minutes: float = quantity(gt=0, unit="min", description="Duration of the training on `machine`.")
    machine: str = Field("one core", min_length=1, description="Machine that the model was trained on.")
    parameters: int = quantity(ge=1, unit="1", description="Weights.")
    figures: tuple[Figure, ...] = Field(min_length=1, description="Scores of the model.")
    limits: tuple[str, ...] = Field(min_length=1, description="Cases in which the model fails, one sentence each.")

    @property
    def weights(self) -> Path:
        """Return the file of its weights."""
        return WEIGHTS / f"{self.name}.safetensors"


def model_names(task: str | None = None) -> list[str]:
    """Return the names of the shipped models, of one task or of all, sorted."""
    names = sorted(path.stem for path in WEIGHTS.glob("*.json"))
    return [name for name in names if task in (None, read_card(name).task)]


def read_card(name: str) -> ModelCard:
    """Return the card of a shipped model.

    Raises:
        InputError: there is no model of this name.
    """
    path = WEIGHTS / f"{name}.json"
    if not path.is_file():
        names = sorted(card_file.stem for card_file in WEIGHTS.glob("*.json"))
        requirement = (
            f"must be one of {', '.join(names)}{nearest_name(name, names)}" if names else "no model is shipped"
        )
        raise InputError("model", name, requirement)
    return ModelCard.from_dict(read_json(path), source=path.name)
