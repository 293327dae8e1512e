"""Draw a glTF scene by class, from the file alone: ``python studies/twins/scene_files.py scene.glb picture.png``.

The ground comes first, then markings, then all else; triangles are sorted by their distance from the camera, and
painted with the colour of the class that their node states.
"""

from __future__ import annotations

import argparse
import json
import struct
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from synthroads_addon.base.classes import class_scheme

SIZE = (1500, 760)
OVERSAMPLING = 2
LAYERS = {"ground": 0, "road": 0, "roadside": 0, "road_marking": 1}
"""Classes that are painted before the others: else large triangles would hide what lies on them."""
SUN = np.array([0.45, -0.35, 0.82])


def read_triangles(path: Path) -> tuple[np.ndarray, list[str]]:
    """Return corners (T, 3, 3), z up, m, and the class of each triangle of a .glb."""
    data = path.read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    content, binary = json.loads(data[20 : 20 + length]), data[28 + length :]

    def array(index: int) -> np.ndarray:
        accessor = content["accessors"][index]
        view = content["bufferViews"][accessor["bufferView"]]
        kind = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[accessor["componentType"]]
        return np.frombuffer(binary[view["byteOffset"] :][: view["byteLength"]], kind)

    corners, names = [], []
    for node in content["nodes"]:
        if "mesh" not in node:
            continue
        matrix = np.array(node.get("matrix", np.eye(4).ravel())).reshape(4, 4).T
        for primitive in content["meshes"][node["mesh"]]["primitives"]:
            places = array(primitive["attributes"]["POSITION"]).reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
            triangles = places[array(primitive["indices"]).reshape(-1, 3)]
            corners.append(triangles)
            names += [node["extras"].get("synthroads_class", "")] * len(triangles)
    return np.concatenate(corners), names


def draw(path: Path, picture: Path, eye: np.ndarray, target: np.ndarray, focal: float) -> None:
    """Draw a file as a camera at ``eye`` that looks at ``target`` (m) sees it; focal length in heights of the image."""
    corners, names = read_triangles(path)
    colors = {row.name: np.array(row.color) for row in class_scheme("17").rows}
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    frame = np.stack([right, -np.cross(right, forward), forward])
    seen = (corners - eye) @ frame.T
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    light = 0.55 + 0.45 * np.abs(normal @ SUN)
    width, height = (OVERSAMPLING * side for side in SIZE)
    is_ahead = seen[:, :, 2].min(axis=1) > 1.0
    layer = np.array([LAYERS.get(name, 2) for name in names])
    order = np.lexsort((-seen[:, :, 2].mean(axis=1), layer))
    order = order[is_ahead[order]]
    plan = seen[..., :2] / np.maximum(seen[..., 2:], 1e-6) * focal * height + [width / 2.0, height / 2.0]
    image = Image.new("RGB", (width, height), (222, 232, 240))
    pen = ImageDraw.Draw(image)
    for index in order.tolist():
        color = colors.get(names[index], np.array([255, 0, 255])) * light[index]
        pen.polygon([tuple(point) for point in plan[index]], fill=tuple(color.astype(int).tolist()))
    image.resize(SIZE, Image.Resampling.LANCZOS).save(picture)


def main() -> None:
    """Draw a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--eye", type=float, nargs=3, default=(0.0, -20.0, 12.0), metavar=("X", "Y", "Z"))
    parser.add_argument("--target", type=float, nargs=3, default=(60.0, 0.0, 0.0), metavar=("X", "Y", "Z"))
    parser.add_argument("--focal", type=float, default=0.9)
    arguments = parser.parse_args()
    draw(arguments.scene, arguments.picture, np.array(arguments.eye), np.array(arguments.target), arguments.focal)


if __name__ == "__main__":
    main()
