"""Folders stay small enough to be read: few files each, and none that a common prefix should make a folder."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MOST_FILES = 21
"""Most Python files in a folder, `__init__.py` counted."""
MAY_HAVE_MORE = {"headless", "synthroads_addon/blender/things", "synthroads_addon/road/things"}
MOST_OF_A_WORD = 3
"""Most files in a folder that share the word before the first underscore."""
MOST_LINES_OF_A_COMMAND = 250
"""Most lines of a file of the command line: what is longer works something out, and that belongs below."""


def _folders(*tops: str) -> dict[str, list[str]]:
    """Return the names of the Python files of each folder."""
    found: dict[str, list[str]] = {}
    for path in (path for top in tops for path in sorted((ROOT / top).rglob("*.py"))):
        found.setdefault(path.parent.relative_to(ROOT).as_posix(), []).append(path.stem)
    return found


def test_no_folder_has_too_many_files() -> None:
    sizes = {folder: len(names) for folder, names in _folders("synthroads_addon", "headless", "ml", "studies").items()}
    assert {folder for folder, size in sizes.items() if size > MOST_FILES} <= MAY_HAVE_MORE


def test_files_that_share_a_word_have_a_folder_of_that_word() -> None:
    for folder, names in _folders("synthroads_addon", "headless", "ml", "studies", "tests").items():
        words = [name.partition("_")[0] for name in names if "_" in name.strip("_") and not name.startswith("test_")]
        assert not [word for word, number in Counter(words).items() if number > MOST_OF_A_WORD], folder


def test_files_of_the_command_line_are_short() -> None:
    lines = {path.name: len(path.read_bytes().splitlines()) for path in (ROOT / "headless").rglob("*.py")}
    assert {name: number for name, number in lines.items() if number > MOST_LINES_OF_A_COMMAND} == {}


def test_nothing_lies_loose_in_the_add_on() -> None:
    assert [path.name for path in (ROOT / "synthroads_addon").glob("*.py")] == ["__init__.py"]


ABOUT_ALL = ("cluster", "doors", "fuzz", "helpers", "judges", "packaging", "robustness")
"""Folders of tests that are about no folder of the source; those in `jobs` need Blender."""


def test_tests_mirror_the_tree() -> None:
    """Each folder of tests has the name of a folder of the source, but for those that are about all of it."""
    for folder in _folders("tests"):
        top, *rest = folder.split("/")[1:] or ["helpers"]
        if top not in ABOUT_ALL and [top, *rest] != ["jobs", "effects"]:
            place = Path(top, *rest) if top in ("headless", "ml") else Path("synthroads_addon", top, *rest)
            assert (ROOT / place).is_dir(), folder
