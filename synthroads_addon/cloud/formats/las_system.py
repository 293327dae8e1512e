"""The coordinate system that a LAS file declares: as WKT, before or behind its points, or by GeoTIFF keys."""

import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import laspy

from ...base.errors import InputError
from ...base.maps.crs import MapSystem
from .header import system_of_text

_USER, _WKT = "LASF_Projection", 2112
_LONGEST = 1 << 20
"""Bytes of WKT behind the points that are looked at."""
_MODEL, _GEOGRAPHIC, _PROJECTED, _PROJECTED_CITATION = 1024, 2048, 3072, 3073
_PLAN_UNIT, _PLAN_UNIT_SIZE, _VERTICAL, _HEIGHT_UNIT = 3076, 3077, 4096, 4099
_OWN = 32_767
"""Value of a key whose system or unit is described by other keys."""
_MODELS = {2: "geographic", 3: "geocentric"}
_UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0, 9036: 1000.0}
"""EPSG codes of units of length -> m."""
_FORMER_VERTICAL = range(5101, 5113)
"""Codes of vertical systems in GeoTIFF 1.0, 600 less than today's: 5103 is NAVD88, now 5703."""


def declared_system(path: Path, las: laspy.LasHeader) -> tuple[MapSystem | None, list[str]]:
    """Return the system that a LAS file declares, None if it declares none, and remarks on it for the user.

    Where WKT and GeoTIFF keys name different systems, the header's flag says which one counts.

    Raises:
        InputError: its coordinates aren't those of a map: longitudes and latitudes, say.
    """
    text, keys = _wkt(path, las), _GeoKeys(path, las)
    text_system, notes = system_of_text(text)
    if not keys.values:
        return text_system, notes
    key_system = keys.system(notes)
    if text_system is None or key_system is None:
        return text_system or key_system, notes
    if text_system.label != key_system.label and key_system.epsg and text_system.epsg != key_system.epsg:
        used_system, ignored_system = (
            (text_system, key_system) if las.global_encoding.wkt else (key_system, text_system)
        )
        notes.append(f"it names two coordinate systems: {used_system.label} is used, {ignored_system.label} is ignored")
        return used_system, notes
    if text_system.height_unit is None and key_system.height_unit is not None:
        return (key_system if text_system.same_as(key_system) else text_system), notes
    return text_system, notes


def _wkt(path: Path, las: laspy.LasHeader) -> str:
    """Return the WKT in the records before or behind the points; empty if there is none."""
    texts = [record.string.strip("\0 ") for record in las.vlrs.get("WktCoordinateSystemVlr")]
    return next((text for text in texts if text), "") or _wkt_behind(path, las)


def _wkt_behind(path: Path, las: laspy.LasHeader) -> str:
    """Return the WKT of the extended records (EVLRs), read without laspy, which trusts their sizes."""
    offset, size = las.start_of_first_evlr or 0, path.stat().st_size
    with path.open("rb") as file:
        for _ in range(min(las.number_of_evlrs or 0, 10_000)):
            if offset + 60 > size:
                break
            file.seek(offset)
            user, number, length = struct.unpack("<2x16sHQ", file.read(28))
            if user.rstrip(b"\0").decode("ascii", "replace") == _USER and number == _WKT:
                file.seek(offset + 60)
                return file.read(min(length, _LONGEST)).decode("utf-8", "replace").strip("\0 ")
            offset += 60 + length
    return ""


class _GeoKeys:
    """The GeoTIFF keys of a LAS file, by their numbers; without any there is no system."""

    def __init__(self, path: Path, las: laspy.LasHeader) -> None:
        self._path = path
        doubles = [
            float(getattr(value, "value", value))
            for record in las.vlrs.get("GeoDoubleParamsVlr")
            for value in record.doubles
        ]
        texts = "".join(text for record in las.vlrs.get("GeoAsciiParamsVlr") for text in record.strings)
        self.values: dict[int, Any] = {}
        for record in las.vlrs.get("GeoKeyDirectoryVlr"):
            for key in record.geo_keys:
                offset = int(key.value_offset)
                if key.tiff_tag_location == 0:
                    self.values[key.id] = offset
                elif key.tiff_tag_location == 34736 and offset < len(doubles):
                    self.values[key.id] = doubles[offset]
                elif key.tiff_tag_location == 34737:
                    self.values[key.id] = texts[offset : offset + int(key.count)].strip("| \0")

    def system(self, notes: list[str]) -> MapSystem | None:
        """Return the system that the keys name, with the units that they name; None if they name none.

        Args:
            notes: remarks for the user; those on the keys are added, in place.

        Raises:
            InputError: its coordinates are degrees, or distances from the Earth's centre.
        """
        projected, model = self.values.get(_PROJECTED), self.values.get(_MODEL)
        if projected is None and model not in _MODELS and _GEOGRAPHIC in self.values:
            model = 2
        if model in _MODELS:
            return self._no_map(_MODELS[model])
        unit, height_unit = self._unit(_PLAN_UNIT, notes), self._unit(_HEIGHT_UNIT, notes)
        system = self._projected(projected, notes)
        if system is None:
            if unit is None and height_unit is None:
                return None
            return self._nameless(unit or 1.0, height_unit)
        system = self._with_heights(system, notes)
        return system if unit is None and height_unit is None else system.with_units(unit, height_unit)

    def _no_map(self, model: str) -> MapSystem:
        """Raise `InputError` for coordinates of a model that is no map."""
        code = self.values.get(_GEOGRAPHIC)
        model_text = f"{model}, EPSG:{code}" if code and code != _OWN else model
        unit = "degrees" if model == "geographic" else "distances from the Earth's centre"
        requirement = f"its coordinates are {unit}: metres or feet of a projected system are needed"
        raise InputError(f"{self._path}: coordinate system", model_text, requirement)

    def _projected(self, code: Any, notes: list[str]) -> MapSystem | None:
        """Return the projected system of a code; None without a code, or for an unknown one, which is noted."""
        if code is None:
            return None
        try:
            return MapSystem.of(int(code)) if code != _OWN else None
        except InputError:
            notes.append(f"its coordinate system EPSG:{code} is unknown: it is ignored")
        return None

    def _nameless(self, unit: float, height_unit: float | None) -> MapSystem:
        """Return a local system that only units are known of, m."""
        title = str(self.values.get(_PROJECTED_CITATION) or "unnamed").replace('"', "'")
        system = MapSystem.read(f'LOCAL_CS["{title}",UNIT["unit",{unit!r}],AXIS["X",EAST],AXIS["Y",NORTH]]')
        return system if height_unit is None else replace(system, height_unit=height_unit)

    def _with_heights(self, system: MapSystem, notes: list[str]) -> MapSystem:
        """Return a horizontal system with the vertical one that the keys name."""
        code = self.values.get(_VERTICAL)
        if not isinstance(code, int) or not 0 < code < _OWN or system.epsg is None:
            return system
        for candidate in (code, code + 600 if code in _FORMER_VERTICAL else code):
            try:
                return MapSystem.of(system.epsg, candidate)
            except InputError:
                continue
        notes.append(f"its vertical coordinate system {code} is unknown: it is ignored")
        return system

    def _unit(self, key: int, notes: list[str]) -> float | None:
        """Return the unit, m, that a key names; None if it names none that is known."""
        code = self.values.get(key)
        if code is None or code == 0:
            return None
        size = self.values.get(_PLAN_UNIT_SIZE) if key == _PLAN_UNIT and code == _OWN else _UNITS.get(code)
        if isinstance(size, float) and 0.0 < size < 1e6:
            return size
        notes.append(f"its unit with the code {code} is unknown: it is ignored")
        return None
