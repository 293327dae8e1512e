"""The tests that `make quick` takes: nearest to what changed, and none after the time is over."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tools import quick_tests

TEXTS = {
    "tests/road/test_curve.py": "from synthroads_addon.road.curve import Curve\n",
    "tests/road/test_profile.py": "from synthroads_addon.road.profile import Profile\n",
    "tests/road/helpers.py": "from synthroads_addon.road.profile import Profile\n",
    "tests/jobs/test_drive.py": "from tests.road.helpers import drawn\n",
    "tests/jobs/test_presets.py": 'PATH = "devices/scanner.json"\n',
    "tests/twin/test_unrelated.py": "from synthroads_addon.twin import writer\n",
}
IMPORTERS = {"synthroads_addon.road.curve": {"synthroads_addon.road.profile"}}


def nearest(*changed: str) -> list[str]:
    return quick_tests.nearest_tests(changed, TEXTS, IMPORTERS)


def test_tests_come_by_the_number_of_imports_between() -> None:
    assert nearest("synthroads_addon/road/curve.py") == [
        "tests/road/test_curve.py", "tests/road/test_profile.py", "tests/jobs/test_drive.py",
    ]  # fmt: skip


def test_a_changed_test_is_the_nearest_and_files_are_near_to_what_names_them() -> None:
    assert nearest("synthroads_addon/road/curve.py", "tests/road/test_profile.py")[0] == "tests/road/test_profile.py"
    assert nearest("synthroads_addon/presets/devices/scanner.json") == ["tests/jobs/test_presets.py"]
    assert nearest("docs/other.md") == []


def test_changes_are_those_since_the_branch_left_and_what_is_not_committed(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *words], cwd=tmp_path, check=True)

    git("init", "-q", "-b", "main")
    (tmp_path / "old.py").write_text("")
    git("add", "."), git("commit", "-q", "-m", "old"), git("checkout", "-q", "-b", "work")
    (tmp_path / "committed.py").write_text("")
    git("add", "."), git("commit", "-q", "-m", "new"), git("checkout", "-q", "main")
    (tmp_path / "meanwhile.py").write_text("")
    git("add", "."), git("commit", "-q", "-m", "meanwhile"), git("checkout", "-q", "work")
    (tmp_path / "old.py").write_text("1")
    (tmp_path / "new.py").write_text("")
    assert quick_tests.changed_files(tmp_path, "main") == ["committed.py", "new.py", "old.py"]


@pytest.mark.parametrize(("until", "outcome"), [("0", "1 skipped"), ("9999999999", "1 passed")])
def test_no_test_begins_after_the_time(tmp_path: Path, until: str, outcome: str) -> None:
    (tmp_path / "test_it.py").write_text("def test_it(): pass\n")
    root = Path(quick_tests.__file__).parent.parent
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "tools.quick_tests", "test_it.py"]
    environment = {"PYTHONPATH": str(root), quick_tests.UNTIL: until}
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert outcome in done.stdout, done.stdout + done.stderr
