"""Check the source: ruff's rules, what generators may not use, and the types.

`make lint` runs it. The rules stand in `pyproject.toml`. Ruff can switch a rule off for a folder but not a part of one
rule, so the folders that may use Blender are checked once more, against the bans that do not concern Blender.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MAY_USE_BLENDER = ("synthroads_addon/blender", "synthroads_addon/ui", "synthroads_addon/jobs")
BAN_TABLE = "lint.flake8-tidy-imports.banned-api"


def reproducibility_bans() -> dict[str, dict[str, str]]:
    """Return the banned names, and their messages, that hold where Blender is allowed."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        ruff = tomllib.load(file)["tool"]["ruff"]
    bans: dict[str, dict[str, str]] = ruff["lint"]["flake8-tidy-imports"]["banned-api"]
    return {name: ban for name, ban in bans.items() if not ban["msg"].startswith("Blender")}


def reproducibility_command() -> list[str]:
    """Return the ruff command, without the paths, that checks these bans alone."""
    table = ", ".join(
        f"{json.dumps(name)} = {{ msg = {json.dumps(ban['msg'])} }}" for name, ban in reproducibility_bans().items()
    )
    return [
        *(sys.executable, "-m", "ruff", "check", "--isolated", "--select", "TID251"),
        *("--config", f"{BAN_TABLE} = {{ {table} }}"),
    ]


def main() -> int:
    """Run every check, also after one has failed, and return 0 if all passed."""
    paths = [path for path in MAY_USE_BLENDER if (ROOT / path).exists()]
    checks = {
        "ruff": [sys.executable, "-m", "ruff", "check", "."],
        "ruff, reproducibility": [*reproducibility_command(), *paths],
    }
    if sys.version_info[:2] == (3, 11):
        checks["mypy"] = [sys.executable, "-m", "mypy"]
    else:  # the annotations are those of Blender 4.5's NumPy
        print("-- mypy is left out: types are checked with the libraries that Python 3.11 has")
    failed = []
    for name, command in checks.items():
        print(f"-- {name}", flush=True)
        if subprocess.run(command, cwd=ROOT, check=False).returncode != 0:
            failed.append(name)
    print(f"lint: failed: {'; '.join(failed)}" if failed else "lint: all checks passed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
