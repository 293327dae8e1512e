#!/bin/bash
# Open3D's common reader (open3d.io.read_point_cloud) makes zeros of coordinates that a binary PCD file stores as
# doubles (TYPE F, SIZE 8): the number of points is right, has_points() is true, nothing is said. The same doubles in a
# PCD file with DATA ascii are kept, and open3d.t.io.read_point_cloud keeps both. Map coordinates of millions of metres
# need doubles, or an offset: a file for all of Open3D has floats less an offset.
# Seen with Open3D 0.20.0 (and 0.19.0 of open3d-cpu), which needs libusb-1.0 to be imported (libusb-package brings it).
# Guess before: the reader keeps doubles, as it does for PLY and for PCD as text.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "open3d==0.20.0" "libusb-package==1.0.26.3"
cat > "$folder/read.py" <<'PYTHON'
import ctypes
import os
import sys

import libusb_package
import numpy as np

ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
import open3d

points = np.array([[294000.25, 5628000.5, 181.0], [294001.25, 5628002.5, 182.0]])


def header(size, storage):
    lines = ["VERSION 0.7", "FIELDS x y z", f"SIZE {size} {size} {size}", "TYPE F F F", "COUNT 1 1 1", "WIDTH 2"]
    lines += ["HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", "POINTS 2", f"DATA {storage}"]
    return ("\n".join(lines) + "\n").encode()


text = "".join(" ".join(map(repr, row.tolist())) + "\n" for row in points).encode()
files = {
    "doubles": header(8, "binary") + points.astype("<f8").tobytes(),
    "floats": header(4, "binary") + (points - points[0]).astype("<f4").tobytes(),
    "text": header(8, "ascii") + text,
}
for name, data in files.items():
    path = f"{sys.argv[1]}/{name}.pcd"
    with open(path, "wb") as file:
        file.write(data)
    common = np.asarray(open3d.io.read_point_cloud(path).points)
    tensor = open3d.t.io.read_point_cloud(path).point.positions.numpy()
    print("read:", name, common[1].tolist(), tensor[1].tolist(), flush=True)
os._exit(0)
PYTHON
seen=$("$folder/venv/bin/python" "$folder/read.py" "$folder" | grep "^read:")
echo "$seen"
[ "$seen" = "read: doubles [0.0, 0.0, 0.0] [294001.25, 5628002.5, 182.0]
read: floats [1.0, 2.0, 1.0] [1.0, 2.0, 1.0]
read: text [294001.25, 5628002.5, 182.0] [294001.25, 5628002.5, 182.0]" ]
