"""Parser of command lines, and the options that all commands share."""

import argparse
import re
import sys
from collections.abc import Sequence
from typing import Any

from synthroads_addon.base.errors import nearest_name

SHORT_OPTIONS = {
    "--count": "-n",
    "--device": "-d",
    "--fidelity": "-f",
    "--jobs": "-j",
    "--output": "-o",
    "--quiet": "-q",
    "--seed": "-s",
    "--verbose": "-v",
    "--version": "-V",
}
"""Letters that stand for options, the same for all commands."""
_NEGATIVE_NUMBERS = re.compile(r"-(\.?\d|inf(inity)?$|nan$)", re.IGNORECASE)
"""Beginning of values that are no options though they begin with a dash: argparse knows neither -1e3 nor -1,2."""


class Parser(argparse.ArgumentParser):
    """Argument parser that reports errors in one line, without usage.

    Attributes:
        words: argument that takes words on both sides of options; argparse by itself ends one with ``*`` at the first.
    """

    words: str | None = None

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._negative_number_matcher = _NEGATIVE_NUMBERS

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the namespace and unknown arguments; words after options go to the argument named by `words`."""
        self._refuse_unknown_option(sys.argv[1:] if args is None else args)
        parsed_arguments, unknown_words = super().parse_known_args(args, namespace)
        if self.words and not any(word.startswith("-") for word in unknown_words):
            setattr(parsed_arguments, self.words, [*(getattr(parsed_arguments, self.words) or ()), *unknown_words])
            unknown_words = []
        return parsed_arguments, unknown_words

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is none of an argument's choices, and name the one most like it."""
        if action.choices is not None and value not in action.choices:
            names = [str(choice) for choice in action.choices]
            message = f"invalid choice: {value!r} (choose from {', '.join(names)}){nearest_name(str(value), names)}"
            raise argparse.ArgumentError(action, message)

    def _refuse_unknown_option(self, words: Sequence[str]) -> None:
        """End the command where a word is no option of it, before it misses others, and name the one most like it."""
        if self._subparsers is not None or "--" in words:  # its sub-commands have the options; or what follows is none
            return
        names = [name for action in self._actions if action.help != argparse.SUPPRESS for name in action.option_strings]
        for word in words:
            name = word.partition("=")[0]
            is_option = name.startswith("--") and " " not in name
            if is_option and not any(option.startswith(name) for option in self._option_string_actions):
                self.error(f"unrecognized arguments: {word}{nearest_name(name, names)}")

    def error(self, message: str) -> Any:
        """End the command with exit code 2 and one line."""
        self.exit(2, f"{self.prog}: {message}\n")


def add_shared_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that all commands share, and `SHORT_OPTIONS`, to a parser and its sub-parsers, in place."""
    sub_commands = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not sub_commands:
        _add_common_arguments(parser)
    for its_parser in (its_parser for action in sub_commands for its_parser in action.choices.values()):
        add_shared_options(its_parser)
    for action in parser._actions:
        letters = [SHORT_OPTIONS[name] for name in action.option_strings if name in SHORT_OPTIONS]
        action.option_strings = [*letters, *action.option_strings]
        parser._option_string_actions.update(dict.fromkeys(letters, action))


def _add_common_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the flags that all sub-commands share: ``--quiet``, ``--verbose``, ``--json``."""
    amount = parser.add_mutually_exclusive_group()
    text = "print errors only; if no output file is given, also print the result"
    amount.add_argument("--quiet", action="store_true", help=text)
    amount.add_argument("--verbose", action="store_true", help="also print settings, versions and times of stages")
    parser.add_argument("--json", action="store_true", help="print the result as JSON on standard output")
