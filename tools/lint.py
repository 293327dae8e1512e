"""Check the source: ruff, who imports whom, and the types. `make lint` runs it; the rules are in pyproject.toml."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def print_what_docstrings() -> bool:
    """Print where a docstring begins with "What", which says neither what is done nor what is returned."""
    print("-- docstrings", flush=True)
    found = [
        f"{path.relative_to(ROOT)}:{number}: a docstring begins with What: say in one sentence what is done or returned"
        for folder in ("synthroads_addon", "headless", "ml", "tests", "tools")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if line.lstrip().startswith('"""What ')
    ]
    print("\n".join(found) or "no docstring begins with What")
    return bool(found)


def main() -> int:
    """Run every check, also after one has failed, and return 0 if all passed."""
    checks = {
        "ruff": [sys.executable, "-m", "ruff", "check", "."],
        "import-linter": [str(Path(sys.executable).with_name("lint-imports")), "--no-logo"],
    }
    if sys.version_info[:2] == (3, 11):
        checks["mypy"] = [sys.executable, "-m", "mypy"]
    else:  # the annotations are those of Blender 4.5's NumPy
        print("-- mypy is left out: types are checked with the libraries that Python 3.11 has")
    failed = ["docstrings"] if print_what_docstrings() else []
    for name, command in checks.items():
        print(f"-- {name}", flush=True)
        if subprocess.run(command, cwd=ROOT, check=False).returncode != 0:
            failed.append(name)
    print(f"lint: failed: {'; '.join(failed)}" if failed else "lint: all checks passed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
