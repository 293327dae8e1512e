"""The list of what became of a file: read, approximated, left out; with the places."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from ..xml_text import on_one_line

_SHOWN = 5
"""Stretches that a line for people names."""
_LONGEST = 300
"""Characters of a kind, and of a reason, which may hold words of the file."""


@dataclass
class Loss:
    """A list of what became of the parts of a file's road.

    Attributes:
        read: numbers of what was taken over, by kind.
        approximated: rows of kind, reason, largest deviation (m) and its station (m).
        left_out: numbers of what was left out, by kind and reason.
        stretches: stations (m) from and to which something of that kind and reason was left out.
        surface: whether some of the road's surface was left out, or is more than 1 mm off.
    """

    read: Counter[str] = field(default_factory=Counter)
    approximated: list[dict[str, Any]] = field(default_factory=list)
    left_out: Counter[tuple[str, str]] = field(default_factory=Counter)
    stretches: dict[tuple[str, str], list[tuple[float, float]]] = field(default_factory=dict)
    surface: bool = False

    def approximate(self, kind: str, why: str, deviation: float = 0.0, station: float | None = None) -> None:
        """Add what was approximated, by how much (m) and where (m); of rows of one kind and reason the worst stays."""
        kind, why = _shown(kind), _shown(why)
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

    def leave_out(
        self,
        kind: str,
        why: str,
        count: int = 1,
        surface: bool = False,
        stretch: tuple[float, float] | None = None,
    ) -> None:
        """Add what was left out, whether it was surface, and the stretch (stations of the set, m) on which it was."""
        key = _shown(kind), _shown(why)
        self.left_out[key] += count
        if stretch is not None:
            self.stretches.setdefault(key, []).append((round(stretch[0], 3), round(stretch[1], 3)))
        self.surface |= surface

    def to_dict(self) -> dict[str, Any]:
        """Return the list as JSON data."""
        return {
            "read": dict(sorted(self.read.items())),
            "approximated": self.approximated,
            "left_out": [
                {"kind": key[0], "count": count, "why": key[1]}
                | ({"stretches": [list(one) for one in self.stretches[key]]} if key in self.stretches else {})
                for key, count in sorted(self.left_out.items())
            ],
            "surface_lost": self.surface,
        }

    def lines(self) -> list[str]:
        """Return the list as lines of text for people."""
        sentences = [f"read: {', '.join(f'{count} {kind}' for kind, count in sorted(self.read.items()))}"]
        for row in self.approximated:
            deviation = f", within {1000.0 * row['deviation']:.2f} mm" if row["deviation"] else ""
            place = f" (worst at station {row['station']:.1f} m)" if "station" in row else ""
            sentences.append(f"approximated: {row['kind']}: {row['why']}{deviation}{place}")
        for (kind, reason), count in sorted(self.left_out.items()):
            stretches = self.stretches.get((kind, reason), [])
            named_stretches = ", ".join(f"{start:.1f} to {end:.1f} m" for start, end in stretches[:_SHOWN])
            more = f" and {len(stretches) - _SHOWN} more" if len(stretches) > _SHOWN else ""
            sentences.append(
                f"left out: {count} {kind}: {reason}"
                + (f" (stations {named_stretches}{more})" if named_stretches else "")
            )
        return sentences


def _shown(text: str) -> str:
    """Return a text, which may hold words of a file, on one line and at most 300 characters long."""
    return on_one_line(text)[:_LONGEST]
