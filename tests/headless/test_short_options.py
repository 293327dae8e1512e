"""Letters that stand for options: the same option in all commands, wherever it is known."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator

import pytest

from headless.cli import COMMANDS, build_parser
from headless.commands import command, module_of
from headless.parser import SHORT_OPTIONS, add_shared_options


def parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Yield a parser and those of all its sub-commands."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for its_parser in action.choices.values():
                yield from parsers(its_parser)


ALL = list(parsers(build_parser()))


def test_a_letter_has_one_meaning() -> None:
    meanings: dict[str, set[str]] = {}
    for parser in ALL:
        for action in parser._actions:
            long = [name for name in action.option_strings if name.startswith("--")]
            for letter in set(action.option_strings) - set(long):
                assert len(long) == 1, f"{parser.prog} {letter}"
                meanings.setdefault(letter, set()).update(long)
    assert meanings == {"-h": {"--help"}, **{letter: {name} for name, letter in SHORT_OPTIONS.items()}}


def test_an_option_has_its_letter_in_every_command() -> None:
    for parser in ALL:
        for action in parser._actions:
            for name in set(action.option_strings) & set(SHORT_OPTIONS):
                assert SHORT_OPTIONS[name] in action.option_strings, f"{parser.prog} {name}"
                assert parser._option_string_actions[SHORT_OPTIONS[name]] is action


def test_they_are_understood() -> None:
    found = build_parser().parse_args(["generate", "-o", "out", "-s", "7", "-f", "draft", "-q"])
    assert (str(found.output), found.seed, found.fidelity, found.quiet) == ("out", 7, "draft", True)
    found = build_parser().parse_args(["dataset", "small-roads", "-o", "out", "-j", "2", "-v"])
    assert (found.jobs, found.verbose) == (2, True)
    found = build_parser().parse_args(["cloud", "subsample", "in.laz", "-o", "out.laz"])
    assert str(found.output) == "out.laz"


def test_a_command_by_itself_understands_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert command("parameters", ["-s", "3", "-n", "2", "--length", "50", "-q"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [json.loads(line)["metadata"]["seed"] for line in lines] == [3, 4]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_can_be_quiet_and_verbose(name: str) -> None:
    parser = argparse.ArgumentParser()
    module_of(name).add_arguments(parser)
    add_shared_options(parser)
    for tool in list(parsers(parser))[1:] or [parser]:
        known = tool._option_string_actions
        assert {"--quiet", "--verbose", "--json"} <= set(known)
