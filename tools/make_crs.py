"""Write `synthroads_addon/presets/crs.json`: WKT of the coordinate systems that are usual for roads in Europe.

Usage: python tools/make_crs.py   (needs pyproj)
"""

from __future__ import annotations

import json
from pathlib import Path

from pyproj import CRS

CODES = [25828 + zone for zone in range(11)] + [32628 + zone for zone in range(11)] + [31466, 31467, 31468, 31469]
CODES += [5554, 5555, 5556, 2056, 31287, 2154, 28992, 3857]

if __name__ == "__main__":
    table = {str(code): CRS.from_epsg(code).to_wkt("WKT1_GDAL") for code in CODES}
    target = Path(__file__).parents[1] / "synthroads_addon" / "presets" / "crs.json"
    target.write_text(json.dumps(table, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
