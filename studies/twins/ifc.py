"""The figure of docs/twin-ifc.md: an IFC file as ifcopenshell's geometry reads it, coloured by class.

Usage: python studies/twins/ifc.py docs/pictures
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.placement
import matplotlib as mpl
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

sys.path.insert(0, str(Path(__file__).parents[2]))
from synthroads_addon.base.figure import new_figure, save_figure
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.ifc.writer import write_ifc

SCENARIO = {
    "design_class": "EKA3",
    "cross_section": "RQ31.5",
    "length": 1500.0,
    "turnouts": {"exits": 1, "entries": 1, "emergency_bays": 1},
    "barriers": {"noise_barrier": 1},
    "furniture": {"gantries": 1, "overpass": 1, "lighting": 1},
}
SEED = 11
COLOURS = {
    "IfcGeographicElement": ("#9fb98a", "IfcGeographicElement TERRAIN"),
    "IfcEarthworksFill": ("#7f9a63", "IfcEarthworksFill (verge, median, island)"),
    "IfcCourse": ("#55585e", "IfcCourse PAVEMENT"),
    "IfcSurfaceFeature": ("#ffffff", "IfcSurfaceFeature (markings)"),
    "IfcRailing": ("#2f7fd0", "IfcRailing GUARDRAIL"),
    "IfcWall": ("#7a5fd0", "IfcWall (noise barrier, abutments)"),
    "IfcSign": ("#e03030", "IfcSign"),
    "IfcColumn": ("#c9a227", "IfcColumn, IfcBeam, IfcLightFixture"),
    "IfcSlab": ("#a0704a", "IfcSlab (overpass)"),
    "IfcVehicle": ("#20b8b8", "IfcVehicle"),
}
_ALIKE = {"IfcBeam": "IfcColumn", "IfcLightFixture": "IfcColumn", "IfcAudioVisualAppliance": "IfcColumn"}
_LIGHT = np.array([0.3, -0.35, 0.89])
_NEAR = 1.0
_BIAS = {"IfcGeographicElement": 12.0, "IfcEarthworksFill": 6.0, "IfcCourse": 6.0, "IfcSurfaceFeature": -2.0}
"""Flat things are drawn before what stands on them: class -> distance (m) that it is moved back by in the order."""


def main(folder: Path) -> None:
    """Write an IFC file of a sampled road and draw it to twin-ifc.png in the folder."""
    parameters = sample_road(RoadScenario.from_dict(SCENARIO), SEED)
    with tempfile.TemporaryDirectory() as folder_name:
        path = Path(folder_name) / "twin.ifc"
        write_ifc(parameters, path)
        file = ifcopenshell.open(str(path))
        triangles, colours, bias = _triangles(file)
        gantry = next(item for item in file.by_type("IfcElementAssembly") if item.PredefinedType == "SIGNALASSEMBLY")
        frame = np.array(ifcopenshell.util.placement.get_local_placement(gantry.ObjectPlacement))
    eye = frame @ (75.0, 8.0, 15.0, 1.0)
    target = frame @ (-60.0, -12.0, 0.0, 1.0)
    _draw((triangles, colours, bias), eye[:3], target[:3], folder / "twin-ifc.png")


def _triangles(file: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return all elements' triangles (T, 3, 3), m, shaded colours (T, 3), and offsets of depth for sorting (T,), m."""
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    corners, colours, bias = [], [], []
    for item in file.by_type("IfcElement"):
        key = _ALIKE.get(item.is_a(), item.is_a())
        if item.Representation is None or key not in COLOURS:
            continue
        is_mesh = item.Representation.Representations[0].RepresentationType == "Tessellation"
        kernel: Any = "manifold" if is_mesh else "opencascade"
        shape: Any = ifcopenshell.geom.create_shape(settings, item, geometry_library=kernel)
        triangles = np.array(shape.geometry.verts).reshape(-1, 3)[np.array(shape.geometry.faces).reshape(-1, 3)]
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        shade = 0.6 + 0.4 * np.abs(normal @ _LIGHT)
        colour = np.array(mpl.colors.to_rgb(COLOURS[key][0]))
        corners.append(triangles)
        colours.append(np.clip(shade[:, None] * colour, 0.0, 1.0))
        bias.append(np.full(len(triangles), _BIAS.get(key, 0.0)))
    return np.concatenate(corners), np.concatenate(colours), np.concatenate(bias)


def _draw(mesh: tuple[np.ndarray, np.ndarray, np.ndarray], eye: np.ndarray, target: np.ndarray, path: Path) -> None:
    """Write a picture of triangles in perspective from `eye` to `target`, sorted by depth, the farthest first."""
    triangles, colours, bias = mesh
    forward = (target - eye) / np.linalg.norm(target - eye)
    rightward = np.cross(forward, (0.0, 0.0, 1.0))
    rightward /= np.linalg.norm(rightward)
    view_corners = (triangles - eye) @ np.column_stack([rightward, np.cross(rightward, forward), forward])
    depth = view_corners[:, :, 2]
    is_in_front = (depth > _NEAR).all(axis=1) & (depth.min(axis=1) < 420.0)
    view_corners, colours, depth, bias = (
        view_corners[is_in_front],
        colours[is_in_front],
        depth[is_in_front],
        bias[is_in_front],
    )
    picture_corners = view_corners[:, :, :2] / depth[:, :, None]
    is_in_picture = (np.abs(picture_corners[:, :, 0]) < 1.2).any(axis=1) & (np.abs(picture_corners[:, :, 1]) < 0.8).any(
        axis=1
    )
    order = np.argsort(-(depth[is_in_picture].mean(axis=1) + bias[is_in_picture]))
    haze = np.clip((depth[is_in_picture].mean(axis=1) - 60.0) / 500.0, 0.0, 0.6)[:, None]
    shown_colours = (colours[is_in_picture] * (1.0 - haze) + haze * np.array([0.86, 0.91, 0.96]))[order]
    figure = new_figure(12, 5.6, layout=None)
    axes = figure.add_subplot()
    axes.add_collection(
        PolyCollection(
            picture_corners[is_in_picture][order], facecolors=shown_colours, edgecolors=shown_colours, linewidths=0.15
        )
    )
    axes.set(xlim=(-0.56, 0.56), ylim=(-0.33, 0.18), aspect="equal")
    axes.set_facecolor("#dbe8f5")
    axes.set_xticks([])
    axes.set_yticks([])
    patches = [Patch(facecolor=colour, edgecolor="#888888", label=label) for colour, label in COLOURS.values()]
    axes.legend(handles=patches, loc="upper left", fontsize=8, ncol=2, framealpha=0.9)
    figure.tight_layout(pad=0.3)
    save_figure(figure, path, dpi=110)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    main(parser.parse_args().folder)
