"""The linter refuses what the architecture forbids, where it forbids it, and nowhere else."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]

BLENDER_USES = {
    "bpy": "import bpy\n\nprint_me = bpy.app\n",
    "bpy from": "from bpy.types import Object\n\nKIND = Object\n",
    "bmesh": "import bmesh\n\nNEW = bmesh.new\n",
    "mathutils": "from mathutils.bvhtree import BVHTree\n\nKIND = BVHTree\n",
}
CHANCE_USES = {
    "time.time": "import time\n\nNOW = time.time()\n",
    "time.time from": "from time import time\n\nNOW = time()\n",
    "datetime.now": "from datetime import UTC, datetime\n\nNOW = datetime.now(UTC)\n",
    "date.today": "import datetime\n\nNOW = datetime.date.today()\n",
    "uuid": "import uuid\n\nNAME = uuid.uuid4()\n",
    "random": "from random import gauss\n\nVALUE = gauss(0, 1)\n",
    "os.urandom": "import os\n\nVALUE = os.urandom(3)\n",
    "RandomState": "import numpy as np\n\nRNG = np.random.RandomState(1)\n",
}
NUMPY_GLOBAL = {
    "seed": "import numpy as np\n\nnp.random.seed(1)\n",
    "rand": "import numpy as np\n\nVALUE = np.random.rand(3)\n",
}


def _lint_tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("lint", ROOT / "tools" / "lint.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _codes(command: list[str], where: str, code: str) -> set[str]:
    """Return the rules that a file of this content would break at this place."""
    answer = subprocess.run(
        [*command, "--output-format", "concise", "--stdin-filename", where, "-"],
        input=f'"""A module."""\n\n{code}',
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode in (0, 1), answer.stderr
    lines = [line for line in answer.stdout.splitlines() if line.startswith(where)]
    return {line.split(": ", 1)[1].split()[0] for line in lines}


def _ruff(where: str, code: str) -> set[str]:
    return _codes([sys.executable, "-m", "ruff", "check"], where, code)


@pytest.mark.parametrize("where", ["synthroads_addon/core/x.py", "synthroads_addon/core/scanning/x.py", "ml/x.py"])
@pytest.mark.parametrize("code", [*BLENDER_USES.values(), *CHANCE_USES.values()], ids=[*BLENDER_USES, *CHANCE_USES])
def test_core_and_ml_are_held_to_all_bans(where: str, code: str) -> None:
    assert _ruff(where, code) == {"TID251"}


@pytest.mark.parametrize("where", ["synthroads_addon/blender/nodes/x.py", "synthroads_addon/ui/x.py"])
@pytest.mark.parametrize("code", CHANCE_USES.values(), ids=CHANCE_USES)
def test_blender_part_is_held_to_reproducibility(where: str, code: str) -> None:
    assert _codes(_lint_tool().reproducibility_command(), where, code) == {"TID251"}


@pytest.mark.parametrize("where", ["synthroads_addon/blender/x.py", "synthroads_addon/pipeline.py", "headless/x.py"])
@pytest.mark.parametrize("code", BLENDER_USES.values(), ids=BLENDER_USES)
def test_blender_part_may_use_blender(where: str, code: str) -> None:
    assert _ruff(where, code) == set()
    assert _codes(_lint_tool().reproducibility_command(), where, code) == set()


@pytest.mark.parametrize("where", ["synthroads_addon/core/x.py", "synthroads_addon/blender/x.py", "tests/core/x.py"])
@pytest.mark.parametrize("code", NUMPY_GLOBAL.values(), ids=NUMPY_GLOBAL)
def test_numpys_global_random_state_is_banned_everywhere(where: str, code: str) -> None:
    assert "NPY002" in _ruff(where, code)


def test_seeded_generators_and_clocks_that_measure_are_allowed() -> None:
    code = "import time\n\nimport numpy as np\n\nVALUE = np.random.default_rng(3).normal(), time.perf_counter()\n"
    assert _ruff("synthroads_addon/core/x.py", code) == set()
