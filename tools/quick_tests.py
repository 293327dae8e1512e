"""Run the tests nearest to what changed against `main`: `make quick` runs it, and stops after two minutes.

Tests are near by the import graph: a test file that changed itself comes first, then those that lie where the changed
file's tests lie (`tests/road/test_curve.py` for `synthroads_addon/road/curve.py`) or import it, then those that import
what imports it, and so on. A changed file that is no module (a preset, a page) is near to what names it.
"""

from __future__ import annotations

import argparse
import ast
import os
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("synthroads_addon", "headless", "ml")
MARKERS = "not slow and not fuzz and not cluster and not doors"
UNTIL = "SYNTHROADS_QUICK_UNTIL"
"""Environment variable with the time, in seconds since the epoch, from which on no further test begins."""


def changed_files(root: Path, base: str) -> list[str]:
    """Return the paths, relative to the root, of files that differ from where this branch left another, or are new."""

    def git(*words: str) -> list[str]:
        """Return the lines that a command of git prints."""
        answer = subprocess.run(["git", *words], cwd=root, check=True, capture_output=True, text=True)
        return answer.stdout.split("\n")[:-1]

    common_commit = git("merge-base", base, "HEAD")[0]
    return sorted({*git("diff", "--name-only", common_commit), *git("ls-files", "--others", "--exclude-standard")})


def module_name(path: str) -> str:
    """Return the dotted name of the module that a Python file, by its path relative to the root, defines."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def imported_names(source: str) -> set[str]:
    """Return the dotted names that a file imports, whole: `a.b` and `a.b.c` for `from a.b import c`."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.update((node.module, *(f"{node.module}.{alias.name}" for alias in node.names)))
    return names


def mirrored_test(path: str) -> str:
    """Return where a module's own tests would lie: `tests/road/test_curve.py` for `synthroads_addon/road/curve.py`."""
    folder, _, name = path.removeprefix("synthroads_addon/").rpartition("/")
    return f"tests/{folder}/test_{name}".replace("//", "/")


def distances(changed_modules: Iterable[str], importers: Mapping[str, Iterable[str]]) -> dict[str, int]:
    """Return for each module the number of imports between it and the nearest changed module."""
    distance_of_module = dict.fromkeys(changed_modules, 0)
    queue = deque(distance_of_module)
    while queue:
        module = queue.popleft()
        for importer in importers.get(module, ()):
            if importer not in distance_of_module:
                distance_of_module[importer] = distance_of_module[module] + 1
                queue.append(importer)
    return distance_of_module


def nearest_tests(
    changed_paths: Sequence[str], texts: Mapping[str, str], importers: Mapping[str, Iterable[str]]
) -> list[str]:
    """Return the test files that changed files can reach, nearest first.

    Args:
        changed_paths: paths of changed files, relative to the root.
        texts: source by path of every test file and of the tests' helpers.
        importers: for each module of the product the modules that import it.
    """
    graph: dict[str, set[str]] = {module: set(names) for module, names in importers.items()}
    for path, text in texts.items():
        for name in imported_names(text):
            graph.setdefault(name, set()).add(module_name(path))
    modules = [module_name(path) for path in changed_paths if path.endswith(".py")]
    distance_of_module = distances(modules, graph)
    distance_of_file = {
        path: distance_of_module[module_name(path)] for path in texts if module_name(path) in distance_of_module
    }
    file_names = [Path(path).name for path in changed_paths if not path.endswith(".py")]
    naming_files = {path for path, text in texts.items() if any(name in text for name in file_names)}
    for path in naming_files | (set(map(mirrored_test, changed_paths)) & set(texts)):
        distance_of_file[path] = min(distance_of_file.get(path, 1), 1)
    home_folders = {str(Path(mirrored_test(path)).parent) for path in changed_paths if path.endswith(".py")}
    tests = [path for path in distance_of_file if Path(path).name.startswith("test_")]
    return sorted(tests, key=lambda path: (distance_of_file[path], str(Path(path).parent) not in home_folders, path))


def pytest_runtest_setup() -> None:
    """Leave the tests out that would begin after the time is over."""
    if time.time() > float(os.environ.get(UNTIL, "inf")):
        pytest.skip("no time was left: `make test` runs it")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the tests and return pytest's exit code; 0 where nothing changed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--base", default="main", help="the branch, or commit, that changes are counted against")
    parser.add_argument("--seconds", type=float, default=110, help="after how long no further test begins")
    parser.add_argument("--files", type=int, default=24, help="the largest number of test files")
    parser.add_argument("--list", action="store_true", help="only print the test files, nearest first")
    options = parser.parse_args(arguments)
    until = time.time() + options.seconds
    changed_paths = changed_files(ROOT, options.base)
    graph = grimp.build_graph(*PACKAGES)
    importers = {module: graph.find_modules_that_directly_import(module) for module in graph.modules}
    files = sorted((ROOT / "tests").rglob("*.py"))
    texts = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in files}
    all_tests = nearest_tests(changed_paths, texts, importers)
    tests = all_tests[: options.files]
    nearest = f"the nearest {len(tests)} of {len(all_tests)} test files"
    print(f"{len(changed_paths)} files changed against {options.base}; {nearest}")
    sys.stdout.flush()
    if options.list or not tests:
        print("\n".join(tests))
        return 0
    words = ["-q", "-n", "2", "--dist", "loadfile", "-p", "tools.quick_tests", "-m", MARKERS, *tests]
    environment = {**os.environ, UNTIL: str(until), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    answer = subprocess.run([sys.executable, "-m", "pytest", *words], cwd=ROOT, env=environment, check=False)
    return answer.returncode


if __name__ == "__main__":
    sys.exit(main())
