#!/bin/bash
# nuScenes' own reader (nuscenes-devkit, NuScenes(...)) can't read two kinds of data sets in nuScenes' form:
# - with a table lidarseg.json, categories of any name but nuScenes' own end it with KeyError('pavement'): colours of
#   classes come from a fixed table of names, although category.json names the classes and their indices.
# - with an empty table map.json it ends with IndexError: list index out of range; it looks at the first map's keys.
# So classes of one's own can't be read as lidarseg, and a set without a map needs a made-up one (a picture of a pixel).
# Seen with nuscenes-devkit 1.2.0. Guess before: names are free, as the tables say them; a table may have no rows.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "nuscenes-devkit==1.2.0"
cat > "$folder/read.py" <<'PYTHON'
import json
import sys
from importlib.metadata import version
from pathlib import Path

from nuscenes.nuscenes import NuScenes
from PIL import Image

TABLES = ("attribute", "visibility", "instance", "sensor", "calibrated_sensor", "ego_pose", "log", "scene", "sample")
MAP = {"token": "m", "log_tokens": [], "category": "semantic_prior", "filename": "maps/m.png"}


def read(name, categories, **tables):
    """Print how the reader takes a data set without scenes, with these classes of points and other tables."""
    root = Path(sys.argv[1]) / name
    (root / "v1.0-mini").mkdir(parents=True)
    (root / "lidarseg" / "v1.0-mini").mkdir(parents=True)
    (root / "maps").mkdir()
    Image.new("L", (1, 1)).save(root / "maps" / "m.png")
    rows = dict.fromkeys((*TABLES, "sample_data", "sample_annotation"), []) | {"map": [MAP]} | tables
    rows["category"] = [
        {"token": f"c{index}", "name": category, "description": "", "index": index}
        for index, category in enumerate(categories)
    ]
    for table, content in rows.items():
        (root / "v1.0-mini" / f"{table}.json").write_text(json.dumps(content))
    try:
        NuScenes("v1.0-mini", str(root), verbose=False)
        print("read:", name, "loaded")
    except Exception as fault:
        print("read:", name, repr(fault))


print("nuscenes-devkit", version("nuscenes-devkit"))
read("its classes", ["noise", "flat.driveable_surface"], lidarseg=[])
read("own classes", ["noise", "pavement"], lidarseg=[])
read("own classes without lidarseg", ["noise", "pavement"])
read("no map", ["noise"], map=[])
PYTHON
seen=$("$folder/venv/bin/python" -W ignore "$folder/read.py" "$folder" | tee /dev/stderr | grep "^read:")
[ "$seen" = "read: its classes loaded
read: own classes KeyError('pavement')
read: own classes without lidarseg loaded
read: no map IndexError('list index out of range')" ]
