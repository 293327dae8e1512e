"""Set-up of all tests: a Blender that is nobody's own, an empty scene for each test, and a way out without a crash."""

from __future__ import annotations

import gc
import importlib.util
import os
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING
from zlib import crc32

import hypothesis
import pytest

from tests.folders import BLENDER_TESTS, LONG_FILES
from tests.helpers.files.command_figures import FIGURES, figures_table

if TYPE_CHECKING:
    from synthroads_addon.cloud.points import PointBlock
    from tests.helpers.scenes.kept_groups import KeptGroups

TESTS = Path(__file__).resolve().parent
HAS_BPY = importlib.util.find_spec("bpy") is not None

# What checks IRIs for jsonschema builds 38 grammars when imported, more than a second in each process, and no file of
# ours has one. URIs are checked by another package.
sys.modules["rfc3987_syntax"] = None  # type: ignore[assignment]

# Before anything imports bpy: it must not read the user's settings and extensions, whose wheels would shadow ours.
BLENDER_FOLDER = Path(tempfile.mkdtemp(prefix="synthroads-blender-"))
os.environ["BLENDER_USER_RESOURCES"] = str(BLENDER_FOLDER)

# The first process, which starts the others that test, says where; theirs alone is of that run, and so of one source.
KEPT_GROUPS = Path(os.environ.setdefault("SYNTHROADS_KEPT_GROUPS", str(BLENDER_FOLDER / "kept_groups")))

HAS_TORCH = importlib.util.find_spec("torch") is not None
LEARNING = (
    *("ml", "fuzz/test_configurations.py", "fuzz/test_learning_data.py"),
    *("fuzz/test_prediction_commands.py", "fuzz/test_training_commands.py"),
    *("jobs/test_documented_classes.py", "jobs/test_named_files.py"),
)
collect_ignore = [*(() if HAS_BPY else BLENDER_TESTS), *(() if HAS_TORCH else LEARNING)]

# The same examples in every run, and no time limit for one: the machine may be busy with something else.
hypothesis.settings.register_profile("synthroads", deadline=None, derandomize=True)
hypothesis.settings.load_profile("synthroads")


def pytest_report_header() -> str:
    """Say which Blender the tests run on, without importing it, and whether they learn."""
    learning = "" if HAS_TORCH else "; torch is not installed: tests/ml is left out"
    if not HAS_BPY:
        return f"bpy is not installed: {', '.join(BLENDER_TESTS)} are left out{learning}"
    spec = importlib.util.find_spec("bpy")
    folders = Path(spec.origin).parent.glob("[0-9].[0-9]*") if spec and spec.origin else []
    return f"bpy {', '.join(folder.name for folder in folders)}{learning}"


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say how many tests were skipped for each reason."""
    reports = terminalreporter.getreports("skipped")
    reasons = Counter(str(report.longrepr[-1]).removeprefix("Skipped: ") for report in reports)
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f"skipped {count} times: {reason}")
    ended = [report for report in terminalreporter.getreports("") if report.when == "teardown"]
    if rows := [value for report in ended for name, value in report.user_properties if name == FIGURES]:
        terminalreporter.write_line("\n".join(figures_table(rows)))


def pytest_configure(config: pytest.Config) -> None:
    """Have pytest-xdist hand files out in the order that they come in: it would begin with those of most tests."""
    config.option.loadscopereorder = False


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect without looking for garbage, and never look among what is imported then: that took a twentieth."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


@pytest.hookimpl(tryfirst=True)  # before pytest chooses by markers
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files that take longest first, and mark tests as `smoke`.

    These are a tenth of the quick tests that don't depend on Blender's release, drawn by their names.
    """
    order = {TESTS / name: number for number, name in enumerate(LONG_FILES)}
    items.sort(key=lambda item: order.get(item.path, len(order)))
    for item in items:
        free = not _is_blenders(item.path) or item.get_closest_marker("any_blender")
        there = not item.get_closest_marker("first_python") and not item.get_closest_marker("slow")
        if free and there and crc32(item.nodeid.encode()) % 10 == 0:
            item.add_marker("smoke")


def _is_blenders(path: Path) -> bool:
    return path.relative_to(TESTS).parts[0] in BLENDER_TESTS


def _needs_blender(request: pytest.FixtureRequest) -> bool:
    return _is_blenders(request.path)


def _factory_settings() -> None:
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)


def _empty_scene() -> None:
    """Empty the file; Blender's settings and extensions stay, as resetting them takes six times as long."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@cache
def _kept_groups() -> KeptGroups:
    """Return the node groups that tests have made so far; builds keep none of their own."""
    from synthroads_addon.blender.nodes import kept_groups
    from tests.helpers.scenes.kept_groups import KeptGroups

    kept_groups.kept_file = lambda: None  # type: ignore[assignment]

    KEPT_GROUPS.mkdir(exist_ok=True)
    return KeptGroups(KEPT_GROUPS)


@pytest.fixture(scope="session")
def kept_groups() -> KeptGroups:
    """The node groups that tests have made so far; `on` says whether they are taken again."""
    return _kept_groups()


@pytest.fixture(scope="module", autouse=True)
def _empty_scene_for_module(request: pytest.FixtureRequest) -> Iterator[None]:
    """Start each module of tests of Blender with factory settings and an empty scene; leave none of its data behind."""
    if not _needs_blender(request):
        yield
        return
    _kept_groups().on = True
    _factory_settings()
    yield
    _empty_scene()


@pytest.fixture(autouse=True)
def _no_lines_of_slow_work(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands tell every ten seconds that they are at work: on a busy machine beside any message that is tested."""
    progress = sys.modules.get("headless.progress")
    if progress is not None and request.path.name != "test_messages.py":
        monkeypatch.setattr(progress, "INTERVAL", 1000.0)


@pytest.fixture(autouse=True)
def _empty_scene_for_test(request: pytest.FixtureRequest, _empty_scene_for_module: None) -> None:
    """Start each test of Blender with an empty scene, unless it is marked `keep_scene`.

    The road model's node groups are taken from a test before, unless it is marked `new_groups`.
    """
    if not _needs_blender(request):
        return
    _kept_groups().on = request.node.get_closest_marker("new_groups") is None
    if not request.node.get_closest_marker("keep_scene"):
        _empty_scene()


@pytest.fixture
def points() -> PointBlock:
    """Return 10,000 random points."""
    from tests.helpers.clouds.random_points import make_points

    return make_points(10_000)


_session: list[pytest.Session] = []


def pytest_sessionstart(session: pytest.Session) -> None:
    """Remember the session: its exit code is final only at the very end."""
    _session.append(session)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Leave the process hard where bpy is loaded: its own teardown can crash after all tests have passed.

    Reports and summary are written by now. Under pytest-xdist the worker has still to talk to its controller.
    """
    shutil.rmtree(BLENDER_FOLDER, ignore_errors=True)
    if "bpy" not in sys.modules or not _session or hasattr(config, "workerinput"):
        return
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(int(_session[0].exitstatus))
