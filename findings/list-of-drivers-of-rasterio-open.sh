#!/bin/bash
# rasterio.open documents its argument driver as "a short format driver name or a list of such names", which is how a
# program would keep an elevation model from being opened by any other of GDAL's formats. A list, or a tuple, raises
# TypeError "invalid driver", also with one name in it; the class that open returns, rasterio.DatasetReader, takes the
# same list, and refuses with RasterioIOError a file that none of its formats opens.
# Seen with rasterio 1.4.4 (GDAL 3.10.3).
# Guess before: open takes the list that its documentation names.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "rasterio==1.4.4" "numpy==1.26.4"
cat > "$folder/open.py" <<'PYTHON'
import sys

import numpy as np
import rasterio
from rasterio.transform import from_origin

assert "or a list of" in rasterio.open.__doc__
path = sys.argv[1] + "/heights.tif"
profile = {"driver": "GTiff", "width": 2, "height": 2, "count": 1, "dtype": "float32"}
with rasterio.open(path, "w", **profile, transform=from_origin(0.0, 2.0, 1.0, 1.0)) as file:
    file.write(np.ones((1, 2, 2), np.float32))


def outcome(call, drivers):
    """Return which format opened the file, or the error's type."""
    try:
        with call(path, driver=drivers) as file:
            return file.driver
    except (TypeError, rasterio.errors.RasterioIOError) as error:
        return type(error).__name__


for drivers in ("GTiff", ["GTiff"], ["GTiff", "PNG"], ["PNG"]):
    print(drivers, "open:", outcome(rasterio.open, drivers), "DatasetReader:", outcome(rasterio.DatasetReader, drivers))
PYTHON
seen=$("$folder/venv/bin/python" "$folder/open.py" "$folder")
echo "$seen"
[ "$seen" = "GTiff open: GTiff DatasetReader: GTiff
['GTiff'] open: TypeError DatasetReader: GTiff
['GTiff', 'PNG'] open: TypeError DatasetReader: GTiff
['PNG'] open: TypeError DatasetReader: RasterioIOError" ]
