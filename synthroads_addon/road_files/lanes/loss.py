"""The list of what became of a file: read, approximated, left out; with the places."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Loss:
    """A list of what became of the parts of a file's road.

    Attributes:
        read: numbers of what was taken over, by kind.
        approximated: rows of kind, reason, largest deviation (m) and its station (m).
        left_out: numbers of what was left out, by kind and reason.
        surface: whether some of the road's surface was left out, or is more than 1 mm off.
    """

    read: Counter[str] = field(default_factory=Counter)
    approximated: list[dict[str, Any]] = field(default_factory=list)
    left_out: Counter[tuple[str, str]] = field(default_factory=Counter)
    surface: bool = False

    def approximate(self, kind: str, why: str, deviation: float = 0.0, station: float | None = None) -> None:
        """Add what was approximated, by how much (m) and where (m); of one kind and reason the worst is kept."""
        row: dict[str, Any] = {"kind": kind, "why": why, "deviation": round(deviation, 6)}
        if station is not None:
            row["station"] = round(station, 3)
        for other in self.approximated:
            if (other["kind"], other["why"]) == (kind, why):
                count = other.get("count", 1) + 1
                if deviation > other["deviation"]:
                    other.update(row)
                other["count"] = count
                return
        self.approximated.append(row)

    def leave_out(self, kind: str, why: str, count: int = 1, surface: bool = False) -> None:
        """Add what was left out, and whether it was surface."""
        self.left_out[kind, why] += count
        self.surface |= surface

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {
            "read": dict(sorted(self.read.items())),
            "approximated": self.approximated,
            "left_out": [
                {"kind": kind, "count": count, "why": why} for (kind, why), count in sorted(self.left_out.items())
            ],
            "surface_lost": self.surface,
        }

    def lines(self) -> list[str]:
        """Return it as lines for people."""
        found = [f"read: {', '.join(f'{count} {kind}' for kind, count in sorted(self.read.items()))}"]
        for row in self.approximated:
            off = f", within {1000.0 * row['deviation']:.2f} mm" if row["deviation"] else ""
            where = f" (worst at station {row['station']:.1f} m)" if "station" in row else ""
            found.append(f"approximated: {row['kind']}: {row['why']}{off}{where}")
        found += [f"left out: {count} {kind}: {why}" for (kind, why), count in sorted(self.left_out.items())]
        return found
