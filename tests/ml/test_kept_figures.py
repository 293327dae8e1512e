"""Figures that an experiment keeps: taken again, made anew where they are of something else, refused where damaged."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from headless import cli
from tests.helpers.files.learning_inputs import write_inputs

KEPT = {
    "segmentation": {"real/seed-1/metrics.json": "tests", "AdaBN/seed-1.json": "tests"},
    "centerline": {"mixed/without-a-seed-1.json": "tests", "rules/seed-1.json": "rules"},
}
"""Files of an experiment, and the name of the figures in each."""
DATA = {"segmentation": ("data/real", "data/synthetic"), "centerline": ("measured", "roads")}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Return the commands of two experiments, which have been run once."""
    folder = tmp_path_factory.mktemp("inputs")
    write_inputs(folder)
    words = {}
    for kind, (real, synthetic) in DATA.items():
        words[kind] = ["experiment", str(folder / f"{kind}-experiment.yaml"), "--quiet"]
        words[kind] += ["--data", f"real={folder / real}", "--data", f"synthetic={folder / synthetic}"]
        words[kind] += ["--output", str(folder / "out" / kind)]
        assert cli.main(words[kind]) == 0
    return words


CHANGES: dict[str, Callable[[Any, str], Any]] = {
    "a list": lambda data, name: [data],
    "nothing": lambda data, name: None,
    "no figures": lambda data, name: {key: value for key, value in data.items() if key != name},
    "figures that are a number": lambda data, name: {**data, name: 3},
    "figures of nothing": lambda data, name: {**data, name: {}},
    "a part that is a list": lambda data, name: {**data, name: {key: [part] for key, part in data[name].items()}},
    "a text for a number": lambda data, name: {**data, name: _texts(data[name])},
    "a name that is another": lambda data, name: {
        **data,
        name: {f"{key}x": value for key, value in data[name].items()},
    },
}


def _texts(data: Any) -> Any:
    """Return a copy of nested data with texts for numbers."""
    if isinstance(data, dict):
        return {key: _texts(value) for key, value in data.items()}
    return str(data) if isinstance(data, int | float) else data


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(("kind", "file"), [(kind, file) for kind, files in KEPT.items() for file in files])
def test_damaged_figures_are_one_line(
    kind: str, file: str, change: str, done: dict[str, list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    path = Path(done[kind][-1]) / file
    sound = path.read_text()
    path.write_text(json.dumps(CHANGES[change](json.loads(sound), KEPT[kind][file])))
    capsys.readouterr()
    try:
        assert cli.main(done[kind]) == 2
    finally:
        path.write_text(sound)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(
        f"error: {path}: {KEPT[kind][file]}: aren't the figures of this experiment: without the file"
    )


@pytest.mark.parametrize("kind", KEPT)
def test_sound_ones_are_taken_and_others_made_anew(kind: str, done: dict[str, list[str]], tmp_path: Path) -> None:
    words = [*done[kind][:-1], str(tmp_path / "out")]
    shutil.copytree(done[kind][-1], tmp_path / "out")
    before = {file: (tmp_path / "out" / file).stat().st_mtime_ns for file in KEPT[kind]}
    assert cli.main(words) == 0
    assert {file: (tmp_path / "out" / file).stat().st_mtime_ns for file in KEPT[kind]} == before
    for file in KEPT[kind]:
        path = tmp_path / "out" / file
        whole = json.loads(path.read_text())
        if "made_from" in whole:
            path.write_text(json.dumps(whole | {"made_from": {"x": 1}}))
        else:
            path.unlink()
    assert cli.main(words) == 0
    assert all((tmp_path / "out" / file).stat().st_mtime_ns != before[file] for file in KEPT[kind])
