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
"""Weights of one model take less than this, MB."""
Platform = Literal["airborne", "uav", "mobile", "tripod", "sweep"]
"""What carried the scanner; a sweep is one turn of a head on a car, whatever its extent."""
Attribute = Literal["intensity", "color"]


class Domain(Part):
    """Clouds that a model was trained on, in terms that can be measured on any cloud."""

    density: tuple[float, float] = Field(description="Least and largest density of points on the ground, 1/m2.")
    platforms: tuple[Platform, ...] = Field(min_length=1, description="What carried the scanner.")
    needs: tuple[Attribute, ...] = Field((), description="Attributes of points without which it is no use.")


class Figure(Part):
    """One figure that a model was measured by, beside the best rule that learns nothing where there is one."""

    name: str = Field(min_length=1, description="What was measured, on what.")
    value: float = quantity(unit="1", description="Of the model, in `unit`.")
    rule: float | None = quantity(None, unit="1", description="Of the best rule that learns nothing, in `unit`.")
    unit: str = Field(description="m, %, ...")
    inside: bool = Field(description="Whether it was measured on clouds like those trained on.")


class ModelCard(Part):
    """Card of a shipped model."""

    name: str = Field(pattern=r"^[a-z0-9-]+$", description="By which commands take it.")
    title: str = Field(min_length=1, description="What it is, in one line.")
    task: Literal["centerline", "segmentation"] = Field(description="What it was trained for.")
    domain: Domain = Field(description="What it was trained on.")
    recipe: tuple[str, ...] = Field(min_length=1, description="Commands that make it anew.")
    commit: str = Field(min_length=7, description="Of the source that it was trained with.")
    seed: int = quantity(ge=0, unit="1", description="Of the training.")
    scenes: int = quantity(ge=1, unit="1", description="Synthetic roads that it has seen.")
    epochs: int = quantity(ge=1, unit="1", description="Of the training.")
    minutes: float = quantity(gt=0, unit="min", description="That the training took on `machine`.")
    machine: str = Field("one core", min_length=1, description="That it was trained on.")
    parameters: int = quantity(ge=1, unit="1", description="Weights.")
    figures: tuple[Figure, ...] = Field(min_length=1, description="What it reaches.")
    limits: tuple[str, ...] = Field(min_length=1, description="Where it fails, one sentence each.")

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
        known = sorted(one.stem for one in WEIGHTS.glob("*.json"))
        allowed = f"must be one of {', '.join(known)}{nearest_name(name, known)}" if known else "no model is shipped"
        raise InputError("model", name, allowed)
    return ModelCard.from_dict(read_json(path), source=path.name)
