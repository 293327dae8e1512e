"""`Tolerance`: how large the errors of a cloud may be; and the words for it, ``height=5mm,intensity=5%``."""

import re
from dataclasses import dataclass
from typing import Any

from pydantic import model_validator

from ..base.errors import InputError, nearest_name
from ..base.schema import ClosedModel, quantity

LENGTHS = {"um": 1e-6, "µm": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}
SHARES = {"": 1.0, "%": 0.01, "‰": 0.001}
PLAIN = {"": 1.0}
TIMES = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\s\d]*)\s*")


@dataclass(frozen=True)
class ErrorKind:
    """Kind of error: its column in the trade-off's tables, and its units.

    Attributes:
        column: of the trade-off's tables, see `tradeoff.ROW_TITLES`.
        units: that a tolerance can be given in, and their factors.
        factor: by which the column's numbers become the kind's.
        suffix: the column's unit.
    """

    column: str
    units: dict[str, float]
    factor: float = 1.0
    suffix: str = ""


KINDS: dict[str, ErrorKind] = {
    "height": ErrorKind("height_mm", LENGTHS, 1e-3, " mm"),
    "position": ErrorKind("position_mm", LENGTHS, 1e-3, " mm"),
    "relief": ErrorKind("relief_mm", LENGTHS, 1e-3, " mm"),
    "intensity": ErrorKind("intensity_percent", SHARES, 0.01, " %"),
    "colour": ErrorKind("colour_95", PLAIN),
    "layers": ErrorKind("layers_rmse", PLAIN),
    "labels": ErrorKind("labels_percent", SHARES, 0.01, " %"),
    "density": ErrorKind("density_percent", SHARES, 0.01, " %"),
}
"""Kinds of errors by the names of `Tolerance`'s fields."""


class Tolerance(ClosedModel):
    """Largest errors that a cloud may have; what isn't given may be as large as the cheapest settings make it.

    As text each can have a unit: ``"5mm"``, ``"2 %"``.
    """

    height: float | None = quantity(None, "m", "Height of the road's surface, largest error.", (0, 10))
    position: float | None = quantity(None, "m", "Position of the hits, error of 95 % of the pulses.", (0, 10))
    relief: float | None = quantity(None, "m", "Micro-relief of the points, error of 95 % of them.", (0, 10))
    intensity: float | None = quantity(None, "1", "Intensity, relative error of 95 % of the pulses.", (0, 10))
    colour: float | None = quantity(None, "1", "Colour, CIEDE2000 of 95 % of the points.", (0, 100))
    layers: float | None = quantity(None, "1", "Material layers, root mean square error of the worst.", (0, 1))
    labels: float | None = quantity(None, "1", "Share of the pulses of another class.", (0, 1))
    density: float | None = quantity(None, "1", "Share of the points that are missing or too many.", (0, 1))

    @model_validator(mode="before")
    @classmethod
    def _read_units(cls, data: Any) -> Any:
        """Return data whose texts, such as "5mm", are numbers in SI units."""
        if isinstance(data, str):
            data = parse_tolerance(data, "tolerance")
        if not isinstance(data, dict):
            return data
        return {key: _in_si(key, value) if isinstance(value, str) else value for key, value in data.items()}

    def limits(self) -> dict[str, float]:
        """Return the largest allowed error of each kind that is limited, in SI units, by the kind's name."""
        return {name: value for name in KINDS if (value := getattr(self, name)) is not None}


def _in_si(name: str, text: str) -> float | str:
    """Return the number of a text such as ``5mm`` in SI units; an unknown kind's text stays, and is refused later."""
    if name not in KINDS:
        return text
    try:
        return with_unit(f"tolerance.{name}", text, KINDS[name].units)
    except InputError as error:
        raise ValueError(f"{name} {error.allowed}") from None


def with_unit(field: str, text: str, units: dict[str, float]) -> float:
    """Return the number of a text with a unit, such as ``5mm``, in the unit whose factor is 1.

    Raises:
        InputError: it is no number, or lacks a unit where it needs one, or has another.
    """
    match = _NUMBER.fullmatch(text)
    unit_names = [unit for unit in units if unit]
    allowed = f"a number with a unit of {', '.join(unit_names)}" if unit_names else "a number without a unit"
    if "" in units and unit_names:
        allowed = f"a number, or one with a unit of {', '.join(unit_names)}"
    if not match:
        raise InputError(field, text, f"must be {allowed}")
    number, unit = match.groups()
    if unit not in units:
        fault = f"has the unit '{unit}'" if unit else "has no unit"
        raise InputError(field, text, f"{fault}: must be {allowed}{nearest_name(unit, unit_names) if unit else ''}")
    # As a decimal, so that 5mm is the number that 0.005 is.
    return float(f"{float(number) * units[unit]:.15g}")


def parse_tolerance(text: str, field: str = "--tolerance") -> dict[str, float]:
    """Return the data of a `Tolerance`, in SI units, from a text such as ``height=5mm,intensity=5%``.

    Raises:
        InputError: a kind that there isn't, or one named twice; a number or a unit is wrong, or a limit is exceeded.

    Example:
        >>> parse_tolerance("height=5mm,intensity=5%")
        {'height': 0.005, 'intensity': 0.05}
    """
    data: dict[str, float] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name or not value:
            raise InputError(field, text, "must be KIND=VALUE, more of them with commas, e.g. height=5mm,intensity=5%")
        if name not in KINDS:
            raise InputError(field, name, f"must be any of {', '.join(KINDS)}{nearest_name(name, KINDS)}")
        if name in data:
            raise InputError(field, text, f"names {name} twice")
        data[name] = with_unit(f"{field}: {name}", value, KINDS[name].units)
    Tolerance.from_dict(data, field)
    return data


def error_text(name: str, value: float) -> str:
    """Return an error of a kind in the unit that its tolerance is usually given in: ``5 mm``, ``2 %``."""
    kind = KINDS[name]
    return f"{value / kind.factor:.3g}{kind.suffix}"
