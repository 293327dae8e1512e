"""Every operator that is registered, called without arguments and without a window: none ends in a traceback."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.doors import call_operators

SCRIPT = Path(call_operators.__file__)


@pytest.mark.parametrize(
    "scene", ["empty", pytest.param("road", marks=pytest.mark.slow), pytest.param("worked", marks=pytest.mark.slow)]
)
def test_no_operator_ends_in_a_traceback(scene: str, tmp_path: Path) -> None:
    output = tmp_path / "operators.json"
    command = [sys.executable, SCRIPT, "synthroads_addon", "--scenes", scene, "--output", output]
    answer = subprocess.run(command, cwd=SCRIPT.parents[2], capture_output=True, text=True, check=False)
    assert output.exists(), answer.stderr
    found = json.loads(output.read_text(encoding="utf-8"))
    rows = {row["operator"]: row for row in found["operators"]}
    assert len(rows) > 35
    assert [row for row in rows.values() if row["outcome"] == "traceback"] == []
    assert {rows["synthroads.cancel"]["outcome"], rows["synthroads.add_file"]["outcome"]} == {"finished", "refused"}
    assert rows["synthroads.add_file"]["text"].startswith("path is ''")
    assert (found["left_after_disabling"], found["registered_again"]) == ([], True)
    assert answer.returncode == 0


def test_an_error_without_a_sentence_counts_as_a_traceback() -> None:
    outcome = call_operators.outcome_of
    assert outcome("Error: Output: choose a folder\n") == ("refused", "Output: choose a folder")
    assert outcome("Operator bpy.ops.synthroads.x.poll() Build a road first") == ("refused", "Build a road first")
    for text in (
        "Error: Python: Traceback (most recent call last):\n  File",
        "Operator bpy.ops.synthroads.x.poll() failed, context is incorrect",
        "Error: first\nsecond",
        "",
    ):
        assert outcome(text)[0] == "traceback"
