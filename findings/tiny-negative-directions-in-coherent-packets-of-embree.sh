#!/bin/bash
# Embree 4.4, as the wheel of embreex 4.4.0.post1 brings it, cast by its own rtcIntersect8 (and 4, and 16) with the flag
# RTC_RAY_QUERY_FLAG_COHERENT: where a component of some rays' directions is negative and smaller than 1e-18, and that
# of others is negative and larger, all those rays lose the face that is plainly there, without an error. Without the
# flag, or with the component 0, or with all of them below 1e-18 or all above, every ray meets it. It is what a flight
# along an axis gives: the sine of half a turn, rounded, times the angle across.
# Seen with embreex 4.4.0.post1 (Embree 4.4.0), on x86_64 with AVX2 or AVX-512.
# Guess before: the flag may choose another face of an edge, and changes nothing else.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "embreex==4.4.0.post1" "numpy==1.26.4"
cat > "$folder/cast.py" <<'PYTHON'
import ctypes
from pathlib import Path

import embreex.rtcore
import numpy as np

P, U, Z = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
path = next(Path(embreex.__file__).parent.glob("../embreex.libs/libembree4*"))
lib = ctypes.CDLL(str(path))
for name, result, arguments in (
    ("rtcNewDevice", P, [ctypes.c_char_p]),
    ("rtcNewScene", P, [P]),
    ("rtcNewGeometry", P, [P, ctypes.c_int]),
    ("rtcSetSharedGeometryBuffer", None, [P, ctypes.c_int, U, ctypes.c_int, P, Z, Z, Z]),
    ("rtcCommitGeometry", None, [P]),
    ("rtcAttachGeometry", U, [P, P]),
    ("rtcCommitScene", None, [P]),
    ("rtcIntersect4", None, [P, P, P, P]),
    ("rtcIntersect8", None, [P, P, P, P]),
):
    function = getattr(lib, name)
    function.restype, function.argtypes = result, arguments

# A floor of 40 x 40 squares of 1 m, as two triangles each.
side = np.arange(41, dtype=np.float32) - 20
grid = np.stack(np.meshgrid(side, side, indexing="ij"), -1).reshape(-1, 2)
vertices = np.zeros((len(grid) + 1, 3), np.float32)
vertices[:-1, :2] = grid
corner = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
first, second = np.stack([corner, corner + 41, corner + 1], 1), np.stack([corner + 1, corner + 41, corner + 42], 1)
triangles = np.ascontiguousarray(np.concatenate([first, second]), np.uint32)
device = lib.rtcNewDevice(None)
scene, mesh = lib.rtcNewScene(device), lib.rtcNewGeometry(device, 0)
lib.rtcSetSharedGeometryBuffer(mesh, 1, 0, 0x9003, vertices.ctypes.data, 0, 12, len(grid))
lib.rtcSetSharedGeometryBuffer(mesh, 0, 0, 0x5003, triangles.ctypes.data, 0, 12, len(triangles))
lib.rtcCommitGeometry(mesh)
lib.rtcAttachGeometry(scene, mesh)
lib.rtcCommitScene(scene)


def met(width, along, coherent):
    """Return how many rays of a packet, from 30 m above and nearly straight down, meet the floor."""
    data = np.zeros((21 * width + 16), np.uint32)
    data = data[(-data.ctypes.data // 4) % 16 :][: 21 * width].reshape(21, width)
    rays = data.view(np.float32)
    rays[0:3] = [[0.3], [0.2], [30.0]]
    across = 0.003 * (1 + np.arange(width, dtype=np.float32))
    rays[4:7] = [across, along, -np.sqrt(1 - across**2)]
    rays[8] = 100.0
    data[9] = data[17] = data[18] = data[19] = data[20] = 0xFFFFFFFF
    arguments = np.zeros(8, np.uint32)
    arguments[0], arguments[1] = (1 << 16) * coherent, 0xFFFFFFFF
    valid = np.full(width + 16, -1, np.int32)
    valid = valid[(-valid.ctypes.data // 4) % 16 :][:width]
    getattr(lib, f"rtcIntersect{width}")(valid.ctypes.data, scene, data.ctypes.data, arguments.ctypes.data)
    return int((data[18] != 0xFFFFFFFF).sum())


for width in (4, 8):
    half = np.arange(width) < width // 2
    for name, along in (
        ("all 0", np.zeros(width)),
        ("all -0.5e-18", np.full(width, -0.5e-18)),
        ("all -2e-18", np.full(width, -2e-18)),
        ("half of each", np.where(half, -0.5e-18, -2e-18)),
        ("half of each, positive", np.where(half, 0.5e-18, 2e-18)),
    ):
        along = along.astype(np.float32)
        print(f"seen: {width} rays, {name}: {met(width, along, False)} without the flag, {met(width, along, True)} with it")
PYTHON
seen=$("$folder/venv/bin/python" "$folder/cast.py" | grep "^seen")
echo "$seen"
[ "$(echo "$seen" | grep -c ": \([48]\) without the flag, \1 with it")" = 8 ]
[ "$(echo "$seen" | grep -c "half of each: [48] without the flag, 0 with it")" = 2 ]
