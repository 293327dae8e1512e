"""All that README, docs/start.md, tutorials show works in the environment of `make demo`, and with each extra."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.doors.documented import documented_lines
from tests.doors.environments import places, run
from tests.doors.inputs import empty_binary_map
from tests.doors.run_documented import Outcome, rows_of, run_documented
from tests.doors.small_sizes import EXTRAS

pytestmark = pytest.mark.doors

_RUN = [(line, row) for line, row in rows_of(documented_lines()) if row and not row.reason]
LINES = [line.key for line, _ in _RUN]
NEEDING = [(extra, line.key) for line, row in _RUN for extra in EXTRAS if extra in row.needs]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the working folder in which a reader types all lines."""
    return tmp_path_factory.mktemp("reader")


@pytest.fixture(scope="module")
def outcomes(folder: Path) -> dict[str, Outcome]:
    """Return how each line that is run here ended in the environment of `make demo`."""
    every = places()["every_line"]
    found = run_documented(Path(places()["demo"]), folder, chosen=lambda row: every or row.both)
    return {one.line.key: one for one in found}


@pytest.mark.parametrize("line", LINES)
def test_after_make_demo(line: str, outcomes: dict[str, Outcome]) -> None:
    if line not in outcomes:
        assert not places()["every_line"]
        pytest.skip("lines that no release of Blender answers otherwise are run on one Python; make doors: on both")
    assert not outcomes[line].fault, str(outcomes[line])


@pytest.fixture(scope="module")
def with_extras(folder: Path, outcomes: dict[str, Outcome]) -> dict[tuple[str, str], Outcome]:
    """Return how each line that needs an extra ended where that one was installed, by extra and line."""
    assert outcomes, "the lines find what those before them wrote"
    return {
        (extra, one.line.key): one
        for extra, python in places()["extras"].items()
        for one in run_documented(Path(python), folder, [extra], lambda row, extra=extra: row.needs & {extra})
    }


@pytest.mark.parametrize(("extra", "line"), NEEDING)
def test_with_an_extra(extra: str, line: str, with_extras: dict[tuple[str, str], Outcome]) -> None:
    if extra not in places()["extras"]:
        pytest.skip("extras are tried on one Python, as they don't depend on Blender")
    assert not with_extras[extra, line].fault, str(with_extras[extra, line])


def test_nothing_of_the_tests_is_there() -> None:
    python = places()["demo"]
    answer = run(python, "-c", "import pytest", folder=Path(python).parent)
    assert "No module named 'pytest'" in answer.stderr


@pytest.mark.parametrize("extra", EXTRAS)
def test_an_extra_goes_with_what_is_there(extra: str) -> None:
    """Pip takes no notice of what other packages allow when it brings a newer NumPy; its check does."""
    if extra in places()["extras"]:
        answer = run(places()["extras"][extra], "-m", "pip", "check", folder=Path(__file__).parent)
        assert answer.returncode == 0, answer.stdout


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("e57", ["cloud", "convert", "out/mine/cloud.laz", "--output", "out/cloud.e57"]),
        ("maps", ["road", "map.pbf", "--list"]),
        ("onnx", ["export", "out/run", "--output", "out/network.onnx"]),
    ],
)
def test_commands_that_no_page_shows(extra: str, words: list[str], folder: Path, outcomes: dict[str, Outcome]) -> None:
    """Without its extra one line says how to install it; with it the command works, or names what else it needs."""
    assert outcomes
    (folder / "map.pbf").write_bytes(empty_binary_map())
    without = run(places()["demo"], "synthroads", *words, folder=folder)
    assert without.returncode == 2, without.stderr
    assert len(without.stderr.splitlines()) == 1
    assert "pip install 'synthroads[" in without.stderr
    if extra in places()["extras"]:
        answer = run(places()["extras"][extra], "synthroads", *words, folder=folder)
        needs_more = answer.returncode == 2 and "pip install 'synthroads[ml]'" in answer.stderr and extra == "onnx"
        assert answer.returncode == 0 or needs_more, answer.stderr
