"""GeoPackage: everything of a road that has a place, in layers by kind with fields and QGIS styles.

pyogrio writes it, by GDAL: OGC 12-128r18 is a schema of SQLite with its own geometry encoding, index and tables of
systems. Styles are rows of the table ``layer_styles``, which QGIS looks for.
"""

from __future__ import annotations

import json
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import AnyArray
from ..road.geometry import RoadGeometry
from ..road.parameters import RoadParameters
from .features import LEVEL, LOST, Feature, RoadFeatures
from .surfaces import road_stations
from .trace import Trace

_NO_DATE = "2000-01-01T00:00:00.000Z"
"""Time of the last change that every file has: the same road gives the same bytes on any day."""
_LITTLE_ENDIAN = 1
_CODES = {"Point": 1001, "LineString": 1002, "Polygon": 1003, "MultiLineString": 1005, "MultiPolygon": 1006}
"""Codes of geometries with heights (ISO 19125 well-known binary)."""
_AREAS = ("Polygon", "MultiPolygon")
_SUFFIXES = {"MultiPolygon": "_area"}
"""Ending added to the name of a layer whose features have geometries of several kinds."""
_FIRST = ("id", "instance", "object_type")
"""Fields that every layer begins with."""
_COLORS = {
    "centerline": "#d7191c",
    "lane": "#2b83ba",
    "lane_boundary": "#9ecae1",
    "marking": "#ff9f1c",
    "marking_area": "#ff9f1c",
    "paved_edge": "#4d4d4d",
    "road_edge": "#4d4d4d",
    "plant": "#48943e",
    "vehicle": "#3cdcdc",
    "median": "#a6d96a",
    "patch": "#8c510a",
    "crack": "#c51b7d",
    "pothole": "#c51b7d",
    "rut": "#8c510a",
}
"""Colours of layers; of others `_OTHER_COLOR`."""
_OTHER_COLOR = "#7b3294"
_STYLE_TABLE = """CREATE TABLE layer_styles (id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT(256),
f_table_schema TEXT(256), f_table_name TEXT(256), f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT,
styleSLD TEXT, useAsDefault BOOLEAN, description TEXT(4000), owner TEXT(30), ui TEXT(30), update_time DATETIME)"""
"""Table as QGIS makes it (qgsgeopackageprovider)."""
Column = tuple[AnyArray, AnyArray]
"""Values of a field, and a mask of those that are missing."""


def write_geopackage(parameters: RoadParameters, path: Path, tolerance: float) -> Trace:
    """Write a road's lines, areas and places as a GeoPackage; return the trace of what became of each object.

    Coordinates are map coordinates with heights, as in GeoJSON. Lists, such as the stations of a line's points, are
    JSON in a field of text.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error of curved lines, m, > 0.

    Raises:
        ImportError: pyogrio isn't installed.
    """
    geometry = RoadGeometry(parameters)
    stations = road_stations(geometry, tolerance)
    damages = {"rut", "pothole", "patch", "crack", "removed"}
    lost = {name: reason for name, reason in LOST.items() if name not in damages}
    trace = Trace(geometry, LEVEL, ("dash",), lost)
    source = RoadFeatures(geometry, stations, tolerance, trace)
    layers: dict[tuple[str, str], list[Feature]] = {}
    for feature in (source.axis(), *source.features(), *source.damages()):
        layers.setdefault((_layer_name(feature), feature["geometry"]["type"]), []).append(feature)
    kinds_by_name: dict[str, set[str]] = {}
    for name, kind in layers:
        kinds_by_name.setdefault(name, set()).add(kind)
    path.unlink(missing_ok=True)
    names = []
    with _dated():
        for (name, kind), features in layers.items():
            table = name + (_SUFFIXES.get(kind, "") if len(kinds_by_name[name]) > 1 else "")
            _write_layer(path, table, kind, features, parameters.metadata.system.to_wkt())
            names.append((table, kind))
            for number, feature in enumerate(features, 1):
                trace.record_entity(feature["properties"]["instance"], layer=table, fid=number)
    _write_styles(path, names)
    return trace


@contextmanager
def _dated() -> Iterator[None]:
    """Return a context in which GDAL dates files by `_NO_DATE` and raises OSError where it can't write."""
    import pyogrio.errors  # an optional package

    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": _NO_DATE})
    try:
        yield
    except pyogrio.errors.DataSourceError as problem:
        raise OSError(f"GDAL can't write it: {problem}") from None
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": before})


def _layer_name(feature: Feature) -> str:
    """Return the layer that a feature belongs to: its kind, and of things their type, in small letters."""
    properties = feature["properties"]
    if properties["feature"] != "furniture":
        return str(properties["feature"])
    words = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in properties["object_type"])
    return words.strip("_")


def _write_layer(path: Path, table: str, kind: str, features: list[Feature], system: str) -> None:
    """Write features, all with geometries of one kind, as a layer of the file, in a system given as WKT."""
    import pyogrio.raw  # an optional package

    geometry = np.array([_binary(kind, feature["geometry"]["coordinates"]) for feature in features], dtype=object)
    rows = [feature["properties"] for feature in features]
    names = list(dict.fromkeys([*_FIRST, *(name for row in rows for name in row if name != "feature")]))
    fields = [_column([row.get(name) for row in rows]) for name in names]
    pyogrio.raw.write(
        str(path),
        geometry,
        [values for values, _ in fields],
        names,
        field_mask=[missing for _, missing in fields],
        layer=table,
        driver="GPKG",
        geometry_type=f"{kind} Z",
        crs=system,
        append=path.exists(),
        layer_options={"GEOMETRY_NAME": "geom", "FID": "fid"},
    )


def _column(values: list[Any]) -> Column:
    """Return a field's values (N,) as integers, numbers, truths or text, and a mask (N,) of the missing ones."""
    missing = np.array([value is None for value in values])
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {bool}:
        return np.array([bool(value) for value in values]), missing
    if kinds <= {int}:
        return np.array([value or 0 for value in values], dtype=np.int64), missing
    if kinds <= {int, float}:
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64), missing
    texts = [value if isinstance(value, str | None) else json.dumps(value) for value in values]
    return np.array(texts, dtype=object), missing


def _binary(kind: str, coordinates: Any) -> bytes:
    """Return a geometry with heights as well-known binary; coordinates as GeoJSON has them."""
    head = struct.pack("<BI", _LITTLE_ENDIAN, _CODES[kind])
    if kind == "Point":
        return head + struct.pack("<3d", *coordinates)
    if kind == "LineString":
        return head + _run(coordinates)
    count = struct.pack("<I", len(coordinates))
    if kind == "Polygon":
        return head + count + b"".join(map(_run, coordinates))
    return head + count + b"".join(_binary(kind.removeprefix("Multi"), part) for part in coordinates)


def _run(points: Any) -> bytes:
    """Return points (N, 3) with their number before them."""
    return struct.pack("<I", len(points)) + np.asarray(points, dtype="<f8").tobytes()


def _write_styles(path: Path, layers: list[tuple[str, str]]) -> None:
    """Write a style for each layer (name, kind of geometry), with which QGIS shows it."""
    row = ("", "", "geom", "SynthRoads", None, 1, "", "", None, _NO_DATE)
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(_STYLE_TABLE)
        database.executemany(
            "INSERT INTO layer_styles (f_table_name, styleQML, f_table_catalog, f_table_schema, f_geometry_column,"
            " styleName, styleSLD, useAsDefault, description, owner, ui, update_time)"
            " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            [(table, _style(table, kind), *row) for table, kind in layers],
        )
        database.execute(
            "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, last_change)"
            " VALUES ('layer_styles', 'attributes', 'layer_styles', '', ?)",
            (_NO_DATE,),
        )


def _style(table: str, kind: str) -> str:
    """Return a layer's style as QGIS's XML: one symbol of a colour."""
    color = _COLORS.get(table, _OTHER_COLOR)
    if kind == "Point":
        symbol, layer, options = "marker", "SimpleMarker", {"color": color, "name": "circle", "size": "1.8"}
    elif kind in _AREAS:
        symbol, layer, options = "fill", "SimpleFill", {"color": color, "outline_style": "no"}
    else:
        symbol, layer, options = "line", "SimpleLine", {"line_color": color, "line_width": "0.3"}
    option_rows = "".join(f'<Option type="QString" name="{name}" value="{value}"/>' for name, value in options.items())
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>"
        '<qgis version="3.34" styleCategories="Symbology"><renderer-v2 type="singleSymbol" symbollevels="0">'
        f'<symbols><symbol type="{symbol}" name="0" alpha="1"><layer class="{layer}" enabled="1" pass="0">'
        f'<Option type="Map">{option_rows}</Option></layer></symbol></symbols></renderer-v2></qgis>'
    )
