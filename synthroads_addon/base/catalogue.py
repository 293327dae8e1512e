"""Catalogue of things that have a name, kind by kind: shipped ones and files of one's own, with their key figures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .errors import InputError, nearest_name


@dataclass(frozen=True)
class Entry:
    """Entry of a catalogue: one thing that a command takes by name, shipped or in a file of one's own.

    Attributes:
        name: as it is given to a command; of a file of one's own its path.
        title: what it is, in one line.
        file: that describes it.
        figures: its key figures by name, JSON data.
        note: what else is said of it; empty if nothing is.
    """

    name: str
    title: str
    file: Path
    figures: dict[str, Any] = field(default_factory=dict)
    note: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return name, title, key figures, file and note as JSON data."""
        data = {"name": self.name, "title": self.title, **self.figures, "file": str(self.file)}
        return data | ({"note": self.note} if self.note else {})


def figure_text(value: Any) -> str:
    """Return a figure as text: numbers short, lists with commas, of counts the name before, "-" for None."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {figure_text(number)}" for name, number in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(map(figure_text, value))
    return f"{value:g}" if isinstance(value, float) else "-" if value is None else str(value)


def range_text(values: Sequence[float]) -> str:
    """Return the smallest and the largest of some numbers as text, "2 to 5", or the one that all are."""
    least, largest = min(values), max(values)
    return f"{least:g}" if least == largest else f"{least:g} to {largest:g}"


Rows = Callable[[Entry], Sequence[Sequence[str]]]
"""From an entry to its rows of a table: one, or one for each of its parts."""


@dataclass(frozen=True)
class Kind:
    """Kind of a catalogue's entries: how they are named, read and shown in a table.

    Attributes:
        title: of all of them.
        use: how one is given to a command.
        names: of what is shipped.
        read: from a name or a file of one's own to what it is; raises `InputError`.
        endings: of the files.
        head: titles of a table's columns behind the name.
        rows: cells behind the name.
    """

    title: str
    use: str
    names: Callable[[], list[str]]
    read: Callable[[str], Entry]
    endings: tuple[str, ...]
    head: tuple[str, ...]
    rows: Rows


def figures(*names: str, **writers: Callable[[Any], str]) -> Rows:
    """Return a function that makes one table row of an entry: its title, then some of its figures.

    Args:
        names: of the figures, in the order of the columns.
        writers: by the name of a figure, how it is written where not plainly.
    """
    return lambda entry: [[entry.title, *(writers.get(name, figure_text)(entry.figures[name]) for name in names)]]


def entries(kind: Kind, requests: Sequence[str] = ()) -> list[Entry]:
    """Return the shipped entries of a kind, or those that are wanted.

    Args:
        kind: of the things.
        requests: beginnings of names, files of one's own, and folders of such files; empty for all that is shipped.

    Raises:
        InputError: no name begins so, or a file is wrong.
    """
    if not requests:
        return [kind.read(name) for name in kind.names()]
    names = (name for text in requests for name in _find_names(kind, text))
    return [kind.read(name) for name in dict.fromkeys(names)]


def _find_names(kind: Kind, text: str) -> list[str]:
    """Return the names that begin with a text, the file that it is, or the files in the folder that it is."""
    names = [name for name in kind.names() if name.startswith(text)]
    path = Path(text)
    if names:
        return names
    if path.suffix.lower() in kind.endings:
        return [text]
    files = sorted(str(file) for file in path.glob("*") if file.suffix.lower() in kind.endings) if path.is_dir() else []
    if not files:
        endings = " or ".join(kind.endings)
        allowed = f"must be a {endings} file, a folder of such files, or the beginning of {', '.join(kind.names())}"
        raise InputError(kind.title.lower(), text, f"{allowed}{nearest_name(text, kind.names())}")
    return files


def preset_file(folder: Path, ending: str, name_or_file: str, names: Sequence[str]) -> Path:
    """Return the path of something shipped if the name is among ``names``, else the name itself as a path."""
    return folder / f"{name_or_file}{ending}" if name_or_file in names else Path(name_or_file)
