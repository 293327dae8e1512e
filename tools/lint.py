"""Check the source: style, who imports whom, types, known dangers. `make lint` runs it, by rules in pyproject.toml."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from subprocess import PIPE, STDOUT

ROOT = Path(__file__).resolve().parent.parent


def print_what_docstrings() -> bool:
    """Print where a docstring begins with "What"; return whether one does."""
    print("-- docstrings", flush=True)
    lines = [
        f"{path.relative_to(ROOT)}:{number}: a docstring begins with What: say in one sentence what is done or returned"
        for folder in ("synthroads_addon", "headless", "ml", "tests", "tools", "studies")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if line.lstrip().startswith('"""What ')
    ]
    print("\n".join(lines) or "no docstring begins with What")
    return bool(lines)


def print_late_imports() -> bool:
    """Print the imports within functions that give no reason for their place; return whether there are any.

    Reasons are a comment beside or above, or an `except ImportError`: the package is optional. In `headless` all
    commands load what they need when they run, so that ``--help`` and completion come at once.
    """
    print("-- imports within functions", flush=True)
    lines = [
        f"{path.relative_to(ROOT)}:{number}: an import within a function says why, in a comment beside or above it"
        for folder in ("synthroads_addon", "ml")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for number in late_imports(path.read_text(encoding="utf-8"))
    ]
    print("\n".join(lines) or "each import within a function says why")
    return bool(lines)


def late_imports(source: str) -> list[int]:
    """Return the first import's line number of each function whose imports all lack a comment with a reason."""
    lines, first_numbers = source.splitlines(), []
    functions = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)]
    for function in functions:
        optional_imports = {
            id(statement)
            for node in ast.walk(function)
            if isinstance(node, ast.Try) and any("Error" in ast.unparse(handler) for handler in node.handlers)
            for statement in node.body
        }
        numbers = sorted(
            node.lineno
            for node in ast.walk(function)
            if isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in optional_imports
        )
        if numbers and not any("#" in line for number in numbers for line in lines[number - 2 : number]):
            first_numbers.append(numbers[0])
    return first_numbers


def commands() -> dict[str, list[str]]:
    """Return the command lines of the programs that check the source, by name; mypy on Python 3.11 only."""
    scripts = Path(sys.executable).parent
    audit = [str(scripts / "pip-audit"), "--dry-run", "--disable-pip", "--require-hashes", "--requirement"]
    checks = {}
    if sys.version_info[:2] == (3, 11):
        checks["mypy"] = [sys.executable, "-m", "mypy"]  # takes longest, so it begins first
    else:  # the annotations are those of Blender 4.5's NumPy
        print("-- mypy is left out: types are checked with the libraries that Python 3.11 has")
    return checks | {
        "ruff": [sys.executable, "-m", "ruff", "check", "."],
        "import-linter": [str(scripts / "lint-imports"), "--no-logo"],
        "bandit": [
            *(sys.executable, "-m", "bandit", "--quiet", "--configfile", "pyproject.toml", "--recursive"),
            *("synthroads_addon", "headless", "ml", "tools", "studies", "noxfile.py"),
        ],
        # Whether a version is known to be unsafe can't be asked without a network: `--dry-run` reads the locks alone.
        **{f"pip-audit {lock.stem}": [*audit, str(lock)] for lock in sorted((ROOT / "tools" / "locks").glob("*.txt"))},
    }


def run_together(checks: dict[str, list[str]]) -> list[str]:
    """Run programs in parallel, print their output in order; return the names of those that failed."""
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        answers = pool.map(partial(subprocess.run, cwd=ROOT, text=True, stdout=PIPE, stderr=STDOUT), checks.values())
        failed_names = []
        for name, answer in zip(checks, answers, strict=True):
            print(f"-- {name}\n{answer.stdout}", end="", flush=True)
            failed_names += [name] if answer.returncode != 0 else []
    return failed_names


def main() -> int:
    """Run every check, also after one has failed; return 0 if all passed, else 1."""
    own_checks = {"docstrings": print_what_docstrings, "imports within functions": print_late_imports}
    failed_names = [name for name, print_faults in own_checks.items() if print_faults()]
    failed_names += run_together(commands())
    print(f"lint: failed: {'; '.join(failed_names)}" if failed_names else "lint: all checks passed")
    return 1 if failed_names else 0


if __name__ == "__main__":
    sys.exit(main())
