"""The extension's zip is installed into a Blender that has nothing but itself, and every operator answers there."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.doors.environments import places, run

pytestmark = pytest.mark.doors

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def resources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of a user's settings, with both extensions installed there."""
    folder = tmp_path_factory.mktemp("user")
    zips = sorted(Path(places()["zips"]).glob("*.zip"))
    assert [path.name.partition("-")[0] for path in zips] == ["synthroads", "synthroads_ifc"]
    variables = {"BLENDER_USER_RESOURCES": str(folder)}
    answer = run(places()["bare"], HERE / "install_extension.py", *zips, folder=folder, variables=variables)
    said = answer.stdout + answer.stderr
    assert answer.returncode == 0, said
    assert "Traceback" not in said
    brought = json.loads(answer.stdout.splitlines()[-1])["brought"]
    assert not brought.pop("numpy"), "Blender's own NumPy is used"
    assert all(brought.values())
    return folder


def test_blender_has_nothing_of_ours_by_itself() -> None:
    for package in ("scipy", "pydantic", "laspy", "synthroads_addon"):
        answer = run(places()["bare"], "-c", f"import {package}", folder=HERE)
        assert f"No module named '{package}'" in answer.stderr


def test_every_operator_answers_in_a_sentence(resources: Path, tmp_path: Path) -> None:
    """Each is called on an empty scene, on a road and after a scan; then the extension is disabled and enabled.

    With `make test` after a scan alone: on the others tests/ui/test_operators.py calls those of the source.
    """
    variables = {"BLENDER_USER_RESOURCES": str(resources)}
    scenes = () if places()["every_door"] else ("--scenes", "worked")
    words = (HERE / "call_operators.py", "bl_ext.user_default.synthroads", *scenes)
    answer = run(places()["bare"], *words, "--output", tmp_path / "answers.json", folder=tmp_path, variables=variables)
    said = answer.stdout + answer.stderr
    assert (tmp_path / "answers.json").exists(), said
    answers = json.loads((tmp_path / "answers.json").read_text(encoding="utf-8"))
    assert [row for row in answers["operators"] if row["outcome"] == "traceback"] == []
    assert (answers["left_after_disabling"], answers["registered_again"]) == ([], True)
    finished = {row["operator"] for row in answers["operators"] if row["outcome"] == "finished"}
    wanted = ["build", "random_road", "check_rules", "compare_intensities", "show_cloud", "add_views"]
    if places()["every_door"]:  # after a scan another one is refused, as its cloud is there: the one that is shown
        wanted.append("scan")
    assert {f"synthroads.{name}" for name in wanted} <= finished
    assert answer.returncode == 0, said
