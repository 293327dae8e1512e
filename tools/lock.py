"""Write the locks: every package of the environments and of the extensions, with its version and its files' hashes.

    nox -s lock                      # all, after a range in pyproject.toml or a wheel of the extensions has changed
    nox -s lock -- --check           # only say which locks no longer fit

A lock names no index, so that it serves with any mirror. PyTorch and the CUDA packages it brings are left out: which of
its builds is installed is the user's choice.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # the root, where noxfile.py is

from noxfile import BLENDER, EXTRAS, lock_of
from tools.build_extension import EXTENSIONS, RELEASES, read_wheel_list

ROOT = Path(__file__).resolve().parent.parent
PYPROJECT = ROOT / "pyproject.toml"
CHOSEN_BY_USERS = re.compile(r"(torch|triton|nvidia-|cuda-)")
"""Names of the packages that no lock holds."""
SYSTEMS = [
    {"sys_platform": system, "platform_system": name, "os_name": os_name, "platform_machine": machine}
    for system, name, os_name, machine in (
        ("linux", "Linux", "posix", "x86_64"),
        ("linux", "Linux", "posix", "aarch64"),
        ("darwin", "Darwin", "posix", "arm64"),
        ("win32", "Windows", "nt", "AMD64"),
    )
]
"""Systems that an environment may be made on, as markers ask for them."""
HEAD = "# Written by `nox -s lock`: the versions that are installed, with the hashes of their files.\n"


def environment_inputs(name: str) -> list[str]:
    """Return an environment's requirements from pyproject.toml, with those of the package's build."""
    settings = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))
    extras = settings["project"]["optional-dependencies"]
    extra_requirements = [requirement for extra in EXTRAS[name].split(",") for requirement in extras[extra]]
    return [
        *settings["project"]["dependencies"],
        *extra_requirements,
        *settings["build-system"]["requires"],
        "editables",
    ]


def resolve(requirements: list[str], python: str, present_lock: Path, *options: str) -> str:
    """Resolve requirements with uv, keeping `present_lock`'s versions; return a lock for one Python on all systems.

    Raises:
        subprocess.CalledProcessError: there is no such set of packages; uv has said why.
    """
    with tempfile.TemporaryDirectory() as folder:
        requirements_file, lock_file = Path(folder, "requirements.in"), Path(folder, "lock.txt")
        requirements_file.write_text("\n".join(requirements) + "\n", encoding="utf-8")
        if present_lock.exists():
            lock_file.write_text(present_lock.read_text(encoding="utf-8"), encoding="utf-8")
        subprocess.run(
            [
                *(sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--universal", "--python-version", python),
                *("--generate-hashes", "--no-header", "--no-annotate", "--no-emit-index-url", "--no-emit-find-links"),
                *(*options, str(requirements_file), "--output-file", str(lock_file)),
            ],
            check=True,
        )
        return HEAD + "".join(blocks_for(python, lock_file.read_text(encoding="utf-8")))


def blocks_for(python: str, lock: str) -> Iterator[str]:
    """Yield a lock's block of text for each package that a Python version needs, without PyTorch and CUDA."""
    for block in re.split(r"(?m)^(?=[A-Za-z0-9])", lock):
        if not block[:1].isalnum() or CHOSEN_BY_USERS.match(block):
            continue
        marker = Requirement(block.split("\\", 1)[0]).marker
        if marker is None or any(marker.evaluate(system | python_names(python)) for system in SYSTEMS):
            yield block


def python_names(python: str) -> dict[str, str]:
    """Return the environment-marker variables of a Python version."""
    return {"python_version": python, "python_full_version": f"{python}.0"}


def all_locks() -> Iterator[tuple[Path, str]]:
    """Yield (lock file, text resolved anew) of every environment and extension."""
    for name in EXTRAS:
        for python in [name.rpartition("-")[2]] if "-" in name else BLENDER:
            path = ROOT / lock_of(name, python)
            yield path, resolve(environment_inputs(name), python, path)
    for extension in EXTENSIONS:
        pins = read_wheel_list(extension.wheel_list)
        yield extension.lock, resolve(pins, RELEASES[0].python, extension.lock, "--no-deps")


def main(argv: list[str] | None = None) -> int:
    """Write the locks that changed, or with --check only name them; return 1 if checking found any, else 0."""
    parser = argparse.ArgumentParser(description="Write the locks of the environments and of the extensions.")
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if one would change")
    options = parser.parse_args(argv)
    new_texts = [(path, text) for path, text in all_locks() if not path.exists() or path.read_text("utf-8") != text]
    for path, text in new_texts:
        print(f"{path.relative_to(ROOT)}: {'would change' if options.check else 'written'}")
        if not options.check:
            path.write_text(text, encoding="utf-8", newline="\n")
    return 1 if new_texts and options.check else 0


if __name__ == "__main__":
    sys.exit(main())
