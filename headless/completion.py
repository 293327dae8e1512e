"""Completion of the shell after `synthroads`: commands, options, names and files, as a script for the shell.

The scripts are made by `shtab` from the parsers: a shell that has read one asks no program at each press of the key.
"""

import argparse
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from headless.list import KINDS
from synthroads_addon.jobs.format_losses import format_names
from synthroads_addon.jobs.measure.tradeoff import KNOBS
from synthroads_addon.road.guidelines import STANDARD_CROSS_SECTIONS
from synthroads_addon.twin.formats import TWIN_FORMATS

_NAMES_OR_FILES = {
    "--classes": "classes",
    "--device": "devices",
    "--mapping": "mappings",
    "--scenario": "scenarios",
    "configuration": "trainings",
    "experiment": "experiments",
    "recipe": "recipes",
}
"""Option or argument -> kind of `synthroads list` whose names it takes in place of a file."""
_NAMES: dict[str, Iterable[str]] = {
    "--cross-section": STANDARD_CROSS_SECTIONS,
    "--formats": format_names(),
    "--knobs": KNOBS,
    "--twin": TWIN_FORMATS,
}
"""Names that an option takes, beside those that its parser knows as its choices."""


def completion_script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Return a shell's completion script for a parser, which is modified and can't be used afterwards.

    Args:
        parser: with all sub-commands.
        shell: bash, fish or zsh.

    Raises:
        ModuleNotFoundError: `shtab` isn't installed.
    """
    import shtab

    _set_completions(parser, shtab.FILE, shtab.DIRECTORY)
    return str(shtab.complete(parser, shell))


def _set_completions(parser: argparse.ArgumentParser, file: Any, directory: Any) -> None:
    """Set what each argument of a parser completes (files, folders or names) for `shtab`, in place."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for its_parser in action.choices.values():
                _set_completions(its_parser, file, directory)
            continue
        names: Sequence[str] = action.option_strings or [action.dest]
        kind = next((name for name in names if name in _NAMES_OR_FILES), None)
        takes_files = action.type is Path or action.metavar == "FILE"
        if action.metavar == "DIR":
            action.complete = directory  # type: ignore[attr-defined] # an attribute of shtab's
        elif takes_files:
            action.complete = file  # type: ignore[attr-defined]
        elif kind is not None:
            action.complete = _names_or_files(kind, sorted(KINDS[_NAMES_OR_FILES[kind]].names()))  # type: ignore[attr-defined]
        elif names[-1] in _NAMES:
            action.choices = sorted(_NAMES[names[-1]])


def _names_or_files(kind: str, names: Sequence[str]) -> dict[str, Any]:
    """Return shell functions for `shtab`, by shell, that complete given names as well as files."""
    function = f"_synthroads_{kind.strip('-')}_or_files"
    words = shlex.join(names)
    bash = f'{function}() {{\n  compgen -W {shlex.quote(words)} -- "$1"\n  compgen -f -- "$1"\n}}'
    fish = f"function {function}\n  printf '%s\\n' {words}\n  __fish_complete_path (commandline -ct)\nend"
    alternatives = f"{shlex.quote(f'names:name:({words})')} 'files:file:_files'"
    zsh = f"{function}() {{\n  _alternative {alternatives}\n}}"
    preamble = {"bash": bash, "fish": fish, "zsh": zsh}
    return {"bash": function, "fish": f"({function})", "zsh": function, "preamble": preamble}
