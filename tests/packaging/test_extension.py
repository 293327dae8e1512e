"""The extension: it is built and valid, and holds what it should and no more. `tests/doors` installs and runs it."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import re
import subprocess
import sys
import tomllib
import zipfile
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

from tools.build_extension import (
    EXTENSIONS,
    INDEX,
    RELEASES,
    BuildError,
    Release,
    archive_name,
    blender_tool,
    current_platform,
    download,
    write_index,
)
from tools.build_kernels import TARGETS

ROOT = Path(__file__).resolve().parents[2]

pytestmark = [
    pytest.mark.skipif(importlib.util.find_spec("bpy") is None, reason="Blender's own tool comes with bpy"),
    pytest.mark.first_python,  # the zips of all Pythons are built by either
]


def _build(folder: Path) -> None:
    command = [sys.executable, ROOT / "tools" / "build_extension.py", "--output-dir", folder]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr


def _names(archive: Path) -> list[str]:
    with zipfile.ZipFile(archive) as content:
        assert content.testzip() is None
        return content.namelist()


def _manifest(archive: Path) -> dict[str, Any]:
    with zipfile.ZipFile(archive) as content:
        return tomllib.loads(content.read("blender_manifest.toml").decode("utf-8"))


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the extensions built for this platform (wheels are downloaded once into build/wheels)."""
    folder = tmp_path_factory.mktemp("extension")
    _build(folder)
    return folder


@pytest.fixture(params=[one for one in RELEASES if current_platform() in one.platforms], ids=lambda one: one.name)
def release(request: pytest.FixtureRequest) -> Release:
    """Return the releases of Blender that a zip is for."""
    chosen: Release = request.param
    return chosen


@pytest.fixture
def archive(dist: Path, release: Release) -> Path:
    """Return the add-on's zip for these releases."""
    return dist / archive_name(EXTENSIONS[0], current_platform(), release)


def test_all_zips_are_there_and_no_others(dist: Path) -> None:
    here = current_platform()
    wanted = {archive_name(*row) for row in product(EXTENSIONS, [here], RELEASES) if here in row[2].platforms}
    assert {path.name for path in dist.glob("*.zip")} == wanted


def test_manifest_differs_from_the_committed_one_by_platform_releases_and_wheels(
    archive: Path, release: Release
) -> None:
    committed = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    built = _manifest(archive)
    assert built.pop("platforms") == [current_platform()]
    assert built.pop("wheels")
    assert (built.pop("blender_version_min"), built.pop("blender_version_max", None)) == (release.first, release.before)
    assert built == {key: value for key, value in committed.items() if key != "blender_version_min"}


def test_holds_every_module_and_data_file_once(archive: Path) -> None:
    addon, names = ROOT / "synthroads_addon", _names(archive)
    files = [path for path in addon.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    expected = {
        path.relative_to(addon).as_posix()
        for path in files
        if not path.name.startswith(".") and path.suffix not in {".so", ".dll", ".dylib"}
    }
    extra = {name for name in names if not name.startswith("wheels/")} - expected
    assert expected <= set(names)
    target, library = current_platform(), "presets/node_groups/node_groups.blend"
    kernels = {
        f"scanning/kernels/{path.stem}-{target}.{TARGETS[target][1]}" for path in addon.glob("scanning/kernels/*.c")
    }
    assert kernels
    assert extra == {"LICENSE", "THIRD_PARTY.txt", "blender_manifest.toml", library, *kernels}
    assert len(names) == len(set(names))


def test_holds_no_tests_caches_or_tools(archive: Path) -> None:
    for name in _names(archive):
        assert name.split("/")[0] not in {"tests", "tools", "studies", "headless", "ml", "docs"}, name
        assert "__pycache__" not in name.split("/"), name
        assert not name.endswith((".pyc", ".blend1", ".zip")), name


def test_holds_wheels_for_its_python_alone(archive: Path, release: Release) -> None:
    wheels = [name for name in _names(archive) if name.endswith(".whl")]
    assert sorted(_manifest(archive)["wheels"]) == sorted(f"./{name}" for name in wheels)
    compiled = {"embreex", "lazrs", "openexr", "pillow", "pydantic_core", "pyproj", "pyyaml", "rasterio", "scipy"}
    tag = f"cp{release.python.replace('.', '')}"
    assert {Path(wheel).name.split("-")[0] for wheel in wheels if f"-{tag}-" in wheel} == compiled
    assert all(f"-{tag}-" in wheel or "-none-any" in wheel for wheel in wheels)
    assert not [wheel for wheel in wheels if Path(wheel).name.startswith("numpy-")], "Blender has NumPy"


def test_is_no_larger_than_it_must_be(dist: Path) -> None:
    for path in dist.glob("*.zip"):
        assert path.stat().st_size < 150e6, path.name


def test_ifc_comes_by_an_extension_of_its_own(dist: Path, archive: Path, release: Release) -> None:
    other = dist / archive_name(EXTENSIONS[1], current_platform(), release)
    wheels = [name for name in _names(other) if name.endswith(".whl")]
    (writer,) = (Path(name).name for name in wheels if name.startswith("wheels/ifcopenshell-"))
    assert writer.split("-")[2] == f"py{release.python.replace('.', '')}"
    own, manifest = _manifest(other), _manifest(archive)
    for key in ("version", "platforms", "blender_version_min"):
        assert own[key] == manifest[key]
    assert own.get("blender_version_max") == manifest.get("blender_version_max")


def test_the_index_offers_each_blender_the_zip_of_its_python(dist: Path) -> None:
    """Blender takes what an index says of releases, platforms and Pythons; what it lists has these hashes."""
    entries = json.loads((dist / INDEX).read_text(encoding="utf-8"))["data"]
    assert {Path(entry["archive_url"]).name for entry in entries} == {path.name for path in dist.glob("*.zip")}
    for entry in entries:
        data = (dist / entry["archive_url"]).read_bytes()
        assert entry["archive_hash"] == f"sha256:{hashlib.sha256(data).hexdigest()}"
    for blender, python in (((4, 5, 15), "3.11"), ((5, 0, 1), "3.11"), ((5, 2, 3), "3.13"), ((5, 2, 0), "3.14")):
        fitting = [entry for entry in entries if entry["id"] == "synthroads" and _is_offered(entry, blender, python)]
        assert len(fitting) == 1, (blender, python)


def _is_offered(entry: dict[str, Any], blender: tuple[int, ...], python: str) -> bool:
    """Return whether Blender's own filter lets an index's entry through."""
    spec = importlib.util.spec_from_file_location("blender_ext", blender_tool())
    assert spec
    assert spec.loader
    tool = sys.modules.setdefault("blender_ext", importlib.util.module_from_spec(spec))
    if not hasattr(tool, "repository_filter_skip"):
        spec.loader.exec_module(tool)
    skipped = tool.repository_filter_skip(
        entry,
        filter_blender_version=blender,
        filter_platform=current_platform(),
        filter_python_version=(*map(int, python.split(".")), 0),
        skip_message_fn=None,
        error_fn=pytest.fail,
    )
    return not skipped


def test_the_index_leaves_out_what_isnt_of_this_build(dist: Path, archive: Path, tmp_path: Path) -> None:
    for name in (archive.name, "synthroads-0.0.1-linux_x64.zip"):
        (tmp_path / name).symlink_to(archive)
    entries = json.loads(write_index(tmp_path).read_text(encoding="utf-8"))["data"]
    assert [entry["archive_url"] for entry in entries] == [f"./{archive.name}"]


def test_lists_the_licences_of_all_wheels(archive: Path) -> None:
    names = _names(archive)
    with zipfile.ZipFile(archive) as content:
        notice = content.read("THIRD_PARTY.txt").decode("utf-8")
    for wheel in (Path(name).name for name in names if name.endswith(".whl")):
        name, version = wheel.split("-")[:2]
        assert f"{name} {version}: ".lower() in notice.replace("-", "_").lower()
    assert "see the wheel" not in notice


def test_a_bill_of_materials_lies_beside_each_zip(dist: Path) -> None:
    for built in sorted(dist.glob("*.zip")):
        text = built.with_suffix(".cdx.json").read_text(encoding="utf-8")
        assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
        listed = {part["purl"].partition("file_name=")[2]: part for part in json.loads(text)["components"]}
        with zipfile.ZipFile(built) as content:
            wheels = {Path(name).name: content.read(name) for name in content.namelist() if name.endswith(".whl")}
        assert listed.keys() == wheels.keys()
        for name, part in listed.items():
            assert part["hashes"] == [{"alg": "SHA-256", "content": hashlib.sha256(wheels[name]).hexdigest()}]


def test_a_wheel_with_another_hash_is_refused(tmp_path: Path) -> None:
    text = re.sub(r"sha256:[0-9a-f]{8}", "sha256:00000000", EXTENSIONS[1].lock.read_text(encoding="utf-8"))
    (tmp_path / "lock.txt").write_text(text, encoding="utf-8")
    with pytest.raises(BuildError, match=r"pip did not get the wheels for Python 3\.11"):
        download(tmp_path / "lock.txt", "3.11", "linux-x64", tmp_path / "wheels")
    assert not (tmp_path / "wheels").exists()


@pytest.mark.slow
def test_same_source_gives_the_same_bytes(dist: Path, tmp_path: Path) -> None:
    _build(tmp_path)
    for first, second in zip(sorted(dist.iterdir()), sorted(tmp_path.iterdir()), strict=True):
        assert first.name == second.name
        assert first.read_bytes() == second.read_bytes()
