"""Experiments of both tasks: several trainings that differ in their data, each with several seeds, and one table.

`synthroads experiment` runs them. What is trained already isn't trained again. Data, tests and tables are each task's
own: `ml.segmentation.experiment` and `ml.centerline.experiment`.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field, field_validator

from synthroads_addon.base.changes import apply_change, apply_values
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import write_file
from synthroads_addon.base.schema import Model, canonical_json, read_json, read_yaml
from synthroads_addon.dataset.manifest import checksum

from .configuration import EXPERIMENTS, TASKS, Configuration, configuration_kind, load_configuration, shipped_file
from .runs import CHECKPOINT, Run, lasting_data

RESULTS, TABLE = "results.json", "table.md"
"""Files with the scores of all variants, seeds and tests, in an experiment's folder."""
_SEGMENTATION = "segmentation"
_FOLDER_NAME = re.compile(r"[^/\\:.][^/\\:]{0,100}")


class Variant(Model):
    """One variant of an experiment: changes of its configuration, and whose network it tests."""

    vendor_keys_allowed: ClassVar[bool] = False

    set: dict[str, Any] = Field({}, description="Changes of the configuration, as path: value.")
    of: str | None = Field(
        None, description="Variant whose trained network is tested again with the changes, without a training."
    )


class Experiment(Model):
    """Trainings to be compared, as read from YAML; paths of data may begin with {NAME}, filled in by --data."""

    vendor_keys_allowed: ClassVar[bool] = False

    task: str = Field(_SEGMENTATION, description="Task: centerline or segmentation.")
    title: str = Field(min_length=1, description="Title.")
    configuration: str = Field(description="Configuration that all variants start from.")
    set: dict[str, Any] = Field({}, description="Changes of this configuration, as path: value.")
    variants: dict[str, Variant] = Field(
        min_length=1, description="Variants that are compared, by name; each has a folder of its name in the output."
    )
    seeds: tuple[int, ...] = Field((1, 2, 3, 4, 5), min_length=1, description="Seeds of each variant.")

    @field_validator("variants")
    @classmethod
    def _check_names(cls, variants: dict[str, Variant]) -> dict[str, Variant]:
        """Refuse names of variants that can't be names of folders."""
        if invalid_name := next((name for name in variants if not _FOLDER_NAME.fullmatch(name)), None):
            raise ValueError(
                f"'{invalid_name}' must be the name of a folder: no / and no \\ in it, and no dot before it"
            )
        return variants

    def filled_data(self, folders: Mapping[str, str]) -> dict[str, Any]:
        """Return the fields of the configuration's data that the experiment states, {NAME} in all paths filled in.

        Raises:
            InputError: a name isn't given.
        """
        raise NotImplementedError


def load_experiment(name_or_file: str) -> Any:
    """Load a shipped experiment by name, or one from a YAML file, as the `Experiment` of its task.

    Raises:
        MissingFileError: there is no such file.
        InputError: a field is unknown or wrong.
    """
    data = read_yaml(shipped_file("experiment", EXPERIMENTS, name_or_file))
    task = data.get("task", _SEGMENTATION) if isinstance(data, dict) else _SEGMENTATION
    if not isinstance(task, str) or task not in TASKS:
        raise InputError(f"{name_or_file}: task", task, f"must be one of {', '.join(TASKS)}")
    experiment: Experiment = experiment_module(task).Experiment.from_dict(data, str(name_or_file))
    for name, variant in experiment.variants.items():
        if variant.of is not None and (variant.of not in experiment.variants or experiment.variants[variant.of].of):
            raise InputError(
                f"variants.{name}.of", variant.of, "must be a variant that is trained, not one that is only tested"
            )
    return experiment


def experiment_module(task: str) -> Any:
    """Import and return the module with a task's ``Experiment``, ``run_experiment`` and ``table``."""
    return import_module(f"{TASKS[task].rpartition('.')[0]}.experiment")


def configurations(experiment: Experiment, folders: Mapping[str, str], changes: Sequence[str] = ()) -> dict[str, Any]:
    """Return each variant's training configuration by name, with the first seed and paths filled in.

    Args:
        experiment: the experiment with its variants.
        folders: folder by NAME, for {NAME} in the experiment's paths.
        changes: changes of all variants, ``path=value``.

    Raises:
        InputError: a name isn't given, or a change is wrong.
    """
    kind = configuration_kind(experiment.task)
    base = load_configuration(experiment.configuration, tasks=[experiment.task]).to_dict()
    base |= {"data": base["data"] | experiment.filled_data(folders), "seed": experiment.seeds[0]}
    result = {}
    for name, variant in experiment.variants.items():
        data = base
        for part in (experiment.set, experiment.variants[variant.of].set if variant.of else {}, variant.set):
            data = apply_values(data, part)
        for change in changes:
            data = apply_change(data, change, kind)
        result[name] = kind.from_dict(data, f"variants.{name}")
    return result


def fill_path(path: str, folders: Mapping[str, str]) -> str:
    """Return a path with {NAME} replaced by its folder.

    Raises:
        InputError: the name isn't given.
    """
    try:
        return path.format(**folders)
    except (KeyError, IndexError, ValueError, AttributeError) as missing:
        name = missing.args[0] if isinstance(missing, KeyError) else path
        raise InputError("--data", name, f"must be given: {name}=FOLDER") from None


def read_figures(file: Path, name: str, made_from: Any, is_sound: Callable[[Any], bool]) -> dict[str, Any] | None:
    """Return the figures that an experiment keeps in a file; None if there are none, or those of other data.

    Args:
        file: JSON file of an object with the figures and, unless ``made_from`` is None, with that as ``made_from``.
        name: key of the figures in the object.
        made_from: data that the figures must be made from, as JSON data; None if that doesn't matter.
        is_sound: function that tells whether figures have the form that a table needs.

    Raises:
        InputError: the file is damaged.
    """
    if not file.is_file():
        return None
    content = read_json(file)
    if made_from is not None and isinstance(content, dict) and content.get("made_from") != made_from:
        return None
    if not isinstance(content, dict) or not is_sound(content.get(name)):
        fault = "aren't the figures of this experiment: without the file they are made anew"
        raise InputError(f"{file}: {name}", None, fault)
    figures: dict[str, Any] = content[name]
    return figures


def cached_scores(
    run: Run[Any], file: Path, score: Callable[[], dict[str, Any]], is_sound: Callable[[Any], bool], **dependencies: Any
) -> dict[str, Any]:
    """Return a trained run's scores, from a file if they were made of the same configuration, weights and dependencies.

    Args:
        run: run with the configuration that it is tested with.
        file: file in which the scores are kept.
        score: function that computes the scores.
        is_sound: see `read_figures`.
        dependencies: further values that the scores depend on, as JSON data.

    Raises:
        InputError: the file is damaged.
    """
    configuration = lasting_data(run.configuration.to_dict())
    made_from = {"configuration": configuration, "checkpoint_sha256": checksum(run.folder / CHECKPOINT), **dependencies}
    if (scores_in_file := read_figures(file, "tests", made_from, is_sound)) is not None:
        return scores_in_file
    scores = score()
    write_file(file, canonical_json({"made_from": made_from, "tests": scores}).encode(), overwrite=True)
    return scores


def write_results(output: Path, results: Mapping[str, Any], table: str) -> None:
    """Write the scores computed so far into an experiment's folder, as `RESULTS` and `TABLE`."""
    write_file(output / RESULTS, canonical_json(results).encode(), overwrite=True)
    write_file(output / TABLE, table.encode(), overwrite=True)


def with_seed(configuration: Configuration, seed: int) -> Any:
    """Return a configuration with another seed."""
    return configuration.model_copy(update={"seed": seed})
