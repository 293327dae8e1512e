"""The project's one tree of errors.

`SynthRoadsError` is what a caller catches. `InputError` (and its children) say that the user's input is wrong: the
command line turns them into one line and exit code 2, the panel into a message. Anything else is a defect of ours.
"""

import difflib
from collections.abc import Iterable, Sequence


class SynthRoadsError(Exception):
    """Base of every error raised on purpose."""


class InputError(SynthRoadsError):
    """An input is wrong; the message is one line that names the field, its value and what is allowed.

    Args:
        field: where the value stands, as a dotted path or a file name, e.g. ``scan.platform.height``.
        value: the offending value; None if there is none to show (a missing key, say).
        allowed: what would be right, in words with its unit.

    Example:
        >>> print(InputError("scan.platform.height", -3, "a height above 0 m is needed"))
        scan.platform.height is -3: a height above 0 m is needed
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        self.field = field
        self.value = value
        self.allowed = allowed
        value_text = "" if value is None else f" is {_short(repr(_plain(value)), _LONGEST_VALUE)}"
        super().__init__(f"{_short(field, _LONGEST_FIELD)}{value_text}: {_short(allowed, _LONGEST_ALLOWED)}")


class MissingFileError(InputError):
    """An input file or folder does not exist or cannot be read."""


class OutputError(InputError):
    """The output cannot be written: no permission, already there, disk full."""


class MissingPackageError(InputError):
    """A Python package that the input needs isn't installed; the message says with which extra it comes.

    Args:
        field, value: what needs it, see `InputError`.
        package: its name.
        extra: of ours, that brings it.
    """

    def __init__(self, field: str, value: object, package: str, extra: str) -> None:
        self.package, self.extra = package, extra
        super().__init__(field, value, f"needs the package {package}: pip install 'synthroads[{extra}]'")


class Cancelled(SynthRoadsError):
    """The user stopped the work (Esc or Ctrl-C); nothing is left half-written."""


def _plain(value: object) -> object:
    """Return a NumPy number as Python's own (NumPy 2 shows 1.5 as np.float64(1.5)), anything else as it is."""
    item = getattr(value, "item", None)
    return item() if type(value).__module__ == "numpy" and item and not hasattr(value, "__len__") else value


MOST_NAMES = 3
"""Most names that a hint suggests. Chosen."""
_SLIP, _LIKENESS = 0.8, 0.65
"""Likeness (0 to 1, Ratcliff and Obershelp 1988) of a name with a slip of the keys, and of one worth a hint. Chosen."""


def nearest_name(name: str, known_names: Iterable[str]) -> str:
    """Return `` (did you mean 'x'?)`` for the known names most like `name`, or an empty string; see `similar_names`."""
    return suggestion(similar_names(name, known_names))


def similar_names(name: str, known_names: Iterable[str]) -> list[str]:
    """Return the known name most like `name`, or up to three that contain it; empty if none is like it.

    Capitals, spaces, dashes and dots make no difference: ``VLP 16`` matches ``velodyne-vlp-16``.
    """
    words = {known_name: _letters(known_name) for known_name in dict.fromkeys(known_names)}
    text = _letters(name)
    closest_words = difflib.get_close_matches(text, words.values(), n=1, cutoff=_LIKENESS)
    closest_names = [known_name for known_name, word in words.items() if word in closest_words][:1]
    if closest_names and difflib.SequenceMatcher(None, words[closest_names[0]], text).ratio() >= _SLIP:
        return closest_names
    names_with_text = [known_name for known_name, word in words.items() if len(text) > 2 and text in word]
    return names_with_text[:MOST_NAMES] or closest_names


def suggestion(names: Sequence[str]) -> str:
    """Return `` (did you mean 'x', 'y' or 'z'?)`` for some names, or an empty string for none."""
    quoted_names = [f"'{name}'" for name in names]
    name_list = " or ".join(filter(None, [", ".join(quoted_names[:-1]), *quoted_names[-1:]]))
    return f" (did you mean {name_list}?)" if name_list else ""


def _letters(name: str) -> str:
    """Return the letters and digits of a name in lower case."""
    return "".join(character for character in name.lower() if character.isalnum())


_LONGEST_FIELD, _LONGEST_VALUE, _LONGEST_ALLOWED = 300, 160, 1000
"""Characters that are shown of a message's parts: all three may hold what a file said, of any length."""


def _short(text: str, limit: int) -> str:
    """Return a text as one printable line of at most ``limit`` characters, the middle of a long one left out."""
    if len(text) > 4 * limit:  # what is left out need not be looked at
        text = f"{text[: 2 * limit]}{text[-2 * limit :]}"
    text = " ".join(text.split())
    text = "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in text)
    half = limit // 2 - 2
    return text if len(text) <= limit else f"{text[:half]}...{text[-half:]}"
