"""Experiments in segmentation: trainings that differ in their data, each with several seeds, and a table of scores."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from synthroads_addon.base.files import write_file
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.schema import read_json

from ..data.sources import Source
from ..experiments import Experiment as AnyExperiment
from ..experiments import cached_scores, fill_path, read_figures, with_seed, write_results
from ..runs import CHECKPOINT, CONFIGURATION, HISTORY, METRICS, PRETRAINING, Run, lasting_data
from ..scores.confusion import are_scores, tables_by_test
from .recipes import Data, SegmentationConfiguration
from .scoring import score_all, target_names, trained_model
from .task import train


class Experiment(AnyExperiment):
    """Trainings to be compared, as read from YAML; paths of data may begin with {NAME}, filled in by --data."""

    task: Literal["segmentation"] = Field("segmentation", description="Task: segmentation.")
    configuration: str = Field("segmentation", description="Configuration that all variants start from.")
    data: Data = Field(description="Training data and tests of all variants.")

    def filled_data(self, folders: Mapping[str, str]) -> dict[str, Any]:
        """Return training data and tests with {NAME} in all paths replaced by its folder; see the base class."""

        def fill(source: Source) -> Source:
            """Return a source with {NAME} in its path replaced by its folder."""
            return source.model_copy(update={"path": fill_path(source.path, folders)})

        return Data(
            real=tuple(map(fill, self.data.real)),
            synthetic=tuple(map(fill, self.data.synthetic)),
            stream=self.data.stream,
            target=tuple(map(fill, self.data.target)),
            validation=tuple(map(fill, self.data.validation)),
            tests={name: tuple(map(fill, sources)) for name, sources in self.data.tests.items()},
        ).to_dict()


def run_experiment(
    experiment: Experiment,
    configurations: Mapping[str, SegmentationConfiguration],
    output: Path,
    seeds: Sequence[int],
    progress: Progress = silent,
) -> dict[str, Any]:
    """Train (unless done) and test all variants with the given seeds; return the scores, written after each.

    Args:
        experiment: the experiment with its variants.
        configurations: see `configurations`.
        output: folder; ``VARIANT/seed-N`` are the runs, `RESULTS` and `TABLE` the scores.
        seeds: one after another, each over all variants: a table is there as soon as the first is through.
        progress: called with each training's stage and share.
    """
    results: dict[str, dict[str, Any]] = {name: {} for name in configurations}
    for seed in seeds:
        for name, variant in experiment.variants.items():
            configuration = with_seed(configurations[name], seed)
            folder = output / (variant.of or name) / f"seed-{seed}"
            if variant.of is None:
                tests = _train_variant(configuration, folder, output, progress)
            else:
                tests = _test_variant(configuration, folder, output / name / f"seed-{seed}.json", progress)
            results[name][str(seed)] = tests
            write_results(output, results, table(experiment.title, results))
    return results


def _train_variant(
    configuration: SegmentationConfiguration, folder: Path, output: Path, progress: Progress
) -> dict[str, Any]:
    """Return a run's scores by test, after training it unless that is done."""
    run = Run.start(folder, configuration, resume=True)
    with run.alone():
        if not (folder / METRICS).is_file():
            if configuration.set_up == "fine_tuned":
                run.begin()
                _reuse_pretraining(configuration, run.part(PRETRAINING), output)
            train(run, progress)
    tests = read_figures(folder / METRICS, "tests", None, partial(_are_tests, configuration))
    assert tests is not None, "the training has written it"
    return tests


def _are_tests(configuration: SegmentationConfiguration, data: Any) -> bool:
    """Return whether JSON data are scores of a configuration's tests, as `score_all` makes them."""
    tests, scheme = configuration.data.tests, configuration.scheme()
    has_tests = isinstance(data, dict) and data.keys() == tests.keys()
    return has_tests and all(are_scores(data[name], target_names(sources, scheme)) for name, sources in tests.items())


def _reuse_pretraining(configuration: SegmentationConfiguration, target: Path, output: Path) -> None:
    """Copy a run of the experiment that trained just the first part of fine-tuning to `target`, if there is one."""
    data = lasting_data(configuration.model_copy(update={"set_up": "synthetic"}).to_dict())
    if (target / CONFIGURATION).is_file():
        return
    for file in sorted(output.glob(f"*/*/{CONFIGURATION}")):
        stored = read_json(file)
        if isinstance(stored, dict) and lasting_data(stored) == data and (file.parent / METRICS).is_file():
            for name in (CONFIGURATION, CHECKPOINT, HISTORY):
                write_file(target / name, (file.parent / name).read_bytes(), overwrite=True)
            return


def _test_variant(
    configuration: SegmentationConfiguration, folder: Path, file: Path, progress: Progress
) -> dict[str, Any]:
    """Return a trained run's test scores under another configuration, cached in `file` by configuration and weights."""
    run = Run(folder, configuration)
    are_sound = partial(_are_tests, configuration)
    return cached_scores(run, file, lambda: score_all(trained_model(run), configuration, progress), are_sound)


def table(title: str, results: Mapping[str, Mapping[str, Any]], variants: Sequence[str] = ()) -> str:
    """Return a Markdown page with a table per test: IoU of each class and variant, %, mean (standard deviation).

    Args:
        title: title above the tables.
        results: variant -> seed -> test -> scores as of `Confusion.to_dict`.
        variants: names of the variants to show; empty for all.
    """
    chosen_results = {name: results[name] for name in variants or results}
    return f"# {title}\n\n{tables_by_test(chosen_results)}\n"
