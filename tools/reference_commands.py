"""The reference of the command line, made from the parsers themselves."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator

from headless.cli import build_parser

_WIDTH = 82
_ARGUMENT = re.compile(r"\[(?:[^\[\]]|\[[^\]]*\])*\]|\((?:[^()])*\)|\S+(?: \[\S+ \.\.\.\])?")
"""An argument in a usage: in brackets, which an argument inside may have too, or a word, with those that may follow."""


def commands() -> str:
    """Return Markdown with the usage and arguments of every sub-command of `synthroads`."""
    _, (_, parsers) = _split(build_parser())
    return "\n\n".join(text for name, parser in parsers.items() for text in _command(name, parser, "#"))


Choices = tuple[dict[str, str], dict[str, argparse.ArgumentParser]]


def _split(parser: argparse.ArgumentParser) -> tuple[list[argparse.Action], Choices]:
    """Return a parser's own visible arguments, and (summaries, parsers) of its sub-commands by name."""
    arguments: list[argparse.Action] = []
    summaries: dict[str, str] = {}
    parsers: dict[str, argparse.ArgumentParser] = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            parsers = dict(action.choices)
            summaries = {choice.dest: choice.help or "" for choice in action._choices_actions}
        elif not isinstance(action, argparse._HelpAction) and action.help != argparse.SUPPRESS:
            arguments.append(action)
    return arguments, (summaries, parsers)


def _command(name: str, parser: argparse.ArgumentParser, level: str, summary: str = "") -> Iterator[str]:
    """Yield the Markdown blocks of a command, heading first, and recursively of its sub-commands."""
    arguments, (summaries, parsers) = _split(parser)
    yield f"{level} {name}"
    yield _escaped(parser.description or f"{summary[:1].upper()}{summary[1:]}.")
    yield f"```text\n{_usage(parser)}\n```"
    if arguments:
        rows = [f"| {_names(action)} | {_meaning(action, parser)} |" for action in arguments]
        yield "\n".join(["| argument | meaning |", "|---|---|", *rows])
    for tool, its_parser in parsers.items():
        yield from _command(f"{name} {tool}", its_parser, f"{level}#", summaries[tool])


def _usage(parser: argparse.ArgumentParser) -> str:
    """Return a command's usage in lines of `_WIDTH`, broken between its arguments: each Python breaks it elsewhere."""
    formatter = argparse.HelpFormatter(parser.prog, width=100_000)
    formatter.add_usage(parser.usage, parser._actions, parser._mutually_exclusive_groups, prefix="")
    arguments = formatter.format_help().strip().removeprefix(parser.prog).strip()
    lines, indent = [parser.prog], " " * (len(parser.prog) + 1)
    for argument in _ARGUMENT.findall(arguments):
        if len(lines[-1]) + 1 + len(argument) > _WIDTH:
            lines.append(indent + argument)
        else:
            lines[-1] += f" {argument}"
    return "\n".join(lines)


def _names(action: argparse.Action) -> str:
    """Return an argument's names with their value, or the value's name alone, as Markdown code."""
    value = "" if action.nargs == 0 else f" {_metavar(action)}"
    forms = [f"{name}{value}" for name in action.option_strings] or [_metavar(action)]
    return ", ".join(f"`{text}`" for text in forms).replace("|", "\\|")


def _metavar(action: argparse.Action) -> str:
    """Return the name of an argument's value, as the help shows it."""
    if isinstance(action.metavar, tuple):
        return " ".join(action.metavar)
    if action.metavar is None and action.choices is not None:
        return "{" + ",".join(map(str, action.choices)) + "}"
    return action.metavar or action.dest.upper()


def _meaning(action: argparse.Action, parser: argparse.ArgumentParser) -> str:
    """Return an argument's help as escaped Markdown, with "(required)" where an option must be given."""
    text = parser._get_formatter()._expand_help(action) if action.help else ""
    return _escaped(text + (" **(required)**" if action.required and action.option_strings else ""))


def _escaped(text: str) -> str:
    """Return help text escaped so that Markdown shows it literally."""
    for sign in "\\|<[_":
        text = text.replace(sign, f"\\{sign}")
    return text.replace("``", "`")
