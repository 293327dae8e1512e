"""Free assets: objects out of .blend, .glb and .obj files, one instance of their collection per place."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from ...base.errors import InputError
from ...base.turns.stepper import run_in_caller
from ...road.terrain import surface_elevation
from ...road.things.asset import Asset
from ...scanning.scene.mesh_files import check_mesh_file
from ...scenario.assets import LibraryAsset, library_file, read_asset_library
from ..files import error_line, stderr_if_it_succeeds
from ..labels import CLASS_PROPERTY, INSTANCE_PROPERTY
from .meshes import on_plan
from .model_builder import ModelBuilder
from .registry import model_part

KEY = "synthroads_asset"
"""Custom property of an asset's collection: the file (and object) that it was read from."""


@model_part("assets", 170, on_the_road=True)
def build_assets(builder: ModelBuilder) -> None:
    """Add one collection instance per asset of the parameter set to the model, reading the assets' files.

    Raises:
        MissingFileError, InputError: a library or an asset's file is missing or cannot be read.
    """
    for name, item in builder.parameters.of_type(Asset).items():
        library = library_file(item.library)
        asset = read_asset_library(library).assets.get(item.name)
        if asset is None:
            raise InputError(f"objects.{name}.name", item.name, f"the library {library} has no such asset")
        instance = builder.add_instance(name, _collection(library.parent / asset.file, asset))
        instance.location = _foot(builder, item)
        heading = builder.geometry.alignment.heading(np.array([item.station]))[0]
        instance.rotation_euler.z = heading - math.pi / 2.0 + math.radians(item.rotation_deg)
        instance.scale = (item.scale,) * 3
        instance[CLASS_PROPERTY], instance[INSTANCE_PROPERTY] = item.class_name, item.instance


def _foot(builder: ModelBuilder, item: Asset) -> Vector:
    """Return an asset's foot point in the scene's frame, m: on the road or terrain, plus its elevation."""
    place = on_plan(builder.geometry, [item])[0]
    surface = surface_elevation(builder.geometry, np.array([item.station]), np.array([item.offset]))
    place[2] = surface[0] + item.elevation
    return Vector((place - builder.origin).tolist())


def _collection(path: Path, asset: LibraryAsset) -> bpy.types.Collection:
    """Return the collection of an asset's objects, read from its file unless the open file has it already."""
    key = f"{path}:{asset.object or ''}"
    for existing in bpy.data.collections:
        if existing.get(KEY) == key:
            return existing
    check_mesh_file(path)
    read = {".blend": _read_blend, ".glb": _read_glb, ".obj": _read_obj}[path.suffix.lower()]
    try:
        with stderr_if_it_succeeds():
            objects = run_in_caller(lambda: read(path, asset.object))  # importers need Blender's main thread
    except (OSError, RuntimeError) as error:
        raise InputError(str(path), None, f"cannot be read as an asset ({error_line(error)})") from None
    if not objects:
        raise InputError(str(path), asset.object, "holds no such object" if asset.object else "holds no objects")
    collection = bpy.data.collections.new(f"SR Asset {path.stem}")
    collection[KEY] = key
    for item in objects:
        for owner in item.users_collection:
            owner.objects.unlink(item)
        collection.objects.link(item)
    return collection


def _read_blend(path: Path, name: str | None) -> list[bpy.types.Object]:
    with bpy.data.libraries.load(str(path), link=False) as (there, here):
        here.objects = [item for item in there.objects if name in (None, item)]
    return [item for item in here.objects if item is not None]


def _read_glb(path: Path, _: str | None) -> list[bpy.types.Object]:
    return _import_objects(lambda: bpy.ops.import_scene.gltf(filepath=str(path)))


def _read_obj(path: Path, _: str | None) -> list[bpy.types.Object]:
    return _import_objects(lambda: bpy.ops.wm.obj_import(filepath=str(path)))


def _import_objects(run: Callable[[], object]) -> list[bpy.types.Object]:
    """Run an importer; return the objects that it added to the file."""
    before = set(bpy.data.objects)
    run()
    return [item for item in bpy.data.objects if item not in before]
