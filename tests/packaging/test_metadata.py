"""The manifest, pyproject.toml and the list of bundled wheels agree."""

from __future__ import annotations

import importlib.metadata
import re
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import noxfile
from tools.build_extension import EXTENSIONS, read_wheel_list

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
WHEEL_LISTS = [extension.wheel_list for extension in EXTENSIONS]
PINS = {
    canonicalize_name(requirement.name): str(next(iter(requirement.specifier)).version)
    for requirement in map(
        Requirement,
        re.findall(r"^[^#\s].*", "\n".join(path.read_text(encoding="utf-8") for path in WHEEL_LISTS), re.MULTILINE),
    )
}
BASE = [Requirement(text) for text in PYPROJECT["project"]["dependencies"]]


def test_version_stands_in_the_manifest_alone() -> None:
    hatch = PYPROJECT["tool"]["hatch"]["version"]
    text = (ROOT / hatch["path"]).read_text(encoding="utf-8")
    match = re.search(hatch["pattern"], text, re.MULTILINE)
    assert match is not None
    assert match["version"] == MANIFEST["version"]
    assert "version" not in PYPROJECT["project"]


def test_installed_version_is_the_manifests() -> None:
    try:
        installed = importlib.metadata.version("synthroads")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("synthroads is not installed here")
    assert installed == MANIFEST["version"]


def test_name_and_licence_agree() -> None:
    project = PYPROJECT["project"]
    assert project["name"] == MANIFEST["id"]
    assert MANIFEST["license"] == [f"SPDX:{project['license']}"]
    assert MANIFEST["maintainer"] == project["authors"][0]["name"]
    assert "GNU GENERAL PUBLIC LICENSE" in (ROOT / "LICENSE").read_text(encoding="utf-8")[:200]


def test_citation_is_of_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert citation["title"] == MANIFEST["name"]
    assert citation["version"] == MANIFEST["version"]
    assert citation["license"] == PYPROJECT["project"]["license"]
    assert citation["authors"] == PYPROJECT["project"]["authors"]


def test_manifest_as_committed_has_no_wheels() -> None:
    assert "wheels" not in MANIFEST
    assert "platforms" not in MANIFEST


@pytest.mark.parametrize("requirement", BASE, ids=lambda requirement: requirement.name)
def test_bundled_versions_fit_the_dependencies(requirement: Requirement) -> None:
    name = canonicalize_name(requirement.name)
    if name == "numpy":
        assert name not in PINS, "Blender has NumPy: a second one would break it"
        return
    assert PINS[name] in requirement.specifier


def test_one_blender_for_each_python() -> None:
    lines = [Requirement(text) for text in PYPROJECT["project"]["optional-dependencies"]["blender"]]
    for python in ("3.11", "3.13"):
        fitting = [line for line in lines if line.marker and line.marker.evaluate({"python_version": python})]
        assert [line.name for line in fitting].count("bpy") == 1, python


def test_no_init_file_in_the_root() -> None:
    assert not (ROOT / "__init__.py").exists(), "it breaks pytest, which would take the root for a package"


def _locked(path: Path) -> list[Requirement]:
    """Return the packages of a lock; each has its version and the hashes of its files."""
    blocks = re.split(r"(?m)^(?=[a-z0-9])", path.read_text(encoding="utf-8"))[1:]
    assert all(re.search(r"--hash=sha256:[0-9a-f]{64}", block) for block in blocks)
    return [Requirement(block.split("\\", 1)[0]) for block in blocks]


ENVIRONMENTS = [
    (name, python) for name in noxfile.EXTRAS for python in noxfile.BLENDER if "-" not in name or name.endswith(python)
]


@pytest.mark.parametrize(("name", "python"), ENVIRONMENTS)
def test_locks_hold_versions_in_the_ranges(name: str, python: str) -> None:
    machine = {"python_version": python, "python_full_version": f"{python}.0", "sys_platform": "linux"}
    machine |= {"platform_machine": "x86_64", "platform_system": "Linux"}
    lines = _locked(ROOT / noxfile.lock_of(name, python))
    lock = [line for line in lines if not line.marker or line.marker.evaluate(machine)]
    versions = {canonicalize_name(line.name): str(next(iter(line.specifier)).version) for line in lock}
    assert len(versions) == len(lock), "a package stands there twice"
    offered = PYPROJECT["project"]["optional-dependencies"]
    for asked in [*BASE, *(Requirement(text) for extra in noxfile.EXTRAS[name].split(",") for text in offered[extra])]:
        if asked.name != "torch" and (not asked.marker or asked.marker.evaluate(machine)):
            assert versions[canonicalize_name(asked.name)] in asked.specifier, f"nox -s lock: {asked}"


def test_locks_of_bundled_wheels_are_of_the_listed_versions() -> None:
    lines = [line for extension in EXTENSIONS for line in _locked(extension.lock)]
    assert {canonicalize_name(line.name): str(next(iter(line.specifier)).version) for line in lines} == PINS


def test_extensions_bring_one_version_of_what_they_share() -> None:
    """Blender unpacks the wheels of all extensions into one folder."""
    lines = {line for extension in EXTENSIONS for line in read_wheel_list(extension.wheel_list)}
    names = [canonicalize_name(Requirement(line).name) for line in lines]
    assert len(names) == len(set(names)), sorted(lines)


def test_no_lock_names_where_packages_come_from() -> None:
    for path in sorted((ROOT / "tools" / "locks").glob("*.txt")):
        assert not re.search(r"://|--(extra-)?index|--find-links", path.read_text(encoding="utf-8")), path.name
