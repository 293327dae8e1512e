"""Configurations of trainings: one YAML file says everything that a run depends on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, TypeVar

from pydantic import Field, ModelWrapValidatorHandler, model_validator

from synthroads_addon.base.errors import InputError, nearest_name
from synthroads_addon.base.schema import Model, quantity, read_yaml
from synthroads_addon.scenario.scenario import apply_change

SHIPPED = Path(__file__).parent / "configurations"
EXPERIMENTS = SHIPPED / "experiments"
_LARGEST_SEED = 2**63 - 1


class Part(Model):
    """Base of a configuration's parts: immutable, no unknown keys, no NaN.

    Attributes:
        renamed: names that fields had before, which are still read, and the names that they have.
    """

    vendor_keys_allowed: ClassVar[bool] = False
    renamed: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="wrap")
    @classmethod
    def _read_old_names(cls, data: Any, read: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(data, dict):
            renamed = {old: new for old, new in cls.renamed.items() if new not in data}
            data = {renamed.get(name, name): value for name, value in data.items()}
        return read(data)


class Schedule(Part):
    """How the weights are learned: AdamW whose rate rises linearly, then falls as a cosine.

    Loshchilov and Hutter, "Decoupled weight decay regularization" (2019) and "SGDR" (2017).
    """

    epochs: int = quantity(50, ge=1, le=100_000, unit="1", description="Epochs.")
    learning_rate: float = quantity(0.01, gt=0, le=10, unit="1", description="Largest learning rate.")
    final_learning_rate: float = quantity(1e-5, ge=0, le=10, unit="1", description="Rate at the end of the last epoch.")
    warmup: float = quantity(0.0, ge=0, lt=1, unit="1", description="Share of all steps in which the rate rises.")
    weight_decay: float = quantity(1e-4, ge=0, le=1, unit="1", description="Decay of the weights, biases left out.")
    clip: float = quantity(10.0, gt=0, unit="1", description="Largest norm of the gradient.")

    @model_validator(mode="after")
    def _falls(self) -> Schedule:
        if self.final_learning_rate > self.learning_rate:
            raise ValueError(f"final_learning_rate must not exceed learning_rate, {self.learning_rate:g}")
        return self


class Configuration(Part):
    """Base of the configurations of all tasks."""

    task: str = Field(description="What is learned: centerline or segmentation.")
    title: str = Field("", description="Title for people.")
    seed: int = quantity(1, ge=0, le=_LARGEST_SEED, unit="1", description="Seed of everything random.")
    threads: int = quantity(0, ge=0, le=1024, unit="1", description="Threads of PyTorch; 0: one per core.")
    device: str = Field("auto", pattern=r"^(auto|cpu|cuda(:\d+)?)$", description="auto: CUDA where there is one.")
    precision: Literal["float32", "bfloat16"] = Field(
        "float32", description="Of the training's steps; weights, gradients and geometry stay float32."
    )
    processes: int = quantity(1, ge=1, le=1024, unit="1", description="Processes that train, each on other batches.")
    schedule: Schedule = Field(default=Schedule(), description="How the weights are learned.")


C = TypeVar("C", bound=Configuration)


def shipped_names() -> list[str]:
    """Return the names of the configurations that come with the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def experiment_names() -> list[str]:
    """Return the names of the experiments that come with the package."""
    return sorted(path.stem for path in EXPERIMENTS.glob("*.yaml"))


def load_configuration(name_or_file: str, kinds: Mapping[str, type[C]], changes: Sequence[str] = ()) -> C:
    """Load a shipped configuration or a YAML file and apply ``path=value`` changes.

    Args:
        name_or_file: a name out of `shipped_names`, or a file.
        kinds: the class of each task.
        changes: as ``--set`` takes them, e.g. ``schedule.epochs=5``.

    Raises:
        MissingFileError: there is no such file.
        InputError: a field is unknown or wrong; the message names it.
    """
    path = Path(name_or_file)
    if name_or_file in shipped_names():
        path = SHIPPED / f"{name_or_file}.yaml"
    elif path.suffix.lower() not in (".yaml", ".yml", ".json"):
        known = ", ".join(shipped_names())
        hint = nearest_name(name_or_file, shipped_names())
        raise InputError("configuration", name_or_file, f"must be a .yaml or .json file or one of {known}{hint}")
    data = read_yaml(path)
    task = data.get("task") if isinstance(data, dict) else None
    kind = kinds.get(task, Configuration) if isinstance(task, str) else Configuration
    for change in changes:
        data = apply_change(data, change, kind)
    return from_data(data, kinds, str(name_or_file))


def from_data(data: Any, kinds: Mapping[str, type[C]], source: str) -> C:
    """Return the configuration that plain data hold.

    Raises:
        InputError: they name no known task, or a field is unknown or wrong.
    """
    task = data.get("task") if isinstance(data, dict) else None
    if not isinstance(task, str) or task not in kinds:
        raise InputError(f"{source}: task", task, f"must be one of {', '.join(kinds)}")
    return kinds[task].from_dict(data, source=source)
