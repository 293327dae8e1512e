"""One straight road of 400 m as CSV and GeoJSON, in any coordinate system and unit, as other programs export lines."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pyproj import Transformer

from synthroads_addon.base.arrays import Float

HOME = 25832
ALONG = np.linspace(0.0, 400.0, 41)
ROAD: Float = np.column_stack([294_000.0 + 0.8 * ALONG, 5_628_000.0 + 0.6 * ALONG, 180.0 + 0.01 * ALONG])
"""Points (41, 3) in ETRS89 / UTM 32, m."""


def in_system(epsg: int | str, unit: float = 1.0) -> Float:
    """Return the road in another system, heights in a unit (m)."""
    x, y = Transformer.from_crs(HOME, epsg, always_xy=True).transform(ROAD[:, 0], ROAD[:, 1])
    return np.column_stack([x, y, ROAD[:, 2] / unit])


def urn(code: int) -> dict[str, Any]:
    """Return a member ``crs`` that names an EPSG code by its URN."""
    return {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{code}"}}


def named(name: str) -> dict[str, Any]:
    """Return a member ``crs`` that names a system in any words."""
    return {"type": "name", "properties": {"name": name}}


def geojson(points: Float, crs: object = None, where: str = "collection") -> Callable[[Path], Path]:
    """Return what writes points as a collection of one line, with a ``crs`` at one of its levels."""
    geometry: dict[str, Any] = {"type": "LineString", "coordinates": points.tolist()}
    feature: dict[str, Any] = {"type": "Feature", "properties": {}, "geometry": geometry}
    document: dict[str, Any] = {"type": "FeatureCollection", "features": [feature]}
    level = {"collection": document, "feature": feature, "geometry": geometry}[where]
    if crs is not None:
        level["crs"] = crs

    def write(folder: Path) -> Path:
        path = folder / "axis.geojson"
        path.write_text(json.dumps(document))
        return path

    return write


def csv(points: Float, head: str = "x,y,z", prj: str = "", digits: int = 3) -> Callable[[Path], Path]:
    """Return what writes points as CSV, with lines above them and perhaps a .prj beside."""
    lines = [",".join(f"{value:.{digits}f}" for value in row) for row in points.tolist()]

    def write(folder: Path) -> Path:
        path = folder / "axis.csv"
        path.write_text("\n".join([*([head] if head else []), *lines]) + "\n")
        if prj:
            path.with_suffix(".prj").write_text(prj)
        return path

    return write


def lines(text: str) -> Callable[[Path], Path]:
    """Return what writes a text as CSV."""

    def write(folder: Path) -> Path:
        path = folder / "axis.csv"
        path.write_text(text)
        return path

    return write
