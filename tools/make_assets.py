"""Make the models of the built-in asset library ``roadside``: simple, to scale, free of any other's rights.

    python tools/make_assets.py [--output synthroads_addon/presets/assets/roadside]

Each becomes an OBJ file with materials. Dimensions are those usual in Germany; an asset faces -y and stands on z = 0.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
Float = NDArray[np.float64]

COLOURS = {
    "concrete_wall": (0.52, 0.50, 0.46),
    "roof": (0.16, 0.16, 0.17),
    "door_green": (0.07, 0.20, 0.11),
    "container_blue": (0.05, 0.13, 0.32),
    "glazing": (0.05, 0.06, 0.07),
    "steel": (0.42, 0.43, 0.44),
    "grit_bin_yellow": (0.72, 0.47, 0.03),
    "pole_white": (0.72, 0.72, 0.70),
    "windsock_red": (0.62, 0.04, 0.03),
    "timber": (0.23, 0.15, 0.08),
}
"""Linear base colours."""


class Model:
    """A polygon model with materials, to be written as OBJ."""

    def __init__(self) -> None:
        self.vertices: list[Float] = []
        self.faces: dict[str, list[list[int]]] = {}

    def face(self, material: str, corners: Float) -> None:
        """Add a polygon of corners (K, 3), m, counter-clockwise seen from outside."""
        first = sum(len(part) for part in self.vertices)
        self.vertices.append(corners)
        self.faces.setdefault(material, []).append(list(range(first, first + len(corners))))

    def box(self, material: str, lowest: tuple[float, float, float], highest: tuple[float, float, float]) -> None:
        """Add an axis-aligned box between its lowest and highest corner, m."""
        (a, b, c), (d, e, f) = lowest, highest
        for corners in (
            [(a, b, c), (a, e, c), (d, e, c), (d, b, c)],
            [(a, b, f), (d, b, f), (d, e, f), (a, e, f)],
            [(a, b, c), (d, b, c), (d, b, f), (a, b, f)],
            [(d, e, c), (a, e, c), (a, e, f), (d, e, f)],
            [(a, e, c), (a, b, c), (a, b, f), (a, e, f)],
            [(d, b, c), (d, e, c), (d, e, f), (d, b, f)],
        ):
            self.face(material, np.array(corners))

    def tube(self, material: str, begin: Float, end: Float, radii: tuple[float, float], sides: int = 12) -> None:
        """Add a closed tube or cone between two points (3,) with a radius at each, m."""
        axis = (end - begin) / np.linalg.norm(end - begin)
        first_side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
        first_side /= np.linalg.norm(first_side)
        second_side = np.cross(axis, first_side)
        angle = 2.0 * np.pi * np.arange(sides) / sides
        ring = np.cos(angle)[:, None] * first_side + np.sin(angle)[:, None] * second_side
        first_ring, second_ring = begin + radii[0] * ring, end + radii[1] * ring
        for i in range(sides):
            j = (i + 1) % sides
            self.face(material, np.array([first_ring[i], first_ring[j], second_ring[j], second_ring[i]]))
        self.face(material, first_ring[::-1])
        self.face(material, second_ring)

    def write(self, path: Path) -> None:
        """Write the model as an OBJ file, y up and -z to the north, and its materials as an MTL file beside it."""
        points = np.concatenate(self.vertices)
        lines = [f"mtllib {path.stem}.mtl", f"o {path.stem}"]
        lines += [f"v {x:.4f} {z:.4f} {-y + 0.0:.4f}" for x, y, z in points]
        for material, faces in self.faces.items():
            lines.append(f"usemtl {material}")
            lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
        colours = {name: " ".join(f"{part:.3f}" for part in COLOURS[name]) for name in self.faces}
        table = [f"newmtl {name}\nKd {colour}\nKs 0.2 0.2 0.2\nNs 40" for name, colour in colours.items()]
        path.with_suffix(".mtl").write_text("\n\n".join(table) + "\n", encoding="utf-8", newline="\n")


def transformer_station() -> Model:
    """Return a compact transformer station of 3.0 x 2.4 x 2.5 m, with doors and vents."""
    model = Model()
    model.box("concrete_wall", (-1.5, -1.2, 0.0), (1.5, 1.2, 2.35))
    model.box("roof", (-1.6, -1.3, 2.35), (1.6, 1.3, 2.5))
    for x in (-1.3, -0.1):
        model.box("door_green", (x, -1.23, 0.1), (x + 1.1, -1.2, 2.15))
        for slat in range(4):
            z = 1.5 + 0.12 * slat
            model.box("steel", (x + 0.2, -1.25, z), (x + 0.9, -1.23, z + 0.05))
    model.box("door_green", (1.5, -0.6, 0.3), (1.53, 0.6, 1.6))
    return model


def site_container() -> Model:
    """Return a corrugated 20-foot site office of 6.06 x 2.44 x 2.6 m, with door and windows."""
    model = Model()
    model.box("container_blue", (-3.0, -1.19, 0.1), (3.0, 1.19, 2.5))
    model.box("steel", (-3.03, -1.22, 0.0), (3.03, 1.22, 0.16))
    model.box("steel", (-3.03, -1.22, 2.44), (3.03, 1.22, 2.6))
    for x in (-3.03, 2.88):
        for y in (-1.22, 1.07):
            model.box("steel", (x, y, 0.0), (x + 0.15, y + 0.15, 2.6))
    for rib in range(26):
        x = -2.8 + 0.22 * rib
        model.box("container_blue", (x, 1.19, 0.16), (x + 0.1, 1.22, 2.44))
        if not (-2.3 <= x <= -1.2 or -0.3 <= x <= 1.1 or 1.5 <= x <= 2.5):
            model.box("container_blue", (x, -1.22, 0.16), (x + 0.1, -1.19, 2.44))
    model.box("steel", (-2.2, -1.23, 0.16), (-1.3, -1.19, 2.15))
    for x in (-0.15, 1.6):
        model.box("glazing", (x, -1.22, 1.0), (x + 0.95, -1.19, 2.0))
        model.box("steel", (x - 0.05, -1.24, 0.95), (x + 1.0, -1.22, 1.0))
    return model


def grit_bin() -> Model:
    """Return a grit bin for winter service, 700 l, of 1.35 x 0.98 x 1.0 m, with a sloping lid."""
    model = Model()
    model.box("grit_bin_yellow", (-0.62, -0.42, 0.05), (0.62, 0.42, 0.62))
    lid = np.array([(-0.68, -0.49, 0.62), (0.68, -0.49, 0.62), (0.68, 0.49, 0.95), (-0.68, 0.49, 0.95)])
    lower_lid = lid - [0.0, 0.0, 0.06]
    model.face("grit_bin_yellow", lid)
    model.face("grit_bin_yellow", lower_lid[::-1])
    for i in range(4):
        j = (i + 1) % 4
        model.face("grit_bin_yellow", np.array([lower_lid[i], lower_lid[j], lid[j], lid[i]]))
    back_wall = [(0.62, 0.42, 0.62), (-0.62, 0.42, 0.62), (-0.62, 0.42, 0.88), (0.62, 0.42, 0.88)]
    model.face("grit_bin_yellow", np.array(back_wall))
    for x in (-0.55, 0.4):
        model.box("roof", (x, -0.4, 0.0), (x + 0.15, 0.4, 0.05))
    return model


def windsock() -> Model:
    """Return a red and white windsock, 2 m long and hanging at 20 degrees, on a mast of 6 m."""
    model = Model()
    model.tube("pole_white", np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.0, 6.0]), (0.06, 0.04))
    direction = np.array([np.cos(np.radians(20.0)), 0.0, -np.sin(np.radians(20.0))])
    begin = np.array([0.1, 0.0, 5.75])
    for part in range(5):
        colour = "windsock_red" if part % 2 == 0 else "pole_white"
        ends = begin + 0.4 * part * direction, begin + 0.4 * (part + 1) * direction
        model.tube(colour, *ends, (0.25 - 0.03 * part, 0.22 - 0.03 * part), 16)
    return model


def wildlife_fence() -> Model:
    """Return a stretch of wildlife fence, 12 m along the road and 2 m high: timber posts and wires."""
    model = Model()
    for post in range(5):
        y = -6.0 + 3.0 * post
        model.tube("timber", np.array([0.0, y, 0.0]), np.array([0.0, y, 2.05]), (0.06, 0.055), 10)
    heights = np.concatenate([np.arange(0.08, 1.0, 0.12), np.arange(1.1, 2.01, 0.18)])
    for z in heights:
        model.tube("steel", np.array([0.06, -6.0, z]), np.array([0.06, 6.0, z]), (0.002, 0.002), 4)
    for y in np.arange(-5.85, 6.0, 0.15):
        model.tube("steel", np.array([0.06, y, 0.05]), np.array([0.06, y, 2.0]), (0.0015, 0.0015), 4)
    return model


MODELS = {
    "transformer_station": transformer_station,
    "site_container": site_container,
    "grit_bin": grit_bin,
    "windsock": windsock,
    "wildlife_fence": wildlife_fence,
}


def main() -> None:
    """Write all models as OBJ and MTL files to the command line's folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = ROOT / "synthroads_addon" / "presets" / "assets" / "roadside"
    parser.add_argument("--output", type=Path, default=default, metavar="DIR")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in MODELS.items():
        make().write(folder / f"{name}.obj")
        print(folder / f"{name}.obj")


if __name__ == "__main__":
    main()
