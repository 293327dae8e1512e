"""Build the Blender extensions: the add-on with its wheels, and one with what IFC needs.

    python tools/build_extension.py [--platform linux-x64|windows-x64|macos-arm64|all] [--blender 4.5] [--output-dir D]

Its source is copied beside a completed manifest in a folder of its own (no committed file is touched), packed, and
validated by Blender's own tool, which comes with the `bpy` package. There is a zip for each platform and each Python
that a supported Blender has, and an index.json beside them, by which the folder serves Blender as a repository. The
same source and the same list of wheels give the same bytes.
"""

from __future__ import annotations

import argparse
import email.parser
import hashlib
import importlib.util
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from dataclasses import dataclass
from email.message import Message
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # the root, from where tools see each other

from tools.build_kernels import KEPT, KERNELS, KernelError, build_kernels

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "synthroads_addon"
MANIFEST = ROOT / "blender_manifest.toml"


@dataclass(frozen=True)
class Extension:
    """Sources, manifest, wheels and lock of one Blender extension.

    Attributes:
        name: id in Blender.
        source: folder with its Python code.
        manifest: what it says of itself, still without platform and wheels.
        wheel_list: file with the wheels it brings.
        lock: file with the hashes of these wheels, for every platform.
    """

    name: str
    source: Path
    manifest: Path
    wheel_list: Path
    lock: Path


_LOCKS = ROOT / "tools" / "locks"
_IFC = ROOT / "tools" / "ifc_models"
EXTENSIONS = (
    Extension("synthroads", PACKAGE, MANIFEST, ROOT / "tools" / "extension_wheels.txt", _LOCKS / "extension.txt"),
    Extension("synthroads_ifc", *(_IFC, _IFC / MANIFEST.name, _IFC / "wheels.txt", _LOCKS / "ifc.txt")),
)


@dataclass(frozen=True)
class Release:
    """Releases of Blender that one zip is for: those with one Python.

    Attributes:
        name: of the first of them, in a zip's name.
        python: Python that they have.
        first: oldest release, as a manifest's `blender_version_min`.
        before: release that is too new, as a manifest's `blender_version_max`; None if there is none yet.
        platforms: Blender's names of the platforms on which there are such releases.
    """

    name: str
    python: str
    first: str
    before: str | None
    platforms: frozenset[str]


_ALL_PLATFORMS = frozenset({"linux-x64", "windows-x64", "macos-arm64"})
RELEASES = (
    Release("4.5", "3.11", "4.5.0", "5.1.0", _ALL_PLATFORMS),
    Release("5.2", "3.13", "5.1.0", None, _ALL_PLATFORMS),
    Release("5.2-debian", "3.14", "5.1.0", None, frozenset({"linux-x64"})),
)
"""Blender 4.5 and 5.0 have Python 3.11, the official 5.1 and 5.2 have 3.13, Debian's 5.2 has 3.14."""
INDEX = "index.json"
"""Name that Blender's tool gives to a repository's index."""

# Blender's name of a platform -> the wheel tags that run on every machine that its Blender runs on.
PLATFORM_TAGS = {
    # ifcopenshell has none for older systems than glibc 2.31: on these Blender installs it all the same, and only IFC
    # can't be written.
    "linux-x64": (
        "manylinux_2_31_x86_64",
        "manylinux_2_28_x86_64",
        "manylinux_2_27_x86_64",
        "manylinux_2_17_x86_64",
        "manylinux2014_x86_64",
    ),
    "windows-x64": ("win_amd64",),
    # embreex has none for older systems than 13, rasterio for older ones than 14. On 13 Blender installs rasterio all
    # the same; it doesn't load there, and only elevation models can't be read.
    "macos-arm64": ("macosx_11_0_arm64", "macosx_12_0_arm64", "macosx_13_0_arm64", "macosx_14_0_arm64"),
}

# Dependencies of the wheels that are left out: Blender has NumPy, and tqdm does without colorama.
NOT_BUNDLED = frozenset({"numpy", "colorama"})

# Where a wheel's fields say too little.
LICENCES = {
    "OpenEXR": "BSD-3-Clause",
    "embreex": "BSD-2-Clause; holds Intel Embree and oneTBB: Apache-2.0, https://www.apache.org/licenses/LICENSE-2.0",
    "pyproj": "MIT; holds PROJ: MIT, and free libraries that it uses",
    "rasterio": "BSD-3-Clause; holds GDAL and PROJ: MIT, GEOS: LGPL-2.1-or-later, and free libraries that these use",
}

LEFT_OUT = shutil.ignore_patterns(
    *("__pycache__", "*.py[co]", ".*", "*.blend[1-9]", "wheels.txt", MANIFEST.name),
    *("*.so", "*.dll", "*.dylib"),  # of other platforms: the zip's own are compiled into it
)
ZIP_DATE = (1980, 1, 1, 0, 0, 0)


class BuildError(Exception):
    """The extension cannot be built; the message says why."""


def current_platform() -> str:
    """Return Blender's name of this machine's platform, such as linux-x64."""
    system = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}.get(platform.system(), platform.system())
    machine = {"x86_64": "x64", "amd64": "x64", "aarch64": "arm64"}.get(
        platform.machine().lower(), platform.machine().lower()
    )
    return f"{system}-{machine}"


def blender_tool() -> Path:
    """Return Blender's command-line tool for extensions, which lies inside the installed `bpy` package."""
    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        raise BuildError("the bpy package is needed for its extension tool: pip install 'synthroads[blender]'")
    tools = sorted(Path(spec.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    if not tools:
        raise BuildError(f"no extension tool in {Path(spec.origin).parent}")
    return tools[-1]


# --- wheels ----------------------------------------------------------------------------------------------------------


def normal_name(name: str) -> str:
    """Return a distribution's normalised name (PEP 503): lower case, runs of -, _ and . as one -."""
    return re.sub(r"[-_.]+", "-", name).lower()


def read_wheel_list(path: Path) -> list[str]:
    """Read the lines `name==version` of a list of wheels, without comments and blank lines."""
    lines = (line.split("#")[0].strip() for line in path.read_text(encoding="utf-8").splitlines())
    return [line for line in lines if line]


def fetch_wheels(extension: Extension, target: str, release: Release, cache: Path) -> list[Path]:
    """Return the paths of an extension's wheels for a platform and a Python, downloading what the cache lacks."""
    lock = extension.lock.read_text(encoding="utf-8")
    folder = cache / extension.name / target / f"cp{release.python.replace('.', '')}"
    stamp = folder / "complete.json"
    if not stamp.exists() or json.loads(stamp.read_text(encoding="utf-8")) != lock:
        partial_folder = folder.with_name(f"{folder.name}.part-{os.getpid()}")
        download(extension.lock, release.python, target, partial_folder)
        (partial_folder / stamp.name).write_text(json.dumps(lock), encoding="utf-8")
        shutil.rmtree(folder, ignore_errors=True)
        partial_folder.rename(folder)
    return sorted(folder.glob("*.whl"))


def download(lock: Path, version: str, target: str, folder: Path) -> None:
    """Download the locked wheels of one Python version and platform into a folder, checking their hashes.

    Raises:
        BuildError: pip can't get one, or got one whose hash isn't in the lock.
    """
    folder.mkdir(parents=True, exist_ok=True)
    print(f"downloading wheels for Python {version}, {target}", flush=True)
    command = [
        *(sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"),
        *("--only-binary=:all:", "--implementation", "cp", "--python-version", version, "--dest", str(folder)),
        *(word for tag in PLATFORM_TAGS[target] for word in ("--platform", tag)),
    ]
    if subprocess.run([*command, "--require-hashes", "--requirement", str(lock)], check=False).returncode != 0:
        shutil.rmtree(folder)
        raise BuildError(f"pip did not get the wheels for Python {version} on {target}, see above")


def wheel_metadata(wheel: Path) -> Message:
    """Return the fields of a wheel's METADATA file as an email message."""
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if re.fullmatch(r"[^/]+\.dist-info/METADATA", name))
        return email.parser.Parser().parsestr(archive.read(name).decode("utf-8"))


def check_complete(extension: Extension, wheels: list[Path]) -> None:
    """Raise BuildError if a wheel needs a package that is neither bundled nor in Blender."""
    metadata = [wheel_metadata(wheel) for wheel in wheels]
    names_present = {normal_name(fields["Name"]) for fields in metadata} | NOT_BUNDLED
    for fields in metadata:
        for requirement in fields.get_all("Requires-Dist", []):
            if "extra ==" in requirement:
                continue
            needed_name = normal_name(re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0])
            if needed_name not in names_present:
                raise BuildError(f"{fields['Name']} needs {requirement}: add it to {extension.wheel_list.name}")


def licence_name(fields: Message) -> str:
    """Return the name of a package's licence from its metadata: an expression, a classifier or a line of text."""
    if fields["Name"] in LICENCES:
        return LICENCES[fields["Name"]]
    classifiers = [line.split(" :: ")[-1] for line in fields.get_all("Classifier", []) if line.startswith("License")]
    text = (fields["License"] or "").strip().splitlines()[:1]
    return fields["License-Expression"] or "; ".join(classifiers or text) or "see the wheel"


def third_party_notice(wheels: list[Path]) -> str:
    """Return the text that lists the bundled packages with their licences."""
    rows = {f"{fields['Name']} {fields['Version']}": licence_name(fields) for fields in map(wheel_metadata, wheels)}
    lines = [f"{name}: {rows[name]}" for name in sorted(rows, key=str.lower)]
    head = (
        "SynthRoads is licensed under the GPL, version 3 or later (LICENSE). It brings these packages as wheels,\n"
        "unchanged; the full text of each licence lies in the wheel's own dist-info folder where its authors put one.\n"
    )
    return head + "\n" + "\n".join(lines) + "\n"


def bill_of_materials(extension: Extension, wheels: list[Path]) -> dict[str, object]:
    """Return a CycloneDX 1.6 bill of materials as JSON data: each bundled wheel with its hash and licence."""
    components = []
    for wheel in wheels:
        fields = wheel_metadata(wheel)
        address = f"pkg:pypi/{normal_name(fields['Name'])}@{fields['Version']}"
        components.append(
            {
                "type": "library",
                "bom-ref": f"{address}?file_name={wheel.name}",
                "name": fields["Name"],
                "version": fields["Version"],
                "purl": f"{address}?file_name={wheel.name}",
                "licenses": [{"license": {"name": licence_name(fields)}}],
                "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(wheel.read_bytes()).hexdigest()}],
            }
        )
    root = {"type": "application", "bom-ref": extension.name, "name": extension.name, "version": project_version()}
    return {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": root},
        "components": components,
        "dependencies": [{"ref": extension.name, "dependsOn": [str(part["bom-ref"]) for part in components]}],
    }


# --- staging ---------------------------------------------------------------------------------------------------------


def stage(extension: Extension, target: str, release: Release, wheels: list[Path], folder: Path) -> None:
    """Fill an empty folder with an extension's source, licences, wheels, asset library and completed manifest."""
    shutil.copytree(extension.source, folder, ignore=LEFT_OUT, dirs_exist_ok=True)
    shutil.copy(ROOT / "LICENSE", folder)
    (folder / "THIRD_PARTY.txt").write_text(third_party_notice(wheels), encoding="utf-8", newline="\n")
    if extension.source == PACKAGE:
        shutil.copy(asset_library(ROOT / "build" / "asset_library"), folder / "presets" / "node_groups")
    if extension.source == PACKAGE:
        compile_kernels(target, folder / KERNELS.relative_to(PACKAGE))
    (folder / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy(wheel, folder / "wheels")
    manifest = complete_manifest(extension, target, release, [f"./wheels/{wheel.name}" for wheel in wheels])
    (folder / MANIFEST.name).write_text(manifest, encoding="utf-8", newline="\n")


def compile_kernels(target: str, folder: Path) -> None:
    """Compile the scan's kernels for a platform into a folder; raise `BuildError` if that fails."""
    try:
        build_kernels(target, folder, KEPT)
    except KernelError as error:
        raise BuildError(str(error)) from error


def asset_library(cache: Path) -> Path:
    """Return the path of the asset library built from the present sources, cached; older cached ones are removed."""
    digest = hashlib.sha256(str(blender_tool()).encode())
    tools = ROOT / "tools"
    sources = [*PACKAGE.rglob("*"), *(tools / "asset_previews").glob("*.png"), *tools.glob("*_library.py")]
    for path in sorted((*sources, tools / "stable_blend.py")):
        if path.is_file() and "__pycache__" not in path.parts:
            digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    library = cache / digest.hexdigest()[:16] / "node_groups.blend"
    if not library.exists():
        shutil.rmtree(cache, ignore_errors=True)
        library.parent.mkdir(parents=True)
        write_asset_library(library.with_suffix(".part"))
        library.with_suffix(".part").rename(library)
    return library


def write_asset_library(path: Path) -> None:
    """Write the asset library of node groups to a file, in a separate Blender process without the user's settings."""
    command = [sys.executable, "-B", str(ROOT / "tools" / "asset_library.py"), str(path)]
    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        environment = {**os.environ, "BLENDER_USER_RESOURCES": folder}
        answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if answer.returncode != 0 or not path.exists():
        raise BuildError(f"the library of node groups was not written:\n{answer.stdout}{answer.stderr}")


def project_version() -> str:
    """Return the project's version, as the extension's manifest has it."""
    return str(tomllib.loads(MANIFEST.read_text(encoding="utf-8"))["version"])


def complete_manifest(extension: Extension, target: str, release: Release, wheels: list[str]) -> str:
    """Return the text of an extension's manifest with version, releases, platform and wheels before its first table."""
    text = extension.manifest.read_text(encoding="utf-8")
    oldest_line = f'blender_version_min = "{RELEASES[0].first}"'
    if oldest_line not in text:
        raise BuildError(f"{extension.manifest} must name the oldest release that there is a zip for: {oldest_line}")
    releases_text = f'blender_version_min = "{release.first}"'
    releases_text += f'\nblender_version_max = "{release.before}"' if release.before else ""
    text = text.replace(oldest_line, releases_text)
    tables = re.search(r"^\[", text, flags=re.MULTILINE)
    insert_at = tables.start() if tables else len(text)
    version_text = "" if extension.manifest == MANIFEST else f"version = {json.dumps(project_version())}\n"
    added_lines = f"{version_text}platforms = {toml_list([target])}\nwheels = {toml_list(wheels)}\n\n"
    return text[:insert_at] + added_lines + text[insert_at:]


def toml_list(items: list[str]) -> str:
    """Return a TOML array of strings, one to a line."""
    return "[\n" + "".join(f"  {json.dumps(item)},\n" for item in items) + "]"


# --- building --------------------------------------------------------------------------------------------------------


def archive_name(extension: Extension, target: str, release: Release) -> str:
    """Return the name of the zip of an extension for a platform and releases of Blender."""
    return f"{extension.name}-{project_version()}-blender_{release.name}-{target.replace('-', '_')}.zip"


def build(extension: Extension, target: str, release: Release, output_dir: Path, cache: Path) -> Path:
    """Build and validate an extension's zip; return its path. Its bill of materials is written beside it."""
    wheels = fetch_wheels(extension, target, release, cache)
    check_complete(extension, wheels)
    output_dir.mkdir(parents=True, exist_ok=True)
    archive = output_dir / archive_name(extension, target, release)
    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        stage(extension, target, release, wheels, Path(folder))
        pack(Path(folder), archive)
    run_tool("validate", str(archive))
    materials = json.dumps(bill_of_materials(extension, wheels), indent=2) + "\n"
    archive.with_suffix(".cdx.json").write_text(materials, encoding="utf-8", newline="\n")
    return archive


def write_index(output_dir: Path) -> Path:
    """Write the index by which Blender takes a folder of zips for a repository, by its own tool; return its path.

    Zips of other versions or by other names that lie there are left out, since Blender takes the first that fits.
    """
    run_tool("server-generate", "--repo-dir", str(output_dir))
    path = output_dir / INDEX
    index = json.loads(path.read_text(encoding="utf-8"))
    archive_names = {
        archive_name(extension, target, release)
        for extension, target, release in product(EXTENSIONS, PLATFORM_TAGS, RELEASES)
    }
    entries = [entry for entry in index["data"] if Path(entry["archive_url"]).name in archive_names]
    index["data"] = sorted(entries, key=lambda entry: str(entry["archive_url"]))
    path.write_text(json.dumps(index, indent=2) + "\n", encoding="utf-8", newline="\n")
    return path


def pack(folder: Path, archive: Path) -> None:
    """Write a folder's files to a zip, sorted by name, with fixed dates and modes.

    Wheels are stored as they are: Blender's own tool would compress them a second time, at ten times the cost of all
    else, to no effect.
    """
    partial_file = archive.with_suffix(".part")
    with zipfile.ZipFile(partial_file, "w") as target:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(path.relative_to(folder).as_posix(), ZIP_DATE)
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_STORED if path.suffix == ".whl" else zipfile.ZIP_DEFLATED
            target.writestr(entry, path.read_bytes())
    partial_file.replace(archive)


def run_tool(*arguments: str) -> None:
    """Run Blender's extension tool; raise `BuildError` with its output if it fails."""
    answer = subprocess.run(
        [sys.executable, "-B", str(blender_tool()), *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    if answer.returncode != 0:
        raise BuildError(f"Blender's tool failed to {arguments[0]}:\n{answer.stdout}{answer.stderr}")


def parse_arguments(argv: list[str] | None) -> argparse.Namespace:
    """Return the parsed options of the command line."""
    parser = argparse.ArgumentParser(
        description="Build the Blender extensions, a zip of each for a platform and releases of Blender."
    )
    parser.add_argument(
        "--platform", choices=[*PLATFORM_TAGS, "all"], default=current_platform(), help="default: the current one"
    )
    parser.add_argument(
        "--blender",
        choices=[*(release.name for release in RELEASES), "all"],
        default="all",
        help="release (all), as each has its own Python",
    )
    parser.add_argument("--output-dir", type=Path, default=ROOT / "dist", metavar="DIR", help="default: dist")
    parser.add_argument(
        "--wheel-cache", type=Path, default=ROOT / "build" / "wheels", metavar="DIR", help="default: build/wheels"
    )
    return parser.parse_args(argv)


def main(argv: list[str] | None = None) -> int:
    """Build the chosen extensions; return 0, 1 if a build failed, 2 for an unknown platform."""
    options = parse_arguments(argv)
    if options.platform not in (*PLATFORM_TAGS, "all"):
        print(f"no wheels are known for {options.platform}: choose --platform {'|'.join(PLATFORM_TAGS)}|all")
        return 2
    try:
        targets = PLATFORM_TAGS if options.platform == "all" else [options.platform]
        for target, release, extension in product(targets, RELEASES, EXTENSIONS):
            if options.blender not in (release.name, "all") or target not in release.platforms:
                continue
            archive = build(extension, target, release, options.output_dir, options.wheel_cache)
            checksum = hashlib.sha256(archive.read_bytes()).hexdigest()
            print(f"{archive}  {archive.stat().st_size / 1e6:.1f} MB  sha256 {checksum[:16]}")
        print(write_index(options.output_dir))
    except BuildError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
