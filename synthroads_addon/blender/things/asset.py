"""Free assets: objects from .blend, .glb and .obj files, placed as an instance of their collection.

An asset consists of the objects that a render of its file would show, scaled by the length of the file's unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Vector

from ...base.errors import InputError
from ...base.scratch.opened_file import being_opened
from ...base.turns.stepper import run_in_caller
from ...road.terrain import surface_elevation
from ...road.things.asset import Asset
from ...scanning.scene.mesh_files import check_mesh_file
from ...scenario.assets import LibraryAsset, library_file, read_asset_library
from ..files import error_line, stderr_if_it_succeeds
from ..labels import CLASS_PROPERTY, INSTANCE_PROPERTY
from ..materials.imported_alpha import mend_imported_alpha
from ..references import check_references, loaded_data
from .meshes import on_plan
from .model_builder import ModelBuilder
from .registry import model_part

KEY = "synthroads_asset"
"""Custom property of an asset's collection: the file (and object) that it was read from."""
_REMEDY = "copy it into the library's folder"
UNIT = "synthroads_unit"
"""Custom property of an asset's collection: length of its file's unit, m."""


class _Read(NamedTuple):
    """Objects read from a file, and the length of the file's unit, m."""

    objects: list[bpy.types.Object]
    unit: float = 1.0


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
            raise InputError(f"objects.{name}.name", item.name, f"the library {library} has no asset of this name")
        collection = _collection(library.parent, asset)
        instance = builder.add_instance(name, collection)
        instance.location = _foot(builder, item)
        heading = builder.geometry.alignment.heading(np.array([item.station]))[0]
        instance.rotation_euler.z = heading - math.pi / 2.0 + math.radians(item.rotation_deg)
        instance.scale = (item.scale * collection.get(UNIT, 1.0),) * 3
        instance[CLASS_PROPERTY], instance[INSTANCE_PROPERTY] = item.class_name, item.instance


def _foot(builder: ModelBuilder, item: Asset) -> Vector:
    """Return an asset's foot point in the scene's frame, m: on the road or terrain, plus its elevation."""
    place = on_plan(builder.geometry, [item])[0]
    surface = surface_elevation(builder.geometry, np.array([item.station]), np.array([item.offset]))
    place[2] = surface[0] + item.elevation
    return Vector((place - builder.origin).tolist())


def _collection(library: Path, asset: LibraryAsset) -> bpy.types.Collection:
    """Return the collection of an asset's objects, read from its file unless the open file has it already.

    Raises:
        InputError: the file can't be read, or refers to a file outside of the library's folder.
    """
    path = library / asset.file
    key = f"{path}:{asset.object or ''}"
    for file_collection in bpy.data.collections:
        if file_collection.get(KEY) == key:
            return file_collection
    check_mesh_file(path, (library,), _REMEDY)
    earlier_data = loaded_data()
    read_file = {".blend": _read_blend, ".glb": _read_glb, ".obj": _read_obj}[path.suffix.lower()]
    try:
        with stderr_if_it_succeeds():
            objects, unit = run_in_caller(lambda: read_file(path, asset.object))  # importers need Blender's main thread
    except (OSError, RuntimeError) as error:
        raise InputError(str(path), None, f"cannot be read as an asset ({error_line(error)})") from None
    if not objects:
        raise InputError(
            str(path), asset.object, "has no object of this name" if asset.object else "has no object that renders show"
        )
    if path.suffix.lower() != ".blend":  # a .blend may refer to files anywhere, as in Blender
        check_references(path, (path.parent, library), _REMEDY, earlier_data)
    collection = bpy.data.collections.new(f"SR Asset {path.stem}")
    collection[KEY], collection[UNIT] = key, unit
    slots = [slot.material for item in objects for slot in item.material_slots]
    mend_imported_alpha(path, {material for material in slots if material is not None})
    for item in objects:
        for owner in item.users_collection:
            owner.objects.unlink(item)
        collection.objects.link(item)
    return collection


def _read_blend(path: Path, name: str | None) -> _Read:
    """Read the named object of a .blend file, even if it is hidden; without a name all objects that renders show.

    Objects in no scene of the file count as shown.
    """
    is_rendered, unit = _shown_in(path)
    with being_opened(path), bpy.data.libraries.load(str(path), link=False) as (file_data, loaded_data):
        # Blender replaces the names in this list by the objects, when the block ends; None for what it can't load.
        loaded_data.objects = [
            object_name
            for object_name in file_data.objects
            if object_name == name or (name is None and is_rendered.get(object_name, True))
        ]
    objects = [item for item in loaded_data.objects if item is not None]
    if name is not None:
        for item in objects:
            item.hide_render = item.hide_viewport = False
    return _Read([item for item in objects if name is not None or not item.hide_render], unit)


def _shown_in(path: Path) -> tuple[dict[str, bool], float]:
    """Return by name whether renders show each object of a .blend file's scenes, and the length of the file's unit, m.

    Objects that are in no scene aren't included. The open file is left as it was.
    """
    earlier_libraries, earlier_scenes = set(bpy.data.libraries), set(bpy.data.scenes)
    with being_opened(path), bpy.data.libraries.load(str(path), link=True) as (file_data, loaded_data):
        loaded_data.scenes = list(file_data.scenes)
    file_scenes = [scene for scene in loaded_data.scenes if scene is not None]
    try:
        is_rendered: dict[str, bool] = {}
        for scene in file_scenes:
            rendered_names = {
                item.name for layer in scene.view_layers for item in rendered_objects(layer.layer_collection)
            }
            for item in scene.objects:
                is_rendered[item.name] = is_rendered.get(item.name, False) or item.name in rendered_names
        settings = [scene.unit_settings for scene in file_scenes if scene.unit_settings.system != "NONE"]
        return is_rendered, float(settings[0].scale_length) if settings else 1.0
    finally:
        new_libraries = [library for library in bpy.data.libraries if library not in earlier_libraries]
        bpy.data.batch_remove([scene for scene in file_scenes if scene not in earlier_scenes])
        bpy.data.batch_remove(new_libraries)


def rendered_objects(layer: bpy.types.LayerCollection) -> Iterator[bpy.types.Object]:
    """Yield the objects that renders show of a layer's collection and the collections in it."""
    if layer.exclude or layer.collection.hide_render:
        return
    yield from (item for item in layer.collection.objects if not item.hide_render)
    for child in layer.children:
        yield from rendered_objects(child)


def _read_glb(path: Path, _: str | None) -> _Read:
    """Return the objects of a .glb file."""
    return _import_objects(lambda: bpy.ops.import_scene.gltf(filepath=str(path)))


def _read_obj(path: Path, _: str | None) -> _Read:
    """Return the objects of an .obj file."""
    return _import_objects(lambda: bpy.ops.wm.obj_import(filepath=str(path)))


def _import_objects(run_importer: Callable[[], object]) -> _Read:
    """Run an importer; return the imported objects that renders show, and unlink the others."""
    earlier_objects = set(bpy.data.objects)
    run_importer()
    imported_objects = [item for item in bpy.data.objects if item not in earlier_objects]
    shown_objects = set(rendered_objects(bpy.context.view_layer.layer_collection))
    for item in imported_objects:
        if item not in shown_objects:  # such as shapes that the glTF importer draws bones with
            for owner in item.users_collection:
                owner.objects.unlink(item)
    return _Read([item for item in imported_objects if item in shown_objects])
