"""Set-up of tests of commands on wrong files: a folder to work in, whose temporary files are watched, and figures."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.files.command_figures import FIGURES, Figures
from tests.helpers.files.command_runs import MakeWorkplace, Workplace


@pytest.fixture(scope="session")
def learning_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which commands that learn, or use what was learned, work; made once."""
    from tests.helpers.files.learning_inputs import ship_models, write_inputs

    folder = tmp_path_factory.mktemp("learning")
    (folder / "in").mkdir()
    write_inputs(folder / "in")
    ship_models(folder / "in")
    return folder


@pytest.fixture
def workplace(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    record_property: Callable[[str, object], None],
) -> Iterator[MakeWorkplace]:
    """Return what makes a workplace of the folder whose ``in`` holds the inputs; its figures are told at the end."""
    made: list[Workplace] = []

    def make(folder: Path, target: str, **more: Any) -> Workplace:
        temporary = folder / "tmp"
        temporary.mkdir(exist_ok=True)
        (here := folder / "here").mkdir(exist_ok=True)
        monkeypatch.chdir(here)  # names that lead nowhere lead here
        monkeypatch.setenv("TMPDIR", str(temporary))
        monkeypatch.setattr(tempfile, "tempdir", str(temporary))
        made.append(Workplace(folder, capsys, Figures(target), **more))
        return made[-1]

    yield make
    for each in made:
        record_property(FIGURES, asdict(each.figures))
