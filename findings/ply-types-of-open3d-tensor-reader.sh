#!/bin/bash
# Open3D's tensor reader of PLY (open3d.t.io.read_point_cloud) keeps a point's further properties only where their type
# is called uchar, uint8, uint16, int, int32, float, float32 or double. The same two bytes are kept as "uint16" and left
# out as "ushort"; "uint", "uint32", "short", "int16" and "char", numbers of instances or strips for example, are left
# out with a warning on the console, and the call returns as if all were well. PLY's own names are the older ones.
# Seen with Open3D 0.20.0, which also needs libusb-1.0 to be imported at all: pip doesn't bring it (libusb-package does).
# Guess before: every type of PLY is kept under either name.
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

TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "<i2", "int16": "<i2", "ushort": "<u2"}
TYPES |= {"uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4"}
TYPES |= {"float": "<f4", "float32": "<f4", "double": "<f8"}
header = "ply\nformat binary_little_endian 1.0\nelement vertex 2\n"
header += "".join(f"property double {axis}\n" for axis in "xyz")
header += "".join(f"property {name} of_{name}\n" for name in TYPES) + "end_header\n"
points = np.zeros(2, [(axis, "<f8") for axis in "xyz"] + [(f"of_{name}", kind) for name, kind in TYPES.items()])
for name in TYPES:
    points[f"of_{name}"] = (1, 2)
path = sys.argv[1] + "/points.ply"
with open(path, "wb") as file:
    file.write(header.encode() + points.tobytes())
cloud = open3d.t.io.read_point_cloud(path)
kept = [name for name in TYPES if f"of_{name}" in cloud.point]
assert all(cloud.point[f"of_{name}"].numpy().ravel().tolist() == [1, 2] for name in kept)
print(open3d.__version__, "keeps", *kept)
print("leaves out", *(name for name in TYPES if name not in kept), flush=True)
os._exit(0)
PYTHON
seen=$("$folder/venv/bin/python" "$folder/read.py" "$folder" | grep -E "^(0|leaves)")
echo "$seen"
[ "$seen" = "0.20.0 keeps uchar uint8 uint16 int int32 float float32 double
leaves out char int8 short int16 ushort uint uint32" ]
