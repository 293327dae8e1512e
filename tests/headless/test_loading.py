"""Commands load what they need and no more; a package that an extra brings is named with its extra."""

from __future__ import annotations

import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from headless.cli import COMMANDS
from headless.error_lines import EXTRAS, missing_package

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="the system can't copy a process")
FOR_USERS = ("blender", "changes", "cluster", "e57", "maps", "ml", "onnx", "twin")
"""Extras that users install for a command; the others are for those who work on the project."""

LOADED = """
import json, os, sys
from headless import cli
for command in sys.argv[1:]:
    child = os.fork()  # so that Python itself is started once
    if not child:
        try:
            cli.main([*command.split(), "--help"])
        except SystemExit:
            pass
        print(json.dumps([command, *sys.modules]), file=sys.stderr, flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""


@pytest.fixture(scope="module")
def loaded() -> dict[str, set[str]]:
    """Return the names of the modules that each command has loaded when its help is printed; "" is `synthroads`."""
    call = [sys.executable, "-c", LOADED, "", *COMMANDS]
    answer = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, check=True)
    assert answer.stdout.count("usage: synthroads") == len(COMMANDS) + 1
    lines = map(json.loads, answer.stderr.splitlines())
    return {command: set(names) for command, *names in lines}


@needs_fork
def test_help_loads_no_library_and_no_command(loaded: dict[str, set[str]]) -> None:
    assert not loaded[""] & {"numpy", "pydantic", "scipy", *EXTRAS}
    assert not loaded[""] & {f"headless.{name}" for name in COMMANDS}


@needs_fork
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_loads_no_other_and_nothing_of_an_extra(command: str, loaded: dict[str, set[str]]) -> None:
    assert not loaded[command] & EXTRAS.keys()
    others = loaded[command] & {f"headless.{name}" for name in COMMANDS} - {f"headless.{command}"}
    assert others <= ({"headless.generate"} if command == "scan" else set())  # which has all options of a scan


@needs_fork
def test_only_commands_that_take_a_scenario_load_it(loaded: dict[str, set[str]]) -> None:
    scenario = "synthroads_addon.scenario.scenario"
    takes = {
        "generate",
        "epochs",
        "parameters",
        "dataset",
        "scan",
        "calibrate",
        "tradeoff",
        "benchmark",
        "list",
        "road",
    }
    assert {command for command in COMMANDS if scenario in loaded[command]} == takes


@pytest.mark.skipif(not hasattr(os, "wait4"), reason="the system doesn't tell a child's processor time")
def test_help_takes_little_processor_time() -> None:
    def seconds() -> float:
        child = os.posix_spawn(
            sys.executable,
            [sys.executable, "-m", "headless.cli", "--help"],
            os.environ,
            file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)],
        )
        _, status, usage = os.wait4(child, 0)
        assert status == 0
        return usage.ru_utime + usage.ru_stime

    assert min(seconds() for _ in range(5)) < 0.3


def test_each_package_of_an_extra_is_named_with_it() -> None:
    offered = PYPROJECT["project"]["optional-dependencies"]
    brought = {extra: {_name(text) for text in offered[extra]} for extra in FOR_USERS}
    distributions = {
        package: {_name(text) for text in texts}
        for package, texts in importlib.metadata.packages_distributions().items()
    }
    for package, extras in EXTRAS.items():
        if package in distributions:
            assert all(distributions[package] & brought[extra] for extra in extras), package
    by_extra = {extra: {package for package in EXTRAS if extra in EXTRAS[package]} for extra in FOR_USERS}
    for extra, names in by_extra.items():
        covered = set().union(*(distributions.get(name, set()) for name in names))
        wanted = {name for name in brought[extra] if _is_installed(name)} - {"numpy"}
        assert wanted <= covered, f"a package of the extra {extra} has no row in EXTRAS"


def _name(text: str) -> str:
    return re.sub(r"[-_.]+", "-", re.split(r"[^A-Za-z0-9._-]", text, maxsplit=1)[0]).lower()


def _is_installed(name: str) -> bool:
    try:
        importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def test_a_missing_package_is_named_with_the_command_that_brings_it() -> None:
    assert missing_package(ModuleNotFoundError(name="torch.nn")).endswith("run pip install 'synthroads[ml]'")
    assert missing_package(ModuleNotFoundError(name="bpy")).endswith("run pip install 'synthroads[blender]'")
    text = missing_package(ModuleNotFoundError(name="laspy"))
    assert "install and enable the SynthRoads extension in Blender" in text
    with pytest.raises(ModuleNotFoundError):
        missing_package(ModuleNotFoundError(name="synthroads_addon.nothing"))
