"""Scenes with semantics, judged by the Khronos validator and by USD's own library."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import sys
from collections import Counter
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.twin.scene.labelled import LabelledScene
from tests.helpers.scenes.labelled import labelled_scene
from tests.judges import bringing
from tests.judges.samples import Samples

GLTF_VALIDATOR = "2.0.0-dev.3.10"
_GLTF = bringing.BUILD / "gltf-validator"
_SCRIPT = Path(__file__).with_name("gltf_validator.mjs")
USD_CORE = "26.11"
_USD = bringing.BUILD / "usd-core"


def gltf_version() -> str | None:
    """Return the version of the glTF validator; None if it or node isn't here."""
    package = _GLTF / "node_modules" / "gltf-validator" / "package.json"
    if shutil.which("node") is None or not package.is_file():
        return None
    return json.loads(package.read_text(encoding="utf-8"))["version"]


def bring_gltf() -> None:
    """Download it, if node and npm are here."""
    npm = shutil.which("npm")
    if npm and shutil.which("node"):
        quiet = ["--no-audit", "--no-fund", "--no-update-notifier", "--loglevel=error"]
        bringing.install(_GLTF, [npm, "install", "--prefix", "{}", *quiet, f"gltf-validator@{GLTF_VALIDATOR}"])


def gltf_issues(path: Path) -> tuple[list[str], int]:
    """Return errors and warnings of the validator, and the number of triangles that it counts."""
    script = _GLTF / _SCRIPT.name
    shutil.copyfile(_SCRIPT, script)  # modules are looked for beside the script
    done = subprocess.run(["node", str(script), str(path)], capture_output=True, text=True, check=True)
    report = json.loads(done.stdout.splitlines()[-1])
    return [f"{path.name}: {issue['pointer']}: {issue['message']}" for issue in report["issues"]], report["triangles"]


def gltf_verdict(samples: Samples) -> list[str]:
    """Return what the validator finds in the scene and in each tile, and triangles that are missing."""
    wanted = _triangles(labelled_scene())
    found, count = gltf_issues(samples.file("scene.glb"))
    shared = sum(len(mesh.triangles) for mesh in labelled_scene().meshes)  # it counts a mesh once, wherever it stands
    if count != shared:
        found.append(f"scene.glb: {count} triangles of {shared}")
    total = 0
    tileset = samples.file("tiles/tileset.json")
    for tile in json.loads(tileset.read_text())["root"]["children"]:
        issues, count = gltf_issues(tileset.parent / tile["content"]["uri"])
        found += issues
        total += count
    return found + ([] if total == wanted else [f"tiles: {total} triangles of {wanted}"])


def _triangles(scene: LabelledScene) -> int:
    """Return the number of triangles of all places."""
    return sum(len(mesh.triangles) * len(mesh.matrices) for mesh in scene.meshes)


def with_a_wrong_bound(samples: Samples) -> Samples:
    """Return files with a glTF whose first vertices are said to reach farther."""
    data = samples.file("scene.glb").read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    content = json.loads(data[20 : 20 + length])
    content["accessors"][0]["max"][0] += 1.0
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest)) + struct.pack("<I4s", len(text), b"JSON")
    return samples.with_file("scene.glb", head + text + rest)


def usd_version() -> str | None:
    """Return the version of USD's library; None if it isn't here."""
    found = metadata.distributions(name="usd-core", path=[str(_USD)])
    return next((item.version for item in found), None)


def bring_usd() -> None:
    """Download it; in an environment of its own, as Blender has one inside."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check"]
    bringing.install(_USD, [*pip, "--target", "{}", f"usd-core=={USD_CORE}"])


_READER = """
import json, sys
from pxr import Usd, UsdGeom, UsdShade
stage = Usd.Stage.Open(sys.argv[1])
things = []
def up(prim, name):
    while prim and prim.GetPath().pathString != "/":
        attribute = prim.GetAttribute("userProperties:" + name)
        if attribute and attribute.HasValue():
            return attribute.Get()
        prim = prim.GetParent()
    return None
for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
    if not prim.IsA(UsdGeom.Mesh):
        continue
    mesh = UsdGeom.Mesh(prim)
    matrix = UsdGeom.XformCache().GetLocalToWorldTransform(prim)
    points = [list(matrix.Transform(tuple(map(float, point)))) for point in mesh.GetPointsAttr().Get()]
    ok, reason = UsdGeom.Mesh.ValidateTopology(
        mesh.GetFaceVertexIndicesAttr().Get(), mesh.GetFaceVertexCountsAttr().Get(), len(points)
    )
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    primvars = UsdGeom.PrimvarsAPI(prim)
    labels = {
        name: list(primvars.GetPrimvar(name).Get()) for name in ("class_id", "instance_id") if primvars.HasPrimvar(name)
    }
    bound = UsdShade.MaterialBindingAPI(subsets[0] if subsets else prim).ComputeBoundMaterial()[0]
    things.append({
        "points": points, "faces": len(mesh.GetFaceVertexCountsAttr().Get()), "valid": ok, "reason": reason,
        "class": up(prim, "synthroads_class"), "instance": up(prim, "synthroads_instance"),
        "shared": prim.IsInstanceProxy(), "labels": labels, "material": bool(bound),
        "subset_faces": sum(len(subset.GetIndicesAttr().Get()) for subset in subsets) if subsets else None,
    })
print(json.dumps({
    "metres": UsdGeom.GetStageMetersPerUnit(stage), "up": str(UsdGeom.GetStageUpAxis(stage)),
    "origin": list(stage.GetRootLayer().customLayerData["synthroads_origin"]), "things": things,
}))
"""


def read_usd(path: Path) -> dict[str, Any]:
    """Return what USD's library reads of a file; in a process of its own, as Blender has another of its releases."""
    script = f"import sys; sys.path.insert(0, {str(_USD)!r})\n{_READER}"
    done = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False)
    if done.returncode:
        return {"fault": done.stderr[-400:]}
    return json.loads(done.stdout.splitlines()[-1])


def usd_verdict(samples: Samples) -> list[str]:
    """Return what USD's library reads differently: unit, axis, faces by class and instance, places, shared meshes."""
    scene = labelled_scene()
    seen = read_usd(samples.file("scene.usda"))
    if "fault" in seen:
        return [seen["fault"]]
    found = [] if (seen["metres"], seen["up"]) == (1.0, "Z") else [f"unit and axis are {seen['metres']}, {seen['up']}"]
    if not np.array_equal(seen["origin"], scene.origin):
        found.append(f"the origin is {seen['origin']}")
    found += [f"a mesh is wrong: {thing['reason']}" for thing in seen["things"] if _is_wrong(thing)]
    wanted, faces = _written_faces(scene), _read_faces(scene, seen)
    if faces != wanted:
        found.append(f"faces by class and instance differ: {sorted(faces.items() ^ wanted.items())[:4]}")
    places = np.concatenate([thing["points"] for thing in seen["things"]])
    own = [
        mesh.vertices.astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
        for mesh in scene.meshes
        for matrix in mesh.matrices
    ]
    if np.abs(_sorted(places) - _sorted(np.concatenate(own))).max() > 1e-6:
        found.append("vertices lie elsewhere")
    if sum(thing["shared"] for thing in seen["things"]) != 10:
        found.append("the posts don't share their mesh")
    return found


def _is_wrong(thing: dict[str, Any]) -> bool:
    """Return whether a mesh's topology is invalid, or faces have no material."""
    return not thing["valid"] or not thing["material"] or thing["subset_faces"] not in (None, thing["faces"])


def _written_faces(scene: LabelledScene) -> Counter[tuple[str, int]]:
    """Return the number of faces of all places by class and instance."""
    count: Counter[tuple[str, int]] = Counter()
    for mesh in scene.meshes:
        for number in mesh.numbers.tolist():
            numbers = [number] * len(mesh.class_id) if mesh.instance_id is None else mesh.instance_id.tolist()
            count.update(
                (scene.class_names[kind], one) for kind, one in zip(mesh.class_id.tolist(), numbers, strict=True)
            )
    return count


def _read_faces(scene: LabelledScene, seen: dict[str, Any]) -> Counter[tuple[str, int]]:
    """Return the number of faces by class and instance that were read."""
    count: Counter[tuple[str, int]] = Counter()
    for thing in seen["things"]:
        labels = thing["labels"]
        for face in range(thing["faces"]):
            name = thing["class"] or scene.class_names[labels["class_id"][face]]
            instance = thing["instance"] if thing["instance"] is not None else labels["instance_id"][face]
            count[name, instance % 2**32] += 1
    return count


def _sorted(places: np.ndarray) -> np.ndarray:
    """Return places (N, 3) in an order of their own."""
    return places[np.lexsort(np.round(places, 5).T)]


def with_another_class(samples: Samples) -> Samples:
    """Return files with a USD in which the sign is a pole."""
    return samples.with_text("scene.usda", '"road_sign"', '"pole"')
