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
        shown = "" if value is None else f" is {_short(repr(_plain(value)), _LONGEST_VALUE)}"
        super().__init__(f"{_short(field, _LONGEST_FIELD)}{shown}: {_short(allowed, _LONGEST_ALLOWED)}")


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
"""Names that a hint suggests at most. Chosen."""
_SLIP, _LIKENESS = 0.8, 0.65
"""Likeness (0 to 1, Ratcliff and Obershelp 1988) of a name with a slip of the keys, and of one worth a hint. Chosen."""


def nearest_name(name: str, known: Iterable[str]) -> str:
    """Return `` (did you mean 'x'?)`` for the known names most like `name`, or an empty string; see `similar_names`."""
    return suggestion(similar_names(name, known))


def similar_names(name: str, known: Iterable[str]) -> list[str]:
    """Return the known name most like `name`, or up to three that contain it; empty if none is like it.

    Capitals, spaces, dashes and dots make no difference: ``VLP 16`` is found in ``velodyne-vlp-16``.
    """
    letters = {one: _letters(one) for one in dict.fromkeys(known)}
    text = _letters(name)
    closest = difflib.get_close_matches(text, letters.values(), n=1, cutoff=_LIKENESS)
    same = [one for one, word in letters.items() if word == (closest[0] if closest else None)][:1]
    if same and difflib.SequenceMatcher(None, letters[same[0]], text).ratio() >= _SLIP:
        return same
    containing = [one for one, word in letters.items() if len(text) > 2 and text in word]
    return containing[:MOST_NAMES] or same


def suggestion(names: Sequence[str]) -> str:
    """Return `` (did you mean 'x', 'y' or 'z'?)`` for some names, or an empty string for none."""
    quoted = [f"'{name}'" for name in names]
    listed = " or ".join(filter(None, [", ".join(quoted[:-1]), *quoted[-1:]]))
    return f" (did you mean {listed}?)" if listed else ""


def _letters(name: str) -> str:
    """Return the letters and digits of a name in lower case."""
    return "".join(sign for sign in name.lower() if sign.isalnum())


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
