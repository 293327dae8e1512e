"""The set-up that `make` does: finding a Python, saying what is missing, failing where nothing was tested."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
VERSION = "{}.{}".format(*sys.version_info)

pytestmark = pytest.mark.skipif(shutil.which("sh") is None, reason="needs a POSIX shell")

# A Python as Debian has it where python3.X-venv is not installed: $1 $2 are -I -c, $3 is the probe, $4 the version.
WITHOUT_VENV = """#!/bin/sh
PROBE="$3" exec {python} -I -c '
import os, sys
sys.modules["ensurepip"] = None
exec(os.environ["PROBE"])' "$4"
"""


def _bare_path(folder: Path) -> str:
    """Return a PATH that has the usual tools and no Python."""
    for name in ("sh", "cat", "date", "dirname", "ls", "mktemp", "readlink", "rm", "sed", "tail", "which"):
        found = shutil.which(name)
        assert found is not None, name
        (folder / name).symlink_to(found)
    return str(folder)


def _script(name: str, *arguments: str, path: str, home: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", ROOT / "tools" / name, *arguments],
        env={"PATH": path, "HOME": str(home)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """Return a folder that is a PATH without a Python."""
    folder = tmp_path / "bin"
    folder.mkdir()
    _bare_path(folder)
    return folder


def test_finds_a_python_by_its_version_and_not_by_its_name(bare: Path, tmp_path: Path) -> None:
    wrong = "3.11" if VERSION != "3.11" else "3.13"
    (bare / f"python{wrong}").symlink_to(sys.executable)
    (bare / "python3").symlink_to(sys.executable)
    found = _script("find_python.sh", VERSION, path=str(bare), home=tmp_path)
    assert found.returncode == 0, found.stderr
    answer = subprocess.run([found.stdout.strip(), "--version"], capture_output=True, text=True, check=True)
    assert answer.stdout.startswith(f"Python {VERSION}.")
    assert _script("find_python.sh", wrong, path=str(bare), home=tmp_path).returncode == 1


def test_passes_over_a_shim_that_fails_and_finds_pyenvs_versions(bare: Path, tmp_path: Path) -> None:
    shim = bare / f"python{VERSION}"
    shim.write_text("#!/bin/sh\necho 'pyenv: command not found' >&2\nexit 127\n")
    shim.chmod(0o755)
    versions = tmp_path / ".pyenv" / "versions" / f"{VERSION}.0" / "bin"
    versions.mkdir(parents=True)
    (versions / "python3").symlink_to(sys.executable)
    found = _script("find_python.sh", VERSION, path=str(bare), home=tmp_path)
    assert found.returncode == 0, found.stderr


def test_names_the_debian_package_without_which_there_are_no_environments(bare: Path, tmp_path: Path) -> None:
    python = bare / f"python{VERSION}"
    python.write_text(WITHOUT_VENV.format(python=sys.executable))
    python.chmod(0o755)
    found = _script("find_python.sh", VERSION, path=str(bare), home=tmp_path)
    assert found.returncode == 1
    assert f"apt install python{VERSION}-venv" in found.stderr


def test_testing_nothing_is_a_failure(bare: Path, tmp_path: Path) -> None:
    answer = _script("run_tests.sh", "dev", "dev", "not slow", path=str(bare), home=tmp_path)
    assert answer.returncode == 1
    assert "Python 3.11 (Blender 4.5 LTS): NOT RUN" in answer.stdout
    assert "Python 3.13 (Blender 5.2 LTS): NOT RUN" in answer.stdout
    assert "Nothing was tested" in answer.stderr


def _tool(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_missing_system_libraries_are_named_with_their_packages() -> None:
    check_bpy = _tool("check_bpy")
    libraries = check_bpy.missing_libraries(
        "\tlibXi.so.6 => not found\n\tlibm.so.6 => /lib/x86_64-linux-gnu/libm.so.6 (0x00007f0000000000)\n"
        "\tlibSM.so.6 => not found\n\tlibodd.so.1 => not found\n\tlibXi.so.6 => not found\n"
    )
    assert libraries == ["libXi.so.6", "libSM.so.6", "libodd.so.1"]
    advice = check_bpy.advice(libraries)
    assert "sudo apt install libsm6 libxi6\n" in advice
    assert advice.endswith("libodd.so.1")


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_alone_says_what_there_is() -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    answer = subprocess.run(["make"], cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    targets = re.findall(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)[0].split()
    assert {"demo", "test", "lint", "extension", "clean", "help"} <= set(targets)
    for target in targets:
        assert f"make {target} " in answer.stdout
