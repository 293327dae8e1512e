#!/bin/bash
# The same USD file, a pane whose UsdPreviewSurface states opacity 0.3 (no opacityMode, so transparent), comes into
# Blender 4.5 LTS as Alpha 0.3 with no transmission, and into 5.2 LTS as Alpha 1 with Transmission 0.7. A program that
# asks a material's alpha where light or a laser passes sees a hole in the one and a closed pane in the other.
# Seen with bpy 4.5.15 (Python 3.11) and bpy 5.2.3 (Python 3.13), each by its own importer's defaults.
# Guess before: opacity becomes Alpha in both.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/read.py" <<'PYTHON'
import sys

import bpy

PANE = """#usda 1.0
(
    defaultPrim = "Root"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Root"
{
    def Mesh "Pane" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        rel material:binding = </Root/Glass>
    }
    def Material "Glass"
    {
        token outputs:surface.connect = </Root/Glass/Surface.outputs:surface>
        def Shader "Surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            float inputs:opacity = 0.3
            token outputs:surface
        }
    }
}
"""
path = sys.argv[1] + "/pane.usda"
with open(path, "w") as file:
    file.write(PANE)
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.usd_import(filepath=path)
inputs = bpy.data.materials["Glass"].node_tree.nodes["Principled BSDF"].inputs
alpha, transmission = (inputs[name].default_value for name in ("Alpha", "Transmission Weight"))
print(f"seen: {bpy.app.version_string} alpha {alpha:.2f} transmission {transmission:.2f}")
PYTHON
seen=""
for versions in "3.11 4.5.15" "3.13 5.2.3"; do
    read -r python blender <<< "$versions"
    PYENV_VERSION=3.11.7:3.13.0 "python$python" -m venv "$folder/venv"
    "$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "bpy==$blender"
    seen+=$("$folder/venv/bin/python" "$folder/read.py" "$folder" | grep "^seen")$'\n'
    rm -rf "$folder/venv"
done
echo "$seen"
[ "$seen" = "seen: 4.5.15 LTS alpha 0.30 transmission 0.00
seen: 5.2.3 LTS alpha 1.00 transmission 0.70
" ]
