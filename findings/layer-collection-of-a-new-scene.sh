#!/bin/bash
# In Blender 5.2 the view layer of a scene that a script has just made has no layer_collection: the attribute is None
# until ViewLayer.update() is called, where Blender 4.5 has the scene's collection there at once. The API's description
# of ViewLayer.layer_collection speaks of no None, so code that walks the tree of collections ends in an AttributeError.
# Seen with bpy 4.5.15 (LayerCollection, LayerCollection) and bpy 5.2.3 (None, LayerCollection).
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
look() { # PYTHON BPY
  "$1" -m venv "$folder/$2"
  "$folder/$2/bin/python" -m pip install --quiet --disable-pip-version-check "bpy==$2"
  "$folder/$2/bin/python" - 2>/dev/null <<'PYTHON'
import os, sys
import bpy

layer = bpy.data.scenes.new("Other").view_layers[0]
before = type(layer.layer_collection).__name__
layer.update()
print(bpy.app.version_string.split()[0], before, type(layer.layer_collection).__name__, flush=True)
os._exit(0)
PYTHON
}
seen="$(look python3.11 4.5.15 | grep -v '^Freeing')
$(look python3.13 5.2.3 | grep -v '^Freeing')"
echo "$seen"
[ "$seen" = "4.5.15 LayerCollection LayerCollection
5.2.3 NoneType LayerCollection" ]
