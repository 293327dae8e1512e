"""`Platform`: base of all that carries a scanner."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np

from ...base.arrays import Float
from ...base.rotations import rotation_matrix
from ...base.schema import ClosedModel, quantity
from .guides import Guide
from .path import Path


class Platform(ClosedModel):
    """Carrier of the scanner and its place; each kind adds its own fields.

    Attributes:
        usual: values of fields while they aren't given, by name; a field without one follows from the road or a file.
        usual_range: usual distance to what is scanned, m; None for the height.
        driven: whether it drives in the road's lanes, so that vehicles catch up with it.
    """

    usual: ClassVar[Mapping[str, Any]] = {}
    usual_range: ClassVar[float | None] = None
    driven: ClassVar[bool] = False

    kind: str
    roll_deg: float = quantity(0.0, "deg", "Mounting of the scanner: about the forward axis.", (-180, 180))
    pitch_deg: float = quantity(0.0, "deg", "Mounting of the scanner: nose up.", (-90, 90))
    yaw_deg: float = quantity(0.0, "deg", "Mounting of the scanner: counter-clockwise from above.", (-180, 180))

    def make_path(self, guide: Guide, origin: Sequence[float] | None = None) -> Path:
        """Return the scanner's path along a guide line.

        Args:
            guide: the line that it follows, e.g. a road's centreline.
            origin: map coordinates of the local origin (m), for a file's coordinates; the guide's if not given.

        Raises:
            InputError: there is no such way, e.g. because an offset line would turn back on itself or the ground below
                isn't known.
        """
        raise NotImplementedError

    def opened(self) -> Self:
        """Return the platform with its file, if it has one, read and checked: all of its paths are made of that.

        Raises:
            InputError: the file can't be read, or isn't as it must be.
        """
        return self

    def value(self, field: str) -> Any:
        """Return a field's value, or its usual one while it isn't given."""
        set_value = getattr(self, field)
        return self.usual.get(field) if set_value is None else set_value

    def typical_range(self) -> float | None:
        """Return the usual distance to what is scanned, m; None where only the path shows it."""
        if "height" not in self.usual:
            return None
        height = float(self.value("height"))
        return height if self.usual_range is None else max(self.usual_range, height)

    def as_single_strip(self) -> Self:
        """Return the platform reduced to one strip on its guide, if it may choose its offsets; else itself."""
        return self

    def mounting(self) -> Float:
        """Return the rotation (3, 3) from the scanner's frame to the platform's."""
        return rotation_matrix(*np.deg2rad([self.yaw_deg, self.pitch_deg, self.roll_deg]))
