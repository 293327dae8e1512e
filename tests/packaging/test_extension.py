"""The extension: it is built and valid, holds what it should and no more, and Blender installs and runs it."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

from tools.build_extension import EXTENSIONS, BuildError, download

ROOT = Path(__file__).resolve().parents[2]
PYTHON_TAGS = {"cp311", "cp313", "cp314"}

pytestmark = [
    pytest.mark.skipif(importlib.util.find_spec("bpy") is None, reason="Blender's own tool comes with bpy"),
    pytest.mark.first_python,  # one zip for all Pythons
]


def _build(folder: Path) -> Path:
    command = [sys.executable, ROOT / "tools" / "build_extension.py", "--output-dir", folder]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    (archive,) = folder.glob("synthroads-*.zip")
    return archive


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the extension built for this platform (the wheels are downloaded once into build/wheels)."""
    return _build(tmp_path_factory.mktemp("extension"))


@pytest.fixture(scope="module")
def names(archive: Path) -> list[str]:
    with zipfile.ZipFile(archive) as content:
        assert content.testzip() is None
        return content.namelist()


@pytest.fixture(scope="module")
def manifest(archive: Path) -> dict[str, list[str]]:
    with zipfile.ZipFile(archive) as content:
        data: dict[str, list[str]] = tomllib.loads(content.read("blender_manifest.toml").decode("utf-8"))
        return data


def test_name_tells_version_and_platform(archive: Path, manifest: dict[str, list[str]]) -> None:
    (platform,) = manifest["platforms"]
    assert archive.name == f"synthroads-{manifest['version']}-{platform.replace('-', '_')}.zip"


def test_manifest_differs_from_the_committed_one_by_platform_and_wheels(manifest: dict[str, list[str]]) -> None:
    committed = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert {key: value for key, value in manifest.items() if key not in ("platforms", "wheels")} == committed


def test_holds_every_module_and_data_file_once(names: list[str]) -> None:
    addon = ROOT / "synthroads_addon"
    files = [path for path in addon.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    kept = [path.relative_to(addon) for path in files if not path.name.startswith(".")]
    expected = {path.as_posix() for path in kept if path.parts[0] not in ("comparison", "reconstruction")}
    extra = {name for name in names if not name.startswith("wheels/")} - expected
    assert expected <= set(names)
    library = "presets/node_groups/node_groups.blend"
    assert extra == {"LICENSE", "THIRD_PARTY.txt", "blender_manifest.toml", library}
    assert len(names) == len(set(names))


def test_holds_no_tests_caches_or_tools(names: list[str]) -> None:
    for name in names:
        assert name.split("/")[0] not in {"tests", "tools", "headless", "ml", "docs"}, name
        assert "__pycache__" not in name.split("/"), name
        assert not name.endswith((".pyc", ".blend1", ".zip")), name


def test_holds_wheels_for_every_python(names: list[str], manifest: dict[str, list[str]]) -> None:
    wheels = [name for name in names if name.endswith(".whl")]
    assert sorted(manifest["wheels"]) == sorted(f"./{name}" for name in wheels)
    for package in ("embreex", "lazrs", "openexr", "pillow", "pydantic_core"):
        tags = {Path(wheel).name.split("-")[2] for wheel in wheels if Path(wheel).name.startswith(f"{package}-")}
        assert tags == PYTHON_TAGS, package
    assert not [wheel for wheel in wheels if Path(wheel).name.startswith("numpy-")], "Blender has NumPy"


def test_is_no_larger_than_it_must_be(archive: Path) -> None:
    assert archive.stat().st_size < 85e6


def test_elevation_models_come_by_an_extension_of_their_own(archive: Path, manifest: dict[str, list[str]]) -> None:
    (other,) = archive.parent.glob("synthroads_elevation_models-*.zip")
    with zipfile.ZipFile(other) as content:
        names = content.namelist()
        own = tomllib.loads(content.read("blender_manifest.toml").decode("utf-8"))
    rasterio = {Path(name).name.split("-")[2] for name in names if name.startswith("wheels/rasterio-")}
    assert rasterio == PYTHON_TAGS
    assert {name for name in names if "/" not in name} == {
        "LICENSE",
        "THIRD_PARTY.txt",
        "__init__.py",
        "blender_manifest.toml",
    }
    assert (own["version"], own["platforms"]) == (manifest["version"], manifest["platforms"])
    assert sorted(own["wheels"]) == sorted(f"./{name}" for name in names if name.endswith(".whl"))


def test_ifc_comes_by_an_extension_of_its_own(archive: Path, manifest: dict[str, list[str]]) -> None:
    (other,) = archive.parent.glob("synthroads_ifc-*.zip")
    with zipfile.ZipFile(other) as content:
        names = content.namelist()
        own = tomllib.loads(content.read("blender_manifest.toml").decode("utf-8"))
    writers = {Path(name).name.split("-")[2] for name in names if name.startswith("wheels/ifcopenshell-")}
    assert writers == {tag.replace("cp", "py") for tag in PYTHON_TAGS}
    assert (own["version"], own["platforms"]) == (manifest["version"], manifest["platforms"])
    assert other.stat().st_size < 180e6


def test_lists_the_licences_of_all_wheels(archive: Path, names: list[str]) -> None:
    with zipfile.ZipFile(archive) as content:
        notice = content.read("THIRD_PARTY.txt").decode("utf-8")
    for wheel in (Path(name).name for name in names if name.endswith(".whl")):
        name, version = wheel.split("-")[:2]
        assert f"{name} {version}: ".lower() in notice.replace("-", "_").lower()
    assert "see the wheel" not in notice


def test_a_bill_of_materials_lies_beside_each_zip(archive: Path) -> None:
    for built in sorted(archive.parent.glob("*.zip")):
        text = built.with_suffix(".cdx.json").read_text(encoding="utf-8")
        assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
        listed = {part["purl"].partition("file_name=")[2]: part for part in json.loads(text)["components"]}
        with zipfile.ZipFile(built) as content:
            wheels = {Path(name).name: content.read(name) for name in content.namelist() if name.endswith(".whl")}
        assert listed.keys() == wheels.keys()
        for name, part in listed.items():
            assert part["hashes"] == [{"alg": "SHA-256", "content": hashlib.sha256(wheels[name]).hexdigest()}]


def test_a_wheel_with_another_hash_is_refused(tmp_path: Path) -> None:
    (elevation,) = (extension for extension in EXTENSIONS if "elevation" in extension.name)
    text = re.sub(r"sha256:[0-9a-f]{8}", "sha256:00000000", elevation.lock.read_text(encoding="utf-8"))
    (tmp_path / "lock.txt").write_text(text, encoding="utf-8")
    with pytest.raises(BuildError, match=r"pip did not get the wheels for Python 3\.11"):
        download(tmp_path / "lock.txt", "3.11", "linux-x64", tmp_path / "wheels")
    assert not (tmp_path / "wheels").exists()


@pytest.mark.slow
def test_same_source_gives_the_same_bytes(archive: Path, tmp_path: Path) -> None:
    again = _build(tmp_path)
    for first, second in zip(sorted(archive.parent.glob("*.zip")), sorted(again.parent.glob("*.zip")), strict=True):
        assert first.read_bytes() == second.read_bytes()


# The wheels that Blender unpacks come before those of the environment, so that they are the ones tried.
INSTALL = """
import json, os, sys
from pathlib import Path

own = Path(os.environ["BLENDER_USER_RESOURCES"]).resolve()
wheels = own / "extensions" / ".local" / "lib" / "python{}.{}".format(*sys.version_info) / "site-packages"
wheels.mkdir(parents=True)
sys.path.insert(0, str(wheels))

import bpy

MODULE = "bl_ext.user_default.synthroads"
for archive in sys.argv[2:]:
    bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
enabled = MODULE in bpy.context.preferences.addons
import embreex.rtcore_scene, ifcopenshell, importlib, laspy, lazrs, numpy, PIL.Image, pydantic, rasterio
import threadpoolctl, tqdm
importlib.import_module(MODULE + ".scenario.scenario")
bundled = (embreex, ifcopenshell, laspy, lazrs, PIL, pydantic, rasterio, threadpoolctl, tqdm)
bpy.ops.preferences.addon_disable(module=MODULE)
disabled = MODULE not in bpy.context.preferences.addons
bpy.ops.preferences.addon_enable(module=MODULE)
again = MODULE in bpy.context.preferences.addons
Path(sys.argv[1]).write_text(json.dumps({
    "enabled": enabled,
    "disabled": disabled,
    "enabled again": again,
    "from the extension": own in Path(sys.modules[MODULE].__file__).resolve().parents,
    "wheels used": all(wheels in Path(module.__file__).resolve().parents for module in bundled),
    "own numpy": wheels in Path(numpy.__file__).resolve().parents,
    "from the checkout": "synthroads_addon" in sys.modules,
}))
sys.stdout.flush()
os._exit(0)
"""


@pytest.mark.skipif(
    not (ROOT / "synthroads_addon" / "ui" / "__init__.py").exists(), reason="the add-on has no user interface yet"
)
def test_blender_installs_enables_and_disables_it(archive: Path, tmp_path: Path) -> None:
    result = tmp_path / "result.json"
    (tmp_path / "blender").mkdir()
    answer = subprocess.run(
        [sys.executable, "-c", INSTALL, result, *sorted(archive.parent.glob("*.zip"))],
        cwd=tmp_path,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "blender")},
        capture_output=True,
        text=True,
        check=False,
    )
    said = answer.stdout + answer.stderr
    assert result.exists(), said
    assert json.loads(result.read_text(encoding="utf-8")) == {
        "enabled": True,
        "disabled": True,
        "enabled again": True,
        "from the extension": True,
        "wheels used": True,
        "own numpy": False,
        "from the checkout": False,
    }, said
    assert "Traceback" not in said
