"""`ClassMapping`: which classes things have in a scene that nobody labelled, by their names."""

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase

from pydantic import Field

from .classes import classes
from .errors import InputError, nearest_name
from .schema import Model

KINDS = ("objects", "materials", "collections")
"""Kinds of things that can be named, the stronger first."""


class ClassMapping(Model):
    """Names -> classes, for scenes of others. Names are shell patterns: ``Tree*``, ``pole.???``, ``[Ss]ign*``.

    ``Lamp.*`` fits ``Lamp`` too: of the same things Blender calls the first that, and the others ``Lamp.001`` and so
    on. Case matters, and of several patterns that fit a name the first counts. What stands nearer to the face wins; in
    full, a face's class is

    1. its attribute ``class_id``,
    2. that of its object's name, or of the name of the object that shows it as an instance,
    3. the custom property ``synthroads_class`` of one of these objects,
    4. that of its material's name,
    5. that of a collection that its object is in, the innermost first,
    6. the class that a collection of its object is named after,
    7. else none: unlabelled.

    A pattern whose class is left empty, as in a file that is still to be filled in, gives none.
    """

    objects: dict[str, str] = Field({}, description="Pattern of objects' names -> class.")
    materials: dict[str, str] = Field({}, description="Pattern of materials' names -> class.")
    collections: dict[str, str] = Field({}, description="Pattern of collections' names -> class.")

    def check(self, class_names: Iterable[str], source: str) -> None:
        """Raise InputError if the mapping names a class that a scheme doesn't have.

        Args:
            class_names: names of the scheme's classes.
            source: file of the mapping.

        Raises:
            InputError: there is no such class; names the pattern.
        """
        class_names = tuple(class_names)
        for kind in KINDS:
            for pattern, name in getattr(self, kind).items():
                if name and name not in class_names:
                    hint = nearest_name(name, class_names)
                    raise InputError(
                        f"{source}: {kind}.{pattern}", name, f"must be one of {', '.join(class_names)}{hint}"
                    )


def fits_pattern(name: str, pattern: str) -> bool:
    """Return whether a name fits a shell pattern; ``Lamp.*`` fits ``Lamp`` too. Case matters.

    Example:
        >>> fits_pattern("Lamp.003", "Lamp.*"), fits_pattern("Lamp", "Lamp.*"), fits_pattern("lamp", "Lamp*")
        (True, True, False)
    """
    return fnmatchcase(name, pattern) or (pattern.endswith(".*") and fnmatchcase(name, pattern[:-2]))


class NameClasses:
    """Finds the classes of one scene's things by their names, and remembers which patterns fitted.

    Args:
        mapping: names -> classes; none if None.
        ids: ``class_id`` by the names of classes; that of the full table if None.
    """

    def __init__(self, mapping: ClassMapping | None, ids: Mapping[str, int] | None = None) -> None:
        ids = {row.name: row.id for row in classes()} if ids is None else ids
        rows: Mapping[str, dict[str, str]] = {kind: getattr(mapping, kind) if mapping else {} for kind in KINDS}
        self._rows = {kind: [(pattern, ids[name]) for pattern, name in rows[kind].items() if name] for kind in KINDS}
        self._class_of_name: dict[tuple[str, str], int | None] = {}
        self._matched_patterns: set[tuple[str, str]] = set()

    def find(self, kind: str, *names: str) -> int | None:
        """Return the ``class_id`` of the first of these names that has one; None if none has."""
        numbers = [self._find(kind, name) for name in names]
        return next((number for number in numbers if number is not None), None)

    def unmatched_patterns(self) -> tuple[str, ...]:
        """Return the patterns that no name fitted so far, each as ``kind: pattern``."""
        rows = ((kind, pattern) for kind in KINDS for pattern, _ in self._rows[kind])
        return tuple(f"{kind}: {pattern}" for kind, pattern in rows if (kind, pattern) not in self._matched_patterns)

    def _find(self, kind: str, name: str) -> int | None:
        """Return the ``class_id`` that the first fitting pattern gives a name; None without; remembered by name."""
        if not self._rows[kind]:
            return None
        if (kind, name) not in self._class_of_name:
            fits = [(pattern, number) for pattern, number in self._rows[kind] if fits_pattern(name, pattern)]
            self._matched_patterns |= {(kind, pattern) for pattern, _ in fits}
            self._class_of_name[kind, name] = fits[0][1] if fits else None
        return self._class_of_name[kind, name]
