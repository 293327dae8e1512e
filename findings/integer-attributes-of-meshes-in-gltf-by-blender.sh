#!/bin/bash
# Blender's glTF exporter writes every attribute of a mesh whose name begins with an underscore as single-precision
# floats, also integers, and its name in capitals: glTF has unsigned integers of 32 bits for them (component type 5125), but
# 16777217, of a mesh's attribute "_instance", comes back from the .glb as 16777216.0 in a FLOAT attribute "_INSTANCE",
# without a message. Numbers of instances from 2**24 on don't survive, and a reader that looks for the name finds nothing.
# Seen with bpy 4.5.15 and bpy 5.2.3.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
look() { # PYTHON BPY
  "$1" -m venv "$folder/$2"
  "$folder/$2/bin/python" -m pip install --quiet --disable-pip-version-check "bpy==$2"
  "$folder/$2/bin/python" - "$folder/$2.glb" 2>/dev/null <<'PYTHON'
import json, os, struct, sys
import bpy

file = sys.argv[1]
bpy.ops.wm.read_factory_settings(use_empty=True)
mesh = bpy.data.meshes.new("plate")
mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
mesh.attributes.new("_instance", "INT", "POINT").data.foreach_set("value", [1, 16777216, 16777217])
bpy.context.scene.collection.objects.link(bpy.data.objects.new("plate", mesh))
bpy.ops.export_scene.gltf(filepath=file, export_attributes=True)
content = open(file, "rb").read()
tree = json.loads(content[20 : 20 + struct.unpack("<I", content[12:16])[0]])
names = [name for name in tree["meshes"][0]["primitives"][0]["attributes"] if name.startswith("_")]
accessor = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"][names[0]]]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=file)
attributes = bpy.context.scene.objects[0].data.attributes
row = [bpy.app.version_string.split()[0], *names, accessor["componentType"]]
row += ["_instance" in attributes, attributes[names[0]].data_type, sorted(item.value for item in attributes[names[0]].data)]
print("SEEN", *row, flush=True)
os._exit(0)
PYTHON
}
seen="$({ look python3.11 4.5.15; look python3.13 5.2.3; } | grep '^SEEN')"
echo "$seen"
[ "$seen" = "SEEN 4.5.15 _INSTANCE 5126 False FLOAT [1.0, 16777216.0, 16777216.0]
SEEN 5.2.3 _INSTANCE 5126 False FLOAT [1.0, 16777216.0, 16777216.0]" ]
