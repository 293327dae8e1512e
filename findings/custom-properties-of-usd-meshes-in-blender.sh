#!/bin/bash
# Blender's USD importer puts `userProperties` of a Mesh prim onto the mesh datablock: the object has none of them.
# Those of an Xform above a single Mesh reach the object, which is then named after the Mesh, not after the Xform. So a
# label that each thing of a scene has as a user property is found in two places, by the form of its prims alone;
# Blender's own exporter writes it on the Xform. Reading both places, the datablock's after the object's, finds all.
# Seen with bpy 4.5.15 (and 5.2.3), wm.usd_import with its default options.
# Guess before: a prim's user properties become custom properties of the object that the prim becomes.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "bpy==4.5.15" "numpy<2"
cat > "$folder/scene.usda" <<'USD'
#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "world"
{
    def Mesh "sign"
    {
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
        custom int userProperties:label = 7
    }
    def Xform "pole"
    {
        custom int userProperties:label = 9
        def Mesh "shape"
        {
            int[] faceVertexCounts = [3]
            int[] faceVertexIndices = [0, 1, 2]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
        }
    }
}
USD
cat > "$folder/read.py" <<'PYTHON'
import os
import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.usd_import(filepath=sys.argv[1])
for item in sorted((i for i in bpy.data.objects if i.type == "MESH"), key=lambda item: item.name):
    print("read:", item.name, "object", item.get("label"), "mesh", item.data.get("label"), flush=True)
os._exit(0)
PYTHON
seen=$("$folder/venv/bin/python" "$folder/read.py" "$folder/scene.usda" | grep "^read:")
echo "$seen"
[ "$seen" = "read: shape object 9 mesh None
read: sign object None mesh 7" ]
