"""Work of `make` and nox: finding a Python, saying what is missing, failing where nothing was tested."""

from __future__ import annotations

import itertools
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import noxfile
from tests.folders import BLENDER_TESTS, LONG_FILES

ROOT = Path(__file__).resolve().parents[2]
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")

needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="needs make")

# A Python that makes no environment and says so; as Debian has it, if python3-venv isn't installed.
FAKE = """#!/bin/sh
if [ "$1" = -m ]; then echo "$0 makes an environment"; exit 3; fi
PROBE="$2" exec {python} -I -c '
import os, sys
{lack}
exec(os.environ["PROBE"])'
"""
WITHOUT_VENV = 'sys.modules["ensurepip"] = None'


def _make(*arguments: str, folder: Path = ROOT, **environment: str) -> subprocess.CompletedProcess[str]:
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    return subprocess.run(
        [shutil.which("make") or "make", *arguments],
        cwd=folder,
        env={**inherited, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def _lint_with(folder: Path, **pythons: str) -> subprocess.CompletedProcess[str]:
    """Call `make lint` where these are all the Pythons there are: a name and what the interpreter lacks."""
    programs = folder / "bin"
    programs.mkdir()
    (programs / "sh").symlink_to(shutil.which("sh") or "")
    for name, lack in pythons.items():
        (programs / name).write_text(FAKE.format(python=sys.executable, lack=lack))
        (programs / name).chmod(0o755)
    (folder / "Makefile").write_text(MAKEFILE)
    return _make("lint", folder=folder, PATH=str(programs), HOME=str(folder), PYENV_ROOT=str(folder), PYTHON="")


@needs_make
def test_names_the_debian_package_without_which_there_are_no_environments(tmp_path: Path) -> None:
    answer = _lint_with(tmp_path, python3=WITHOUT_VENV)
    assert answer.returncode != 0
    assert "apt install python3 python3-venv" in answer.stderr


@needs_make
def test_takes_the_first_python_that_can_make_environments(tmp_path: Path) -> None:
    other_version = "sys.version_info = (3, 12, 0)"
    answer = _lint_with(tmp_path, **{"python3.11": other_version, "python3.13": WITHOUT_VENV, "python3": ""})
    assert "python3 makes an environment" in answer.stdout
    assert "python3.1" not in answer.stdout


@needs_make
def test_make_alone_says_what_there_is() -> None:
    answer = _make()
    assert answer.returncode == 0, answer.stderr
    targets = re.findall(r"^\.PHONY: (.*)$", MAKEFILE, re.MULTILINE)[0].split()
    assert {"demo", "test", "lint", "extension", "clean", "help"} <= set(targets)
    for target in targets:
        assert f"make {target} " in answer.stdout


def test_make_sets_up_the_nox_that_the_tests_know() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert re.findall(r'"(nox[<=>][^"]*)"', MAKEFILE)[0] in project["optional-dependencies"]["dev"]


def test_finds_pyenvs_versions(tmp_path: Path) -> None:
    for version in ("3.9.18", "3.11.7", "3.13.0", "3.13.0t"):
        (tmp_path / "versions" / version / "bin").mkdir(parents=True)
    found = [Path(folder).parent.name for folder in noxfile.pyenv_folders(tmp_path)]
    assert found == ["3.11.7", "3.13.0"], "free-threaded ones have no wheels of Blender"


@pytest.mark.parametrize(
    ("file", "old", "new", "matters"),
    [
        ("pyproject.toml", "line-length = 120", "line-length = 100", False),
        ("pyproject.toml", '"furo>=2025.9"', '"furo>=2025.10"', False),
        ("pyproject.toml", '"bpy>=4.5.15,<4.6;', '"bpy>=4.5.16,<4.6;', True),
        ("pyproject.toml", '"tqdm>=4.66,<5"', '"tqdm>=4.67,<5"', True),
        ("blender_manifest.toml", '\nversion = "', '\nversion = "9', True),
    ],
)
def test_environments_are_renewed_when_their_packages_change(
    tmp_path: Path, file: str, old: str, new: str, matters: bool
) -> None:
    for name in ("pyproject.toml", "blender_manifest.toml"):
        shutil.copy(ROOT / name, tmp_path)
    before = noxfile.made_from("blender", tmp_path)
    text = (tmp_path / file).read_text(encoding="utf-8")
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new), encoding="utf-8")
    assert (noxfile.made_from("blender", tmp_path) != before) == matters


def test_extras_are_those_of_the_package() -> None:
    for extras in noxfile.EXTRAS.values():
        assert noxfile.made_from(extras, ROOT)


def test_nox_and_the_tests_agree_on_what_needs_blender() -> None:
    assert tuple(f"tests/{name}" for name in BLENDER_TESTS) == noxfile.BLENDER_TESTS


def test_files_that_take_longest_are_there() -> None:
    assert [name for name in LONG_FILES if not (ROOT / "tests" / name).is_file()] == []


def test_blender_and_the_other_tests_have_processes_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(noxfile, "ONLY", {("3.13", "others"): "smoke or ui"})
    assert noxfile.pytest_runs("3.13", "not slow", ["-x"]) == [
        ["-m", "(not slow) and not alone", "-x", *noxfile.BLENDER_TESTS],
        [
            *("-m", "(smoke or ui) and (not slow) and not alone", "-x", "tests"),
            *(f"--ignore={name}" for name in noxfile.BLENDER_TESTS),
        ],
    ]
    named = ["tests/road/test_alignment.py", "-q"]
    assert noxfile.pytest_runs("3.11", "not slow", named) == [named]


def test_tests_of_the_clock_are_run_after_the_others_without_a_neighbour() -> None:
    *_, last = noxfile.pytest_runs("3.11", noxfile.SLOW, ["-x"])
    assert last == ["-x", "-n", "0", "-m", "alone", *noxfile.BLENDER_TESTS]
    assert all("alone" not in run for run in noxfile.pytest_runs("3.13", noxfile.SLOW, []))
    assert all("alone" not in run for run in noxfile.pytest_runs("3.11", noxfile.QUICK, []))


def test_slow_tests_of_the_second_blender_hold_what_its_quick_ones_leave_out() -> None:
    """Each combination of markers is run by one of the two, and those on the first Blender alone by neither."""
    quick, slow = (noxfile.pytest_runs("3.13", markers, [])[0][1] for markers in (noxfile.QUICK, noxfile.SLOW))
    names = ("slow", "fuzz", "cluster", "doors", "alone", "smoke", "any_blender")
    for chosen in itertools.product((False, True), repeat=len(names)):
        has = dict(zip(names, chosen, strict=True))
        runs = [eval(expression, {}, has) for expression in (quick, slow)]  # marker expressions are Python's
        if has["fuzz"] or has["cluster"] or has["doors"] or has["alone"] or has["slow"]:
            continue
        assert sum(runs) == 1, has


def test_a_part_without_tests_is_a_failure_unless_some_tests_were_chosen() -> None:
    assert noxfile.passed([0, 0], everything=True)
    assert noxfile.passed([5, 0], everything=False)
    for codes, everything in [([5, 0], True), ([5, 5], False), ([1, 0], False), ([0, -6], True)]:
        assert not noxfile.passed(codes, everything=everything)


def test_testing_nothing_is_a_failure() -> None:
    command = [sys.executable, "-m", "nox", "-s", "summary"]
    answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 1
    assert "Python 3.11 (Blender 4.5 LTS): NOT RUN" in answer.stderr
    assert "Python 3.13 (Blender 5.2 LTS): NOT RUN" in answer.stderr
    assert "nothing was tested" in answer.stderr


TESTS_THAT_SKIP = """
import pytest

@pytest.mark.parametrize("number", range(3))
def test_three(number):
    pytest.skip("no judge")

@pytest.mark.skipif(True, reason="no GPU")
def test_one():
    pass
"""


@pytest.mark.first_python
def test_skips_are_counted_by_reason(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text((ROOT / "tests" / "conftest.py").read_text(encoding="utf-8"))
    (tmp_path / "test_one.py").write_text(TESTS_THAT_SKIP)
    (tmp_path / "test_two.py").write_text('import pytest\npytest.skip("no judge", allow_module_level=True)\n')
    command = [sys.executable, "-m", "pytest", "-q", "-n", "2", "--rootdir", tmp_path, "-c", os.devnull, tmp_path]
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "skipped 4 times: no judge\nskipped 1 times: no GPU\n" in answer.stdout
