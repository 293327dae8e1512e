"""IFC, judged by web-ifc, the engine of many viewers in the browser."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from tests.judges import bringing
from tests.judges.samples import Samples

VERSION = "0.0.78"
_FOLDER = bringing.BUILD / "web-ifc"
_PACKAGE = _FOLDER / "node_modules" / "web-ifc" / "package.json"
_SCRIPT = Path(__file__).with_name("web_ifc_reader.mjs")
_MILLIMETRE = 1e-3
_ROUND = 0.02
"""Share by which extents may differ where bodies are round: either engine has polygons of its own for circles."""
_AXIS = 0.015
"""How far (m) from the axis web-ifc may put it: it has chords of its own along clothoids."""
_Z_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""From its axes, whose y is up, to ours."""


def version() -> str | None:
    """Return its version; None if it or node isn't here."""
    if shutil.which("node") is None or not _PACKAGE.is_file():
        return None
    return json.loads(_PACKAGE.read_text(encoding="utf-8"))["version"]


def bring() -> None:
    """Download it, if node and npm are here."""
    npm = shutil.which("npm")
    if npm and shutil.which("node"):
        quiet = ["--no-audit", "--no-fund", "--no-update-notifier", "--loglevel=error"]
        bringing.install(_FOLDER, [npm, "install", "--prefix", "{}", *quiet, f"web-ifc@{VERSION}"])


def read(path: Path) -> dict[str, Any]:
    """Return what it reads of a file: schema, number of products, meshes by GlobalId, and alignments."""
    # Modules are looked for beside the script.
    script = _FOLDER / _SCRIPT.name
    shutil.copyfile(_SCRIPT, script)
    done = subprocess.run(["node", str(script), str(path)], capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def verdict(samples: Samples) -> list[str]:
    """Return in what its reading differs from ifcopenshell's, and its alignment from the analytic one."""
    import ifcopenshell

    file = ifcopenshell.open(str(samples.file("twin.ifc")))
    seen = read(samples.file("twin.ifc"))
    found = [] if seen["schema"] == file.schema_identifier else [f"the schema is {seen['schema']}"]
    if seen["products"] != len(file.by_type("IfcProduct")):
        found.append(f"{seen['products']} products of {len(file.by_type('IfcProduct'))}")
    bodies = {
        item.GlobalId: item
        for item in file.by_type("IfcProduct")
        if item.Representation and not item.is_a("IfcAlignment")
    }
    if set(seen["meshes"]) != set(bodies):
        found.append(f"{len(seen['meshes'])} meshes of {len(bodies)}")
    for name in bodies.keys() & seen["meshes"].keys():
        found += _wrong_body(bodies[name], seen["meshes"][name])
    return found + _wrong_axis(samples, seen["alignments"])


def _wrong_body(item: Any, mesh: dict[str, Any]) -> list[str]:
    """Return in what a product's mesh differs from the one that ifcopenshell makes."""
    from tests.helpers.files.ifc_reading import body, local_body

    placed = on_curve(item.ObjectPlacement)
    vertices, triangles = local_body(item) if placed else body(item)
    frame = np.linalg.inv(_matrix(mesh["placement"])) if placed else np.eye(4)
    corners = np.concatenate([_corners(piece, frame @ _Z_UP) for piece in mesh["pieces"]])
    found = []
    flat = item.Representation.Representations[0].RepresentationType == "Tessellation"
    count = sum(piece["triangles"] for piece in mesh["pieces"])
    if flat and count != len(triangles):
        found.append(f"{item.Name}: {count} triangles of {len(triangles)}")
    have, want = (np.stack([points.min(axis=0), points.max(axis=0)]) for points in (corners, vertices))
    limit = _MILLIMETRE if flat else _MILLIMETRE + _ROUND * np.ptp(vertices, axis=0).max()
    if np.abs(have - want).max() > limit:
        found.append(f"{item.Name}: extends over {have.tolist()} and not {want.tolist()}")
    return found


def on_curve(placement: Any) -> bool:
    """Return whether a placement is, or is relative to, a linear one.

    web-ifc takes of those the distance along alone, in whole metres, and on a curve that it has simplified; so what
    stands along the road is compared in its own frame.
    """
    while placement is not None:
        if placement.is_a("IfcLinearPlacement"):
            return True
        placement = placement.PlacementRelTo
    return False


def _matrix(columns: list[float]) -> np.ndarray:
    """Return a (4, 4) matrix that is given column by column."""
    return np.array(columns).reshape(4, 4).T


def _corners(piece: dict[str, Any], frame: np.ndarray) -> np.ndarray:
    """Return the vertices (N, 3) of a part of a mesh, moved from where it stands by a (4, 4) matrix."""
    matrix = frame @ _matrix(piece["matrix"])
    return np.array(piece["vertices"]).reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def misplaced(path: Path) -> float:
    """Return how far (m) from where they stand web-ifc puts the objects of a file, at most.

    Their frames are compared, and where nothing is round, of which either engine has polygons of its own, their bodies.
    """
    import ifcopenshell

    from tests.helpers.files.ifc_reading import body, placement

    file, away = ifcopenshell.open(str(path)), []
    for name, mesh in read(path)["meshes"].items():
        item = file.by_guid(name)
        if item.is_a("IfcAlignment"):
            continue
        away.append(np.abs(_matrix(mesh["placement"]) - placement(item)).max())
        if any(part.is_a() in ("IfcCircle", "IfcCircleProfileDef") for part in file.traverse(item.Representation)):
            continue
        seen, wanted = np.concatenate([_corners(piece, _Z_UP) for piece in mesh["pieces"]]), body(item)[0]
        away.append(np.abs(seen.min(axis=0) - wanted.min(axis=0)).max())
        away.append(np.abs(seen.max(axis=0) - wanted.max(axis=0)).max())
    return float(max(away))


def _wrong_axis(samples: Samples, alignments: list[dict[str, list[list[list[float]]]]]) -> list[str]:
    """Return how far the alignment is off: its segments in plan and in elevation."""
    if len(alignments) != 1:
        return [f"{len(alignments)} alignments"]
    geometry = samples.geometry
    plan, profile = (np.array([p for part in alignments[0][kind] for p in part]) for kind in ("horizontal", "vertical"))
    station, offset = geometry.alignment.project(plan)
    ends = station.min(), station.max()
    height = geometry.profile.elevation(np.clip(profile[:, 0], 0.0, geometry.length))
    found = []
    if np.abs(offset).max() > _AXIS or not np.allclose(ends, (0.0, geometry.length), atol=_AXIS):
        found.append(f"the axis is up to {np.abs(offset).max():.4f} m off, from {ends[0]:.2f} m to {ends[1]:.2f} m")
    if np.abs(profile[:, 1] - height).max() > _MILLIMETRE:
        found.append(f"the profile is up to {np.abs(profile[:, 1] - height).max():.4f} m off")
    return found


def with_a_wrong_radius(samples: Samples) -> Samples:
    """Return files with an IFC whose arc says another radius than it has."""
    import ifcopenshell

    file = ifcopenshell.open(str(samples.file("twin.ifc")))
    arc = next(item for item in file.by_type("IfcAlignmentHorizontalSegment") if item.PredefinedType == "CIRCULARARC")
    arc.StartRadiusOfCurvature = arc.EndRadiusOfCurvature = 0.9 * arc.StartRadiusOfCurvature
    return samples.with_file("twin.ifc", file.to_string().encode())
