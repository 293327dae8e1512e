"""Texts of users in Matplotlib's figures, which takes some for formulas and some for what isn't to be shown."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

_NO_WIDTH = "\N{ZERO WIDTH SPACE}"


@contextmanager
def literal_texts() -> Iterator[None]:
    """Context, also a decorator, in which Matplotlib takes no text of a figure that is drawn and saved for a formula.

    Two dollars in a file's name would make what is between them one. Signs that the font lacks are drawn as boxes,
    without a warning for each.
    """
    import matplotlib as mpl  # takes half a second, which only pictures need

    with mpl.rc_context({"text.parse_math": False}), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def shown_text(text: str) -> str:
    """Return a text for a figure: signs that can't be printed escaped, and in legends even if it begins with ``_``.

    Matplotlib leaves such labels out of legends, and can't draw the parts of file names that are no text.
    """
    printable = "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in text)
    return f"{_NO_WIDTH}{printable}" if printable.startswith("_") else printable
