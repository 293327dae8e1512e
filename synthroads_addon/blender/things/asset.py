"""Free assets: objects out of .blend, .glb and .obj files, one instance of their collection per place.

Of a file that is placed which a render of it would show, in the metres that its unit stands for.
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
"""Custom property of an asset's collection: metres that a unit of its file stands for."""


class _Read(NamedTuple):
    """Objects out of a file, and the metres that one of its units stands for."""

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
            raise InputError(f"objects.{name}.name", item.name, f"the library {library} has no such asset")
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
        InputError: the file can't be read, or another file that it names lies outside of the library's folder.
    """
    path = library / asset.file
    key = f"{path}:{asset.object or ''}"
    for existing in bpy.data.collections:
        if existing.get(KEY) == key:
            return existing
    check_mesh_file(path, (library,), _REMEDY)
    before = loaded_data()
    read = {".blend": _read_blend, ".glb": _read_glb, ".obj": _read_obj}[path.suffix.lower()]
    try:
        with stderr_if_it_succeeds():
            objects, unit = run_in_caller(lambda: read(path, asset.object))  # importers need Blender's main thread
    except (OSError, RuntimeError) as error:
        raise InputError(str(path), None, f"cannot be read as an asset ({error_line(error)})") from None
    if not objects:
        raise InputError(str(path), asset.object, "holds no such object" if asset.object else "shows no objects")
    if path.suffix.lower() != ".blend":  # which names files as Blender shows it
        check_references(path, (path.parent, library), _REMEDY, before)
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
    """Return the named object of a .blend file, even a hidden one; without a name all that its renders show."""
    shown, unit = _shown_in(path)
    with being_opened(path), bpy.data.libraries.load(str(path), link=False) as (there, here):
        here.objects = [item for item in there.objects if item == name or (name is None and shown.get(item, True))]
    objects = [item for item in here.objects if item is not None]
    if name is not None:
        for item in objects:
            item.hide_render = item.hide_viewport = False
    return _Read([item for item in objects if name is not None or not item.hide_render], unit)


def _shown_in(path: Path) -> tuple[dict[str, bool], float]:
    """Return whether renders of a .blend file's scenes show each of their objects, and the metres of its unit.

    Objects that are in none of its scenes aren't among them. The open file is left as it was.
    """
    libraries, scenes = set(bpy.data.libraries), set(bpy.data.scenes)
    with being_opened(path), bpy.data.libraries.load(str(path), link=True) as (there, here):
        here.scenes = list(there.scenes)
    file_scenes = [scene for scene in here.scenes if scene is not None]
    try:
        shown: dict[str, bool] = {}
        for scene in file_scenes:
            rendered = {item.name for layer in scene.view_layers for item in rendered_objects(layer.layer_collection)}
            for item in scene.objects:
                shown[item.name] = shown.get(item.name, False) or item.name in rendered
        settings = [scene.unit_settings for scene in file_scenes if scene.unit_settings.system != "NONE"]
        return shown, float(settings[0].scale_length) if settings else 1.0
    finally:
        new = [library for library in bpy.data.libraries if library not in libraries]
        bpy.data.batch_remove([scene for scene in file_scenes if scene not in scenes])
        bpy.data.batch_remove(new)


def rendered_objects(layer: bpy.types.LayerCollection) -> Iterator[bpy.types.Object]:
    """Yield the objects of a layer's collection, and of those in it, that renders show."""
    if layer.exclude or layer.collection.hide_render:
        return
    yield from (item for item in layer.collection.objects if not item.hide_render)
    for child in layer.children:
        yield from rendered_objects(child)


def _read_glb(path: Path, _: str | None) -> _Read:
    return _import_objects(lambda: bpy.ops.import_scene.gltf(filepath=str(path)))


def _read_obj(path: Path, _: str | None) -> _Read:
    return _import_objects(lambda: bpy.ops.wm.obj_import(filepath=str(path)))


def _import_objects(run: Callable[[], object]) -> _Read:
    """Run an importer; return the objects that it added to the file and that are rendered; others are left aside."""
    before = set(bpy.data.objects)
    run()
    added = [item for item in bpy.data.objects if item not in before]
    shown = set(rendered_objects(bpy.context.view_layer.layer_collection))
    for item in added:
        if item not in shown:  # as what a glTF importer draws bones with
            for owner in item.users_collection:
                owner.objects.unlink(item)
    return _Read([item for item in added if item in shown])
