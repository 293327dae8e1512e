"""USD as text (.usda): prototypes that places refer to, with class and instance of each face as primvars.

z is up, the unit is a metre. Class, instance, name and stations of an object are ``userProperties``, which Blender and
others keep; faces of a mesh of several classes or instances have ``primvars:class_id`` and ``primvars:instance_id``.
Source: Pixar's documentation of UsdGeom and UsdShade.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from ...base.arrays import AnyArray, Float
from .labelled import LabelledMesh, LabelledScene, SceneMaterial

_ROOT = "SynthRoads"
_LINE = 1024
"""Numbers that are written at a time."""


def write_usd(scene: LabelledScene, path: Path) -> None:
    """Write a scene as USD in text."""
    with path.open("w", encoding="utf-8") as file:
        about = scene.about()
        file.write('#usda 1.0\n(\n    defaultPrim = "' + _ROOT + '"\n')
        file.write(f'    doc = {_text(scene.generator)}\n    metersPerUnit = 1\n    upAxis = "Z"\n')
        file.write("    customLayerData = {\n")
        for line in _layer_data(about):
            file.write(f"        {line}\n")
        file.write(f'    }}\n)\n\ndef Xform "{_ROOT}"\n{{\n')
        paths = _write_materials(file, scene.materials)
        shared: list[tuple[LabelledMesh, str]] = []
        names = _Names()
        for number, mesh in enumerate(scene.meshes):
            if len(mesh.matrices) == 1:
                _write_object(file, scene, mesh, names, paths)
            else:
                shared.append((mesh, f"Prototype_{number}"))
        _write_shared(file, scene, shared, names)
        file.write("}\n")
        if shared:
            file.write('\nclass Scope "Prototypes"\n{\n')
            for mesh, name in shared:
                file.write(f'    def Xform "{name}"\n    {{\n')
                _write_mesh(file, mesh, paths, "Mesh", "        ", {})
                file.write("    }\n")
            file.write("}\n")


class _Names:
    """Names of prims: each once."""

    def __init__(self) -> None:
        self._used: dict[str, int] = {}

    def take(self, name: str) -> str:
        """Return a name that USD allows and nothing else has yet."""
        plain = re.sub(r"\W", "_", name, flags=re.ASCII) or "_"
        plain = f"_{plain}" if plain[0].isdigit() else plain
        count = self._used[plain] = self._used.get(plain, 0) + 1
        if count == 1:
            return plain
        return self.take(f"{plain}_{count}")


def _write_object(file: TextIO, scene: LabelledScene, mesh: LabelledMesh, names: _Names, paths: list[str]) -> None:
    """Write a mesh that stands at one place."""
    matrix, number = mesh.matrices[0], int(mesh.numbers[0])
    properties = _properties(scene, mesh, number, matrix)
    name = names.take(str(properties.get("synthroads_name") or mesh.name))
    file.write(f'    def Xform "{name}"\n    {{\n')
    for line in _placed(matrix, properties):
        file.write(f"        {line}\n")
    _write_mesh(file, mesh, paths, name, "        ", properties)  # Blender names an object after its mesh
    file.write("    }\n")


def _write_shared(
    file: TextIO, scene: LabelledScene, shared: Iterable[tuple[LabelledMesh, str]], names: _Names
) -> None:
    """Write the places of meshes that stand at several, as instances."""
    for mesh, prototype in shared:
        for matrix, number in zip(mesh.matrices, mesh.numbers.tolist(), strict=True):
            properties = _properties(scene, mesh, number, matrix)
            name = names.take(str(properties.get("synthroads_name") or mesh.name))
            file.write(f'    def Xform "{name}" (\n        instanceable = true\n')
            file.write(f"        prepend references = </Prototypes/{prototype}>\n    )\n    {{\n")
            for line in _placed(matrix, properties):
                file.write(f"        {line}\n")
            file.write("    }\n")


def _properties(scene: LabelledScene, mesh: LabelledMesh, number: int, matrix: Float) -> dict[str, Any]:
    """Return the properties of a place of a mesh; class and instance only where all its faces have the same."""
    classes = np.unique(mesh.class_id)
    class_id = int(classes[0]) if len(classes) == 1 else -1
    instance = number
    if mesh.instance_id is not None:
        instances = np.unique(mesh.instance_id)
        instance = int(instances[0]) if len(instances) == 1 else 0
    return scene.properties(class_id, instance, mesh.vertices, matrix)


def _write_mesh(
    file: TextIO, mesh: LabelledMesh, paths: list[str], name: str, indent: str, properties: dict[str, Any]
) -> None:
    """Write a mesh with the labels of its faces and the materials that they have."""
    used = np.unique(mesh.material)
    schema = "MaterialBindingAPI"
    file.write(f'{indent}def Mesh "{name}" (\n{indent}    prepend apiSchemas = ["{schema}"]\n{indent})\n{indent}{{\n')
    inside = indent + "    "
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    file.write(f"{inside}float3[] extent = [{_tuple(low)}, {_tuple(high)}]\n")
    _write_array(file, f"{inside}int[] faceVertexCounts", np.full(len(mesh.triangles), 3))
    _write_array(file, f"{inside}int[] faceVertexIndices", mesh.triangles.ravel())
    _write_vectors(file, f"{inside}point3f[] points", mesh.vertices)
    file.write(f'{inside}uniform token subdivisionScheme = "none"\n{inside}uniform bool doubleSided = true\n')
    if len(np.unique(mesh.class_id)) > 1 or not properties.get("synthroads_class"):
        _write_primvar(file, inside, "class_id", mesh.class_id)
    if mesh.instance_id is not None and (
        len(np.unique(mesh.instance_id)) > 1 or not properties.get("synthroads_instance")
    ):
        _write_primvar(file, inside, "instance_id", mesh.instance_id.astype(np.uint32).view(np.int32))
    if len(used) == 1:
        file.write(f"{inside}rel material:binding = <{paths[int(used[0])]}>\n")
    else:
        file.write(f'{inside}uniform token subsetFamily:materialBind:familyType = "nonOverlapping"\n')
        for index in used.tolist():
            file.write(f'{inside}def GeomSubset "Material_{index}" (\n{inside}    prepend apiSchemas = ["{schema}"]\n')
            file.write(f'{inside})\n{inside}{{\n{inside}    uniform token elementType = "face"\n')
            file.write(f'{inside}    uniform token familyName = "materialBind"\n')
            _write_array(file, f"{inside}    int[] indices", np.flatnonzero(mesh.material == index))
            file.write(f"{inside}    rel material:binding = <{paths[index]}>\n{inside}}}\n")
    file.write(f"{indent}}}\n")


def _write_primvar(file: TextIO, indent: str, name: str, values: AnyArray) -> None:
    """Write whole numbers by face as a primvar."""
    _write_array(
        file, f"{indent}int[] primvars:{name}", values, f' (\n{indent}    interpolation = "uniform"\n{indent})'
    )


def _write_array(file: TextIO, head: str, values: AnyArray, tail: str = "") -> None:
    """Write an array of whole numbers."""
    file.write(f"{head} = [")
    for start in range(0, len(values), _LINE):
        text = ", ".join(map(str, values[start : start + _LINE].tolist()))
        file.write(f"{', ' if start else ''}{text}")
    file.write(f"]{tail}\n")


def _write_vectors(file: TextIO, head: str, values: AnyArray) -> None:
    """Write an array of vectors (N, 3) in single precision, exactly."""
    file.write(f"{head} = [")
    for start in range(0, len(values), _LINE):
        # Nine digits tell all numbers of single precision apart.
        rows = values[start : start + _LINE].astype(np.float64).tolist()
        text = ", ".join(f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in rows)
        file.write(f"{', ' if start else ''}{text}")
    file.write("]\n")


def _placed(matrix: Float, properties: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of an object's place and properties."""
    if not np.array_equal(matrix, np.eye(4)):
        rows = ", ".join(_tuple(row) for row in matrix.T)  # USD's vectors are rows
        yield f"matrix4d xformOp:transform = ( {rows} )"
        yield 'uniform token[] xformOpOrder = ["xformOp:transform"]'
    for name, value in properties.items():
        if isinstance(value, str):
            yield f"custom string userProperties:{name} = {_text(value)}"
        elif isinstance(value, int):
            yield f"custom int userProperties:{name} = {value}"
        else:
            yield f"custom double2 userProperties:{name} = {_tuple(value)}"


def _layer_data(about: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of what the scene says of itself."""
    for name, value in about.items():
        if isinstance(value, str):
            yield f"string {name} = {_text(value)}"
        elif isinstance(value, int):
            yield f"int {name} = {value}"
        else:
            yield f"double3 {name} = {_tuple(value)}"


def _write_materials(file: TextIO, materials: Iterable[SceneMaterial]) -> list[str]:
    """Write materials with their mean colours, their names in full as display names; return their paths."""
    names, paths = _Names(), []
    file.write('    def Scope "Materials"\n    {\n')
    for material in materials:
        name = names.take(material.name)
        path = f"/{_ROOT}/Materials/{name}"
        paths.append(path)
        file.write(f'        def Material "{name}" (\n')
        file.write(f"            displayName = {_text(material.name)}\n        )\n        {{\n")
        file.write(f"            token outputs:surface.connect = <{path}/Shader.outputs:surface>\n")
        file.write('            def Shader "Shader"\n            {\n')
        file.write('                uniform token info:id = "UsdPreviewSurface"\n')
        file.write(f"                color3f inputs:diffuseColor = {_tuple(material.color)}\n")
        for field, value in (
            ("metallic", material.metallic),
            ("roughness", material.roughness),
            ("opacity", material.alpha),
        ):
            file.write(f"                float inputs:{field} = {value:.9g}\n")
        file.write("                token outputs:surface\n            }\n        }\n")
    file.write("    }\n")
    return paths


def _tuple(values: Iterable[Any]) -> str:
    """Return numbers as a tuple."""
    return "(" + ", ".join(f"{float(value):.17g}" for value in values) + ")"


def _text(value: str) -> str:
    """Return a text in quotes."""
    return json.dumps(value, ensure_ascii=False)
