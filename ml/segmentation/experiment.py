"""Experiments: several trainings that differ in their data, each with several seeds, and one table of all scores.

`synthroads experiment` runs them. What is trained already isn't trained again.
"""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import write_file
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.schema import Model, canonical_json, read_json, read_yaml
from synthroads_addon.dataset.manifest import checksum
from synthroads_addon.scenario.scenario import apply_change, apply_values

from ..configuration import EXPERIMENTS, load_configuration, shipped_file
from ..data.sources import Source
from ..runs import CHECKPOINT, CONFIGURATION, HISTORY, METRICS, PRETRAINING, Run, lasting_data
from ..scores.confusion import tables_by_test
from .recipes import Data, SegmentationConfiguration
from .scoring import score_all, trained_model
from .task import train

RESULTS, TABLE = "results.json", "table.md"
"""Files with the scores of all variants, seeds and tests, in an experiment's folder."""


class Variant(Model):
    """One variant of an experiment: changes of its configuration, and whose network it tests."""

    vendor_keys_allowed: ClassVar[bool] = False

    set: dict[str, Any] = Field({}, description="Changes of the configuration, path: value.")
    of: str | None = Field(None, description="Variant whose trained network is only tested anew, with the changes.")


class Experiment(Model):
    """Trainings to be compared, as read from YAML; paths of data may begin with {NAME}, filled in by --data."""

    vendor_keys_allowed: ClassVar[bool] = False

    title: str = Field(min_length=1, description="Title.")
    configuration: str = Field("segmentation", description="Configuration that all start from.")
    set: dict[str, Any] = Field({}, description="Changes of it, path: value.")
    data: Data = Field(description="Training data and tests of all variants.")
    variants: dict[str, Variant] = Field(min_length=1, description="What is compared.")
    seeds: tuple[int, ...] = Field((1, 2, 3, 4, 5), min_length=1, description="Seeds of each variant.")


def load_experiment(name_or_file: str) -> Experiment:
    """Load a shipped experiment by name, or one from a YAML file.

    Raises:
        MissingFileError: there is no such file.
        InputError: a field is unknown or wrong.
    """
    data = read_yaml(shipped_file("experiment", EXPERIMENTS, name_or_file))
    experiment = Experiment.from_dict(data, str(name_or_file))
    for name, variant in experiment.variants.items():
        if variant.of is not None and (variant.of not in experiment.variants or experiment.variants[variant.of].of):
            raise InputError(f"variants.{name}.of", variant.of, "must be a variant that is trained")
    return experiment


def configurations(
    experiment: Experiment, folders: Mapping[str, str], changes: Sequence[str] = ()
) -> dict[str, SegmentationConfiguration]:
    """Return each variant's training configuration by name, with the first seed and paths filled in.

    Args:
        experiment: what is compared.
        folders: what {NAME} in its paths stands for.
        changes: of all variants, ``path=value``.

    Raises:
        InputError: a name isn't given, or a change is wrong.
    """
    base = load_configuration(experiment.configuration, tasks=["segmentation"]).to_dict()
    base |= {"data": _fill_sources(experiment.data, folders).to_dict(), "seed": experiment.seeds[0]}
    result = {}
    for name, variant in experiment.variants.items():
        data = base
        for part in (experiment.set, experiment.variants[variant.of].set if variant.of else {}, variant.set):
            data = apply_values(data, part)
        for change in changes:
            data = apply_change(data, change, SegmentationConfiguration)
        result[name] = SegmentationConfiguration.from_dict(data, f"variants.{name}")
    return result


def _fill_sources(data: Data, folders: Mapping[str, str]) -> Data:
    """Return a copy of the data with {NAME} in all paths replaced by its folder."""

    def fill(source: Source) -> Source:
        try:
            return source.model_copy(update={"path": source.path.format(**folders)})
        except (KeyError, IndexError, ValueError) as missing:
            name = missing.args[0] if isinstance(missing, KeyError) else source.path
            raise InputError("--data", name, f"must be given: {name}=FOLDER") from None

    return Data(
        real=tuple(map(fill, data.real)),
        synthetic=tuple(map(fill, data.synthetic)),
        target=tuple(map(fill, data.target)),
        validation=tuple(map(fill, data.validation)),
        tests={name: tuple(map(fill, sources)) for name, sources in data.tests.items()},
    )


def run_experiment(
    experiment: Experiment,
    configured: Mapping[str, SegmentationConfiguration],
    output: Path,
    seeds: Sequence[int],
    progress: Progress = silent,
) -> dict[str, Any]:
    """Train (unless done) and test all variants with the given seeds; return the scores, written after each.

    Args:
        experiment: what is compared.
        configured: see `configurations`.
        output: folder; ``VARIANT/seed-N`` are the runs, `RESULTS` and `TABLE` the scores.
        seeds: one after another, each over all variants: a table is there as soon as the first is through.
        progress: of each training.
    """
    results: dict[str, dict[str, Any]] = {name: {} for name in configured}
    for seed in seeds:
        for name, variant in experiment.variants.items():
            configuration = configured[name].model_copy(update={"seed": seed})
            folder = output / (variant.of or name) / f"seed-{seed}"
            if variant.of is None:
                tests = _train_variant(configuration, folder, output, progress)
            else:
                tests = _test_variant(configuration, folder, output / name / f"seed-{seed}.json", progress)
            results[name][str(seed)] = tests
            write_file(output / RESULTS, canonical_json(results).encode(), overwrite=True)
            write_file(output / TABLE, table(experiment.title, results).encode(), overwrite=True)
    return results


def _train_variant(
    configuration: SegmentationConfiguration, folder: Path, output: Path, progress: Progress
) -> dict[str, Any]:
    """Return a run's test scores by test, training it first unless it is already."""
    begun = (folder / CONFIGURATION).is_file()
    run = Run.start(folder, configuration, resume=begun)
    if not (folder / METRICS).is_file():
        if configuration.set_up == "fine_tuned":
            _reuse_pretraining(configuration, folder / PRETRAINING, output)
        train(run, progress)
    tests: dict[str, Any] = read_json(folder / METRICS)["tests"]
    return tests


def _reuse_pretraining(configuration: SegmentationConfiguration, target: Path, output: Path) -> None:
    """Copy a run of the experiment that trained just the first part of fine-tuning to `target`, if there is one."""
    wanted = lasting_data(configuration.model_copy(update={"set_up": "synthetic"}).to_dict())
    if (target / CONFIGURATION).is_file():
        return
    for file in sorted(output.glob(f"*/*/{CONFIGURATION}")):
        if lasting_data(read_json(file)) == wanted and (file.parent / METRICS).is_file():
            target.mkdir(parents=True, exist_ok=True)
            for name in (CONFIGURATION, CHECKPOINT, HISTORY):
                shutil.copyfile(file.parent / name, target / name)
            return


def _test_variant(
    configuration: SegmentationConfiguration, folder: Path, file: Path, progress: Progress
) -> dict[str, Any]:
    """Return a trained run's test scores under another configuration, cached in `file` by configuration and weights."""
    wanted = lasting_data(configuration.to_dict())
    made_from = {"configuration": wanted, "checkpoint_sha256": checksum(folder / CHECKPOINT)}
    tests: dict[str, Any]
    if file.is_file() and (kept := read_json(file)).get("made_from") == made_from:
        tests = kept["tests"]
        return tests
    tests = score_all(trained_model(Run(folder, configuration)), configuration, progress)
    write_file(file, canonical_json({"made_from": made_from, "tests": tests}).encode(), overwrite=True)
    return tests


def table(title: str, results: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a Markdown page with a table per test: IoU of each class and variant, %, mean (standard deviation).

    Args:
        title: above the tables.
        results: variant -> seed -> test -> scores as of `Confusion.to_dict`.
    """
    return f"# {title}\n\n{tables_by_test(results)}\n"
