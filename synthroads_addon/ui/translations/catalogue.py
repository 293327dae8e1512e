"""A catalogue of translated messages, with patterns for texts that hold names and numbers."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cached_property, lru_cache
from pathlib import Path

FOLDER = Path(__file__).parent
_HOLE = re.compile(r"\{(\d)\}")
_GROUPS = {"9": r"(°|%|m|1 : n|per (?:km|m|m²|ha|s|100 m)|cm³|m?m/dB|dB|kHz|Hz|m?rad|ns|nm|mm/h|h|d|K|hPa)"}
"""Hole -> what it may hold, if not any text: ``{9}`` holds a unit, as in ``Length (km)``."""
_UNITS = "m|mm|km|s|h|d|deg|rad|mrad|nm|kHz|MHz|Hz|px|dB|m/dB|1 : n|ns|K|hPa|B|cm³|m/s|mm/h|per|m²|ha|n"
_NOTHING_SAID = re.compile(r"(?:[-+\d.,e%°×: ]|\{\d\}|\b(?:" + _UNITS + r")\b)*")
"""Numbers and units, which are the same in every language."""
_DEEPEST = 6
"""Most patterns within each other; chosen: a tooltip has four."""


class Catalogue:
    """Translations into one language.

    Args:
        messages: English message or pattern -> translation, with the same holes ``{0}``, ``{1}``, ...
    """

    def __init__(self, messages: dict[str, str]) -> None:
        self.messages = messages
        self._translations: dict[str, str | None] = {}

    def translate(self, text: str) -> str | None:
        """Return a text's translation, kept for the next time; None if the catalogue has none.

        Example:
            >>> catalogue = Catalogue({"Length": "Länge", "Own {0}": "{0} angeben", "{0} points": "{0} Punkte"})
            >>> catalogue.translate("Own Length"), catalogue.translate("12 points"), catalogue.translate("Width")
            ('Länge angeben', '12 Punkte', None)
        """
        if text not in self._translations:
            self._translations[text] = self._translate(text, 0)
        return self._translations[text]

    def _translate(self, text: str, depth: int) -> str | None:
        """Return the translation of a text, or of a part of one at a depth of patterns within each other."""
        if text in self.messages:
            return self.messages[text]
        if depth == _DEEPEST:
            return None
        for pattern, message in self._pattern_messages:
            if match := pattern.fullmatch(text):
                parts = [self._translate(part, depth + 1) or part for part in match.groups()]
                held = dict(zip(_HOLE.findall(message), parts, strict=True))
                return "".join(held[piece] if place % 2 else piece for place, piece in _pieces(self.messages[message]))
        return None

    def missing(self, text: str, used: set[str]) -> set[str]:
        """Return the parts of a text that have no translation, and note in `used` the messages that it uses."""
        if text in self.messages:
            used.add(text)
            return set()
        for pattern, message in self._pattern_messages:
            if match := pattern.fullmatch(text):
                used.add(message)
                parts = [part for part in match.groups() if _says_something(part)]
                return set().union(*(self.missing(part, used) for part in parts))
        return {text}

    @cached_property
    def _pattern_messages(self) -> list[tuple[re.Pattern[str], str]]:
        """Return the patterns as regular expressions, and as the catalogue has them; those with most letters first."""
        holed = [message for message in self.messages if _HOLE.search(message)]
        holed.sort(key=lambda message: -len(_HOLE.sub("", message)))
        return [(pattern_of(message), message) for message in holed]


def _pieces(message: str) -> Iterator[tuple[int, str]]:
    """Yield (place, piece) of a message: texts at even places, the numbers of its holes at odd ones."""
    return enumerate(_HOLE.split(message))


def _says_something(part: str) -> bool:
    """Return whether a part has words to translate: no number with its unit, and no hole."""
    return _NOTHING_SAID.fullmatch(part) is None


def pattern_of(message: str) -> re.Pattern[str]:
    """Return the regular expression of a message with holes, which are its groups in order."""
    *pieces, last = _HOLE.split(message)
    texts = [
        re.escape(text) + _GROUPS.get(number, "(.+?)") for text, number in zip(pieces[::2], pieces[1::2], strict=True)
    ]
    return re.compile("".join(texts) + re.escape(last), re.DOTALL)


@lru_cache(maxsize=8)
def catalogue_of(locale: str) -> Catalogue | None:
    """Return the catalogue of a locale such as ``de_DE``: its own, else its language's; None if there is neither."""
    for name in (locale, locale.partition("_")[0]):
        path = FOLDER / f"{name}.json"
        if path.is_file():
            return Catalogue(json.loads(path.read_text(encoding="utf-8")))
    return None


def languages() -> list[str]:
    """Return the names of the catalogues that there are, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.json"))
