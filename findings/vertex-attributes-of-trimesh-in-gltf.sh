#!/bin/bash
# trimesh writes a mesh's vertex attributes whose names begin with an underscore into a .glb, but what comes back depends
# on their type: of one uint8 or uint16 for each vertex it makes vectors of four or two, the value and zeros, as glTF wants
# elements of four bytes and it pads within the element; uint32 and floats come back as they were, doubles as floats; int32
# and int64, NumPy's own integers, end the export in a KeyError that says 'i4' or 'i8' and nothing of the attribute.
# So classes by vertex, usually uint8, are a matrix (N, 4) after a round trip.
# Seen with trimesh 5.2.0, numpy 2.4.6, Python 3.11.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install --quiet --disable-pip-version-check trimesh==5.2.0 numpy==2.4.6
seen=$("$folder/env/bin/python" - "$folder/box.glb" <<'PYTHON'
import sys
import numpy as np
import trimesh

for kind in ("uint8", "uint16", "uint32", "float32", "float64", "int32", "int64"):
    box = trimesh.creation.box()
    box.vertex_attributes["_class"] = np.arange(8).astype(kind)
    try:
        box.export(sys.argv[1])
    except KeyError as error:
        print(kind, "KeyError", error)
        continue
    (mesh,) = trimesh.load(sys.argv[1], process=False).geometry.values()
    values = mesh.vertex_attributes["_class"]
    print(kind, values.dtype, values.shape, values[3].tolist())
PYTHON
)
echo "$seen"
[ "$seen" = "uint8 uint8 (8, 4) [3, 0, 0, 0]
uint16 uint16 (8, 2) [3, 0]
uint32 uint32 (8, 1) [3]
float32 float32 (8, 1) [3.0]
float64 float32 (8, 1) [3.0]
int32 KeyError 'i4'
int64 KeyError 'i8'" ]
