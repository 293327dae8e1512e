"""Values of OpenStreetMap's tags as numbers: lanes, widths, speeds, directions (wiki.openstreetmap.org, "Key:...")."""

from __future__ import annotations

import re
from collections.abc import Mapping

FOOT, INCH, MILE = 0.3048, 0.0254, 1609.344
"""Lengths in metres."""
_NUMBER = r"\d{1,6}(?:[.,]\d{1,6})?"
_METRES = re.compile(rf"({_NUMBER})\s*(m|cm|km|ft|feet|')?")
_FEET_INCHES = re.compile(rf"({_NUMBER})\s*'\s*({_NUMBER})\s*(?:\"|'')")
_SPEED = re.compile(rf"({_NUMBER})\s*(km/h|kmh|kph|mph|knots)?")
_UNITS = {None: 1.0, "m": 1.0, "cm": 0.01, "km": 1000.0, "ft": FOOT, "feet": FOOT, "'": FOOT}
_PER_HOUR = {None: 1.0, "km/h": 1.0, "kmh": 1.0, "kph": 1.0, "mph": MILE / 1000.0, "knots": 1.852}
_SPEED_WORDS = {"walk": 7.0, "urban": 50.0, "rural": 100.0, "nsl_single": 60.0 * MILE / 1000.0}
_SPEED_WORDS |= {"nsl_dual": 70.0 * MILE / 1000.0, "nsl_restricted": 30.0 * MILE / 1000.0, "living_street": 7.0}
"""Speed limits that words such as ``DE:urban`` stand for in most countries, km/h; a remark says so. ``motorway`` is
missing, as its limit differs from country to country, and Germany has none."""
_YES = frozenset({"yes", "true", "1"})
DRIVEN = frozenset(
    {"motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential", "living_street"}
    | {"service", "road", "motorway_link", "trunk_link", "primary_link", "secondary_link", "tertiary_link"}
)
"""Values of ``highway`` that are roads for vehicles and built."""


def driving_direction(tags: Mapping[str, str]) -> int:
    """Return 1 where traffic runs only in the order of a way's nodes, -1 where only against it, 0 where both ways.

    Motorways and roundabouts are driven one way where they don't say otherwise.
    """
    word = tags.get("oneway", "").strip().lower()
    if word in ("-1", "reverse"):
        return -1
    if word in _YES:
        return 1
    implied = tags.get("highway") == "motorway" or tags.get("junction") in ("roundabout", "circular")
    return 1 if not word and implied else 0


def lanes_each_way(tags: Mapping[str, str]) -> tuple[int | None, str | None]:
    """Return the number of lanes of one direction by a way's tags, None if they don't say it, and a remark or None.

    ``lanes`` counts both directions, except on a way that is driven in one.
    """
    total_lanes = _whole(tags.get("lanes"))
    if driving_direction(tags):
        if total_lanes is None and "lanes" in tags:
            return None, f"lanes={tags['lanes'][:40]!r} is no number"
        return total_lanes, None
    forward_lanes, backward_lanes = _whole(tags.get("lanes:forward")), _whole(tags.get("lanes:backward"))
    if forward_lanes and backward_lanes:
        remark = (
            f"{forward_lanes} lanes ahead and {backward_lanes} back: the same number is taken"
            if forward_lanes != backward_lanes
            else None
        )
        return max(forward_lanes, backward_lanes), remark
    if total_lanes is None:
        return None, f"lanes={tags['lanes'][:40]!r} is no number" if "lanes" in tags else None
    if total_lanes % 2:
        remark = f"{total_lanes} lanes in both directions together: {(total_lanes + 1) // 2} each way are taken"
        return (total_lanes + 1) // 2, remark
    return total_lanes // 2, None


def _whole(text: str | None) -> int | None:
    """Return the whole number, 1 to 20, of a text; None for any other."""
    value = (text or "").strip()
    return int(value) if value.isascii() and value.isdecimal() and len(value) < 3 and 1 <= int(value) <= 20 else None


def metres(text: str | None) -> float | None:
    """Return a length in metres: ``3.5``, ``3.5 m``, ``12 ft``, ``12'6"``; None for any other text."""
    word = (text or "").strip().lower()
    if match := _FEET_INCHES.fullmatch(word):
        return _number(match[1]) * FOOT + _number(match[2]) * INCH
    match = _METRES.fullmatch(word)
    return _number(match[1]) * _UNITS[match[2]] if match else None


def kilometres_per_hour(text: str | None) -> tuple[float | None, str | None]:
    """Return a speed in km/h, None for a text without one, and a remark where a word was read as a speed.

    ``100``, ``65 mph``, ``DE:urban``, ``none`` (no limit), ``signals``, ``variable``.
    """
    word = (text or "").strip().lower()
    if match := _SPEED.fullmatch(word):
        return _number(match[1]) * _PER_HOUR[match[2]], None
    if (speed := _SPEED_WORDS.get(word.rpartition(":")[2])) is not None:
        return speed, f"maxspeed={word[:40]!r} is read as {speed:g} km/h"
    return None, None


def _number(text: str) -> float:
    """Return the number that a text with a decimal point or comma is."""
    return float(text.replace(",", "."))
