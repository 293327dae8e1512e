#!/bin/bash
# A LAS file of Sweden, Poland, New Zealand or of the European grid loses its code, and one of Germany gets another, as
# soon as its coordinate system was written as WKT 1 in GDAL's dialect, which is what LAS files carry. These systems
# name the northing first, which that dialect can't say; the WKT still ends in AUTHORITY["EPSG",...], but pyproj looks
# the system up by what it is, and then finds none, or the twin with the easting first: Gauss-Kruger zone 3 (31467)
# becomes 5677. WKT 2 and ESRI's WKT of the same systems keep the code. CRS.equals with ignore_axis_order says False.
# Seen with pyproj 3.7.2 (PROJ 9.5.1). Guess before: to_epsg() returns the code that the WKT itself names.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "pyproj==3.7.2"
seen=$("$folder/venv/bin/python" - <<'PYTHON'
from pyproj import CRS

for code in (25832, 2056, 31467, 3006, 2180, 2193, 3035):
    system = CRS.from_epsg(code)
    written = system.to_wkt("WKT1_GDAL")
    again = CRS.from_wkt(written)
    named = f'AUTHORITY["EPSG","{code}"]]' in written[-40:]
    others = [CRS.from_wkt(system.to_wkt(form)).to_epsg() for form in ("WKT1_ESRI", "WKT2_2019")]
    print(code, named, again.to_epsg(), again.equals(system, ignore_axis_order=True), *others)
PYTHON
)
echo "$seen"
[ "$seen" = "25832 True 25832 True 25832 25832
2056 True 2056 True 2056 2056
31467 True 5677 False 31467 31467
3006 True None False 3006 3006
2180 True None False 2180 2180
2193 True None False 2193 2193
3035 True None False 3035 3035" ]
