"""Configurations of trainings: one YAML file says everything that a run depends on."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, ModelWrapValidatorHandler, model_validator

from synthroads_addon.base.changes import apply_change
from synthroads_addon.base.errors import InputError, nearest_name
from synthroads_addon.base.schema import Model, quantity, read_yaml

SHIPPED = Path(__file__).parent / "configurations"
EXPERIMENTS = SHIPPED / "experiments"
TASKS = {"centerline": "ml.centerline.task", "segmentation": "ml.segmentation.task"}
"""Task as configurations name it, and its module: a `tasks.Task`."""
_LARGEST_SEED = 2**63 - 1


class Part(Model):
    """Base of a configuration's parts: immutable, no unknown keys, no NaN.

    Attributes:
        renamed: former name of a field, which is still read -> present name.
    """

    vendor_keys_allowed: ClassVar[bool] = False
    renamed: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="wrap")
    @classmethod
    def _read_old_names(cls, data: Any, validate: ModelWrapValidatorHandler[Self]) -> Self:
        """Validate data after fields under their former names were renamed; a present new name wins."""
        if isinstance(data, dict):
            name_changes = {old_name: new_name for old_name, new_name in cls.renamed.items() if new_name not in data}
            data = {name_changes.get(name, name): value for name, value in data.items()}
        return validate(data)


class Schedule(Part):
    """Options of the optimiser: AdamW whose learning rate warms up linearly, then decays as a cosine.

    Loshchilov and Hutter, "Decoupled weight decay regularization" (2019) and "SGDR" (2017).
    """

    epochs: int = quantity(50, ge=1, le=100_000, unit="1", description="Number of epochs.")
    learning_rate: float = quantity(0.01, gt=0, le=10, unit="1", description="Largest learning rate.")
    final_learning_rate: float = quantity(
        1e-5, ge=0, le=10, unit="1", description="Learning rate at the end of the last epoch."
    )
    warmup: float = quantity(
        0.0, ge=0, lt=1, unit="1", description="Share of all steps in which the learning rate rises."
    )
    weight_decay: float = quantity(1e-4, ge=0, le=1, unit="1", description="Weight decay; biases don't decay.")
    clip: float = quantity(10.0, gt=0, unit="1", description="Largest norm of the gradient.")
    averaging: float = quantity(
        0.0,
        ge=0,
        lt=1,
        unit="1",
        description="Share of the running mean of the weights that each step keeps; the training ends with this mean. "
        "0: it ends with the weights of the last step.",
    )

    @model_validator(mode="after")
    def _check_rates(self) -> Self:
        """Refuse a final learning rate above the largest one."""
        if self.final_learning_rate > self.learning_rate:
            raise ValueError(f"final_learning_rate must not exceed learning_rate, {self.learning_rate:g}")
        return self


class Configuration(Part):
    """Base of the configurations of all tasks."""

    task: str = Field(description="Task: centerline or segmentation.")
    title: str = Field("", description="Title of the configuration.")
    seed: int = quantity(1, ge=0, le=_LARGEST_SEED, unit="1", description="Seed of all random choices.")
    threads: int = quantity(0, ge=0, le=1024, unit="1", description="Number of PyTorch's threads; 0: one per core.")
    device: str = Field(
        "auto", pattern=r"^(auto|cpu|cuda(:\d+)?)$", description="Device of the training; auto: CUDA if available."
    )
    workers: int = quantity(
        0,
        ge=0,
        le=256,
        unit="1",
        description="Number of processes that prepare batches; 0: the main process prepares them.",
    )
    precision: Literal["float32", "bfloat16"] = Field(
        "float32", description="Number format of the training's steps; weights, gradients and geometry stay float32."
    )
    processes: int = quantity(
        1, ge=1, le=1024, unit="1", description="Number of processes that train, each on different batches."
    )
    accumulation: int = quantity(
        1,
        ge=1,
        le=1024,
        unit="1",
        description="Number of batches of a process whose gradients are averaged for one step.",
    )
    schedule: Schedule = Field(default=Schedule(), description="Epochs and learning rates.")


def configuration_kind(task: str) -> type[Configuration]:
    """Return the configuration class of one of `TASKS`, importing the task's module."""
    kind: type[Configuration] = import_module(TASKS[task]).CONFIGURATION
    return kind


def names_in(folder: Path) -> list[str]:
    """Return the names of a folder's files without their endings, sorted."""
    return sorted(path.stem for path in folder.glob("*.*"))


def shipped_file(field: str, folder: Path, name_or_file: str, endings: Sequence[str] = (".yaml", ".json")) -> Path:
    """Return the path of the folder's file of that name, or the given path if it has an allowed ending (may not exist).

    Raises:
        InputError: there is no such name, and a file would end in one of the endings (or in .yml).
    """
    names, path = names_in(folder), Path(name_or_file)
    if name_or_file in names:
        return folder / f"{name_or_file}{endings[0]}"
    if path.suffix.lower().replace(".yml", ".yaml") in endings:
        return path
    hint = nearest_name(name_or_file, names)
    requirement = f"must be a {' or '.join(endings)} file or one of {', '.join(names)}{hint}"
    raise InputError(field, name_or_file, requirement)


def load_configuration(name_or_file: str, changes: Sequence[str] = (), tasks: Sequence[str] = ()) -> Any:
    """Load a shipped configuration or a YAML file and apply ``path=value`` changes.

    Args:
        name_or_file: name of a file in `SHIPPED`, or a path.
        changes: changes as ``--set`` takes them, e.g. ``schedule.epochs=5``.
        tasks: names of the tasks that are possible; empty for all.

    Raises:
        MissingFileError: there is no such file.
        InputError: a field is unknown or wrong; the message names it.
    """
    data = read_yaml(shipped_file("configuration", SHIPPED, name_or_file))
    task = data.get("task") if isinstance(data, dict) else None
    kind = configuration_kind(task) if isinstance(task, str) and task in TASKS else Configuration
    for change in changes:
        data = apply_change(data, change, kind)
    return from_data(data, str(name_or_file), tasks)


def from_data(data: Any, source: str, tasks: Sequence[str] = ()) -> Any:
    """Return the task's configuration validated from plain data (as read from YAML).

    Raises:
        InputError: the data name no possible task, or a field is unknown or wrong.
    """
    task = data.get("task") if isinstance(data, dict) else None
    if not isinstance(task, str) or task not in (tasks or TASKS):
        raise InputError(f"{source}: task", task, f"must be one of {', '.join(tasks or TASKS)}")
    return configuration_kind(task).from_dict(data, source=source)
