"""Evaluated scenes as triangles: scenes that are not ours."""

from __future__ import annotations

import tracemalloc
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from synthroads_addon.base.class_mapping import ClassMapping
from synthroads_addon.base.classes import UNLABELLED, class_id, classes
from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.materials import material
from synthroads_addon.blender.scene import evaluated
from synthroads_addon.blender.scene.evaluated import scanned_scene, scene_mesh
from synthroads_addon.blender.scene.reading import MeshCopy, copy_mesh
from synthroads_addon.blender.things.meshes import fill
from synthroads_addon.blender.things.model_builder import SUPPORT
from synthroads_addon.scanning.scene.mesh import SceneMesh

CUBE = [(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def add_cube(name: str = "Cube", collection: bpy.types.Collection | None = None) -> bpy.types.Object:
    """Add a cube of 2 m edges whose faces look outwards."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(CUBE, [], FACES)
    item = bpy.data.objects.new(name, mesh)
    (collection or bpy.context.scene.collection).objects.link(item)
    return item


def volume(mesh: SceneMesh) -> float:
    """Return the volume inside a closed mesh; negative if its faces look inwards."""
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    return float(np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0)


class TestForeignScene:
    def test_an_empty_scene_has_no_triangles(self) -> None:
        mesh = scene_mesh()
        assert len(mesh) == 0
        assert mesh.origin.tolist() == [0.0, 0.0, 0.0]

    def test_a_cube_with_a_custom_property(self) -> None:
        cube = add_cube()
        cube.matrix_world = Matrix.Translation((10.0, 20.0, 30.0)) @ Matrix.Diagonal((1.0, 2.0, 3.0, 1.0))
        cube["synthroads_class"] = "vehicle"
        cube["synthroads_instance"] = 2**31 - 1
        mesh = scene_mesh()
        assert len(mesh) == 12
        assert set(mesh.class_id) == {class_id("vehicle")}
        assert set(mesh.instance_id) == {2**31 - 1}
        assert mesh.vertices.min(axis=0).tolist() == [9.0, 18.0, 27.0]
        assert volume(mesh) == pytest.approx(48.0)
        assert mesh.areas().sum() == pytest.approx(2 * (8 + 12 + 24))
        assert mesh.materials == ("unknown",)

    def test_a_collection_named_after_a_class(self) -> None:
        outer = bpy.data.collections.new("pole")
        inner = bpy.data.collections.new("Inner")
        bpy.context.scene.collection.children.link(outer)
        outer.children.link(inner)
        add_cube("A", inner)
        add_cube("B", inner)["synthroads_class"] = "utility"
        add_cube("C")
        mesh = scene_mesh()
        found = {int(label) for label in mesh.class_id}
        assert found == {class_id("pole"), class_id("utility"), UNLABELLED}

    def test_an_unknown_class_is_refused_by_name(self) -> None:
        add_cube("Wrong")["synthroads_class"] = "lorry"
        with pytest.raises(InputError, match=r"Wrong: synthroads_class is 'lorry'"):
            scene_mesh()

    def test_face_attributes_come_before_the_objects_class(self) -> None:
        cube = add_cube()
        cube["synthroads_class"] = "vehicle"
        for name, values in {"class_id": [1, 2, 3, 4, 300, -1], "instance_id": [5, 6, 7, 8, 9, -1]}.items():
            cube.data.attributes.new(name, "INT", "FACE").data.foreach_set("value", values)
        mesh = scene_mesh()
        assert mesh.class_id.tolist() == [1, 1, 2, 2, 3, 3, 4, 4, 255, 255, 255, 255]
        assert mesh.instance_id[::2].tolist() == [5, 6, 7, 8, 9, 2**32 - 1]

    def test_an_instanced_collection(self) -> None:
        source = bpy.data.collections.new("Source")
        add_cube("Part", source)["synthroads_class"] = "bridge"
        for x in (0.0, 5.0, 10.0):
            empty = bpy.data.objects.new("Empty", None)
            empty.instance_type, empty.instance_collection = "COLLECTION", source
            empty.location.x = x
            bpy.context.scene.collection.objects.link(empty)
        bpy.context.scene.collection.objects[-1].scale.x = -1.0
        mesh = scene_mesh()
        assert len(mesh) == 36
        assert set(mesh.class_id) == {class_id("bridge")}
        assert sorted(set(mesh.vertices[:, 0])) == [-1.0, 1.0, 4.0, 6.0, 9.0, 11.0]
        assert volume(mesh) == pytest.approx(24.0)

    def test_instances_of_geometry_nodes(self) -> None:
        from synthroads_addon.blender.nodes.builder import Tree, node_group

        def build(tree: Tree) -> None:
            """Cubes on points."""
            points = tree.node("GeometryNodeMeshLine", count=5, offset=(3.0, 0.0, 0.0)).value
            cube = tree.node("GeometryNodeMeshCube").value
            tree.output("Mesh", tree.node("GeometryNodeInstanceOnPoints", points, instance=cube).value)

        item = bpy.data.objects.new("Row", bpy.data.meshes.new("Row"))
        item["synthroads_class"] = "barrier"
        bpy.context.scene.collection.objects.link(item)
        item.modifiers.new("Nodes", "NODES").node_group = node_group("Cubes", build)
        mesh = scene_mesh()
        assert len(mesh) == 60
        assert set(mesh.class_id) == {class_id("barrier")}
        assert mesh.vertices[:, 0].max() == pytest.approx(12.5)

    def test_curves_and_modifiers_are_evaluated(self) -> None:
        curve = bpy.data.curves.new("Pipe", "CURVE")
        curve.dimensions, curve.bevel_depth = "3D", 0.5
        spline = curve.splines.new("POLY")
        spline.points.add(1)
        spline.points[1].co = (10.0, 0.0, 0.0, 1.0)
        pipe = bpy.data.objects.new("Pipe", curve)
        bpy.context.scene.collection.objects.link(pipe)
        cube = add_cube()
        cube.modifiers.new("Array", "ARRAY").count = 3
        assert len(scene_mesh(objects=[cube])) == 36
        tube = scene_mesh(objects=[pipe])
        assert tube.vertices[:, 0].max() == pytest.approx(10.0)
        assert tube.areas().sum() == pytest.approx(np.pi * 10.0, rel=0.1)

    def test_hidden_and_support_objects_are_left_out(self) -> None:
        add_cube("Hidden").hide_render = True
        add_cube("Support")[SUPPORT] = True
        bpy.data.objects.new("Nowhere", bpy.data.meshes.new("Nowhere"))
        add_cube("Seen").location.x = 100.0
        assert scene_mesh().vertices[:, 0].min() == pytest.approx(99.0)

    def test_degenerate_triangles_are_dropped(self) -> None:
        mesh = bpy.data.meshes.new("Flat")
        places = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (1, 0, 0)]
        mesh.from_pydata(places, [], [(0, 1, 2, 3), (0, 1, 4), (1, 5, 2)])
        item = bpy.data.objects.new("Flat", mesh)
        item["synthroads_class"] = "road"
        bpy.context.scene.collection.objects.link(item)
        assert len(scene_mesh()) == 2

    def test_vertices_that_are_not_finite_are_refused_by_name(self) -> None:
        add_cube("Broken").data.vertices[3].co.y = float("nan")
        with pytest.raises(InputError, match="Broken: vertices"):
            scene_mesh()

    def test_the_scene_is_left_as_it_was(self) -> None:
        cube = add_cube()
        cube.modifiers.new("Array", "ARRAY")
        before = (len(bpy.data.meshes), len(bpy.data.objects), len(cube.data.vertices))
        scene_mesh()
        assert (len(bpy.data.meshes), len(bpy.data.objects), len(cube.data.vertices)) == before

    def test_another_scene_than_the_current_one(self) -> None:
        other = bpy.data.scenes.new("Other")
        mesh = bpy.data.meshes.new("There")
        mesh.from_pydata(CUBE, [], FACES)
        other.collection.objects.link(bpy.data.objects.new("There", mesh))
        add_cube("Here").modifiers.new("Array", "ARRAY").count = 2
        assert len(scene_mesh(other)) == 12
        assert len(scene_mesh(bpy.context.scene)) == 24
        assert len(scene_mesh(bpy.context.evaluated_depsgraph_get())) == 24


class TestClassesByName:
    def classes_of(self, mapping: ClassMapping) -> dict[str, int]:
        """Return the class of each object's faces, told apart by the property that numbers the objects."""
        mesh = scene_mesh(classes=mapping)
        names = {item["synthroads_instance"]: item.name for item in bpy.data.objects}
        pairs = set(zip(mesh.instance_id.tolist(), mesh.class_id.tolist(), strict=True))
        assert len(pairs) == len(names)
        return {names[number]: label for number, label in pairs}

    def numbered(self, *items: bpy.types.Object) -> None:
        for number, item in enumerate(items, 1):
            item["synthroads_instance"] = number

    def test_objects_by_patterns(self) -> None:
        self.numbered(add_cube("Tree.001"), add_cube("Tree.002"), add_cube("Pole"), add_cube("pole"))
        mapping = ClassMapping(objects={"Tree.002": "barrier", "Tree*": "vegetation", "P???": "pole"})
        wanted = {"Tree.001": "vegetation", "Tree.002": "barrier", "Pole": "pole"}
        expected = {name: class_id(label) for name, label in wanted.items()} | {"pole": UNLABELLED}
        assert self.classes_of(mapping) == expected

    def test_what_stands_nearer_to_the_face_wins(self) -> None:
        """One way after the other to have a class is taken away."""
        outer, inner = bpy.data.collections.new("Outer"), bpy.data.collections.new("vehicle")
        bpy.context.scene.collection.children.link(outer)
        outer.children.link(inner)
        item = add_cube("House", inner)
        item["synthroads_class"] = "pole"
        item.data.materials.append(bpy.data.materials.new("Lack"))
        item.data.attributes.new("class_id", "INT", "FACE").data.foreach_set("value", [class_id("ground")] * 6)
        mapping = {"objects": {"H*": "barrier"}, "materials": {"L*": "utility"}, "collections": {"O*": "bridge"}}

        def found() -> set[str]:
            names = {row.id: row.name for row in classes()} | {UNLABELLED: "none"}
            bpy.context.view_layer.update()
            return {names[number] for number in scene_mesh(classes=ClassMapping.from_dict(mapping)).class_id.tolist()}

        assert found() == {"ground"}
        item.data.attributes.remove(item.data.attributes["class_id"])
        assert found() == {"barrier"}
        del mapping["objects"]
        assert found() == {"pole"}
        del item["synthroads_class"]
        assert found() == {"utility"}
        del mapping["materials"]
        assert found() == {"bridge"}
        del mapping["collections"]
        assert found() == {"vehicle"}
        inner.name = "Garage"
        assert found() == {"none"}

    def test_materials_per_face(self) -> None:
        cube = add_cube("House")
        for item in ("Brick", "Ivy", "Ivy.001"):
            cube.data.materials.append(bpy.data.materials.new(item))
        cube.data.polygons.foreach_set("material_index", [0, 0, 1, 1, 2, 2])
        mesh = scene_mesh(classes=ClassMapping(materials={"Ivy*": "vegetation"}))
        assert mesh.class_id.tolist() == [UNLABELLED] * 4 + [class_id("vegetation")] * 8
        mesh = scene_mesh(classes=ClassMapping(materials={"Ivy": "vegetation"}, objects={"House": "bridge"}))
        assert set(mesh.class_id) == {class_id("bridge")}

    def test_the_innermost_collection_counts(self) -> None:
        outer, inner = (bpy.data.collections.new(name) for name in ("Town", "Park"))
        bpy.context.scene.collection.children.link(outer)
        outer.children.link(inner)
        self.numbered(add_cube("House", outer), add_cube("Bush", inner))
        found = self.classes_of(ClassMapping(collections={"Park": "vegetation", "T*": "bridge"}))
        assert found == {"House": class_id("bridge"), "Bush": class_id("vegetation")}

    def test_collections_that_are_only_shown_as_instances(self) -> None:
        source, inner = bpy.data.collections.new("Lamp"), bpy.data.collections.new("pole")
        source.children.link(inner)
        add_cube("Head", source)
        add_cube("Mast", inner)
        empty = bpy.data.objects.new("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", source
        bpy.context.scene.collection.objects.link(empty)
        assert set(scene_mesh().class_id) == {class_id("pole"), UNLABELLED}
        found = set(scene_mesh(classes=ClassMapping(collections={"Lamp": "utility"})).class_id)
        assert found == {class_id("utility")}
        assert set(scene_mesh(classes=ClassMapping(objects={"Empty": "bridge"})).class_id) == {class_id("bridge")}

    def test_patterns_that_nothing_matched_are_told(self) -> None:
        add_cube("House").data.materials.append(bpy.data.materials.new("Brick"))
        add_cube("Unseen").hide_render = True
        mapping = ClassMapping(
            objects={"H*": "bridge", "House": "pole", "Unseen": "pole"},
            materials={"Brick": "bridge", "Lack*": "vehicle"},
            collections={"Town": "bridge"},
        )
        assert scanned_scene(classes=mapping).unmatched == ("objects: Unseen", "materials: Lack*", "collections: Town")
        assert scanned_scene().unmatched == ()


class TestNumbers:
    def test_objects_without_a_number_get_one_in_the_order_of_their_names(self) -> None:
        add_cube("C"), add_cube("A")
        add_cube("B")["synthroads_instance"] = 2
        faces = add_cube("D")
        faces.data.attributes.new("instance_id", "INT", "FACE").data.foreach_set("value", [1, 1, 1, 9, 9, 9])
        place = {"A": -30.0, "B": 0.0, "C": 30.0, "D": 60.0}
        for name, x in place.items():
            bpy.data.objects[name].location.x = x
        mesh = scene_mesh(number_objects=True)
        x = mesh.vertices[mesh.triangles[:, 0], 0]
        found = {name: set(mesh.instance_id[np.abs(x - at) < 5.0].tolist()) for name, at in place.items()}
        assert found == {"A": {3}, "B": {2}, "C": {4}, "D": {1, 9}}
        assert set(scene_mesh().instance_id.tolist()) == {0, 1, 2, 9}

    def test_what_shows_a_collection_is_one_object(self) -> None:
        source = bpy.data.collections.new("Source")
        add_cube("Part", source), add_cube("Other part", source)
        for name in ("Second", "First"):
            empty = bpy.data.objects.new(name, None)
            empty.instance_type, empty.instance_collection = "COLLECTION", source
            empty.location.x = 100.0 if name == "First" else 0.0
            bpy.context.scene.collection.objects.link(empty)
        mesh = scene_mesh(number_objects=True)
        assert len(mesh) == 48
        first = mesh.vertices[mesh.triangles[:, 0], 0] > 50.0
        assert set(mesh.instance_id[first]) == {1}
        assert set(mesh.instance_id[~first]) == {2}

    @pytest.mark.parametrize("value", [1.5, "seven", (1, 2)])
    def test_wrong_numbers_are_refused_by_name(self, value: object) -> None:
        add_cube("Wrong")["synthroads_instance"] = value
        with pytest.raises(InputError, match="Wrong: synthroads_instance"):
            scene_mesh()


class TestSize:
    def grid(self, side: int, triangles: bool) -> bpy.types.Object:
        across = np.arange(side + 1, dtype=np.float32)
        x, y = (values.ravel() for values in np.meshgrid(across, across, indexing="ij"))
        corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
        faces = np.stack([corner, corner + side + 1, corner + side + 2, corner + 1], axis=1)
        if triangles:
            faces = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
        mesh = bpy.data.meshes.new("Grid")
        fill(mesh, np.stack([x, y, 0.0 * x], axis=1).astype(np.float64), faces=faces)
        item = bpy.data.objects.new("Grid", mesh)
        bpy.context.scene.collection.objects.link(item)
        return item

    @pytest.mark.parametrize("triangles", [True, False])
    @pytest.mark.parametrize("moved", [True, False])
    def test_reading_takes_little_memory(self, triangles: bool, moved: bool) -> None:
        """NumPy's arrays at their peak, per triangle; the result alone has 25 bytes."""
        item = self.grid(300, triangles)
        item.location.x = 3.0 if moved else 0.0
        for name in ("class_id", "instance_id"):
            item.data.attributes.new(name, "INT", "FACE").data.foreach_set("value", [3] * len(item.data.polygons))
        bpy.context.view_layer.update()
        tracemalloc.start()
        mesh = scene_mesh()
        peak = tracemalloc.get_traced_memory()[1] / len(mesh)
        tracemalloc.stop()
        print(f"{peak:.0f} bytes per triangle")
        assert len(mesh) == 180_000
        assert mesh.areas().sum() == pytest.approx(300.0**2, rel=1e-5)
        assert peak < 150.0

    def test_triangles_and_quads_give_the_same_surface(self) -> None:
        meshes = []
        for triangles in (True, False):
            item = self.grid(20, triangles)
            meshes.append(scene_mesh(objects=[item]))
        assert np.array_equal(meshes[0].vertices, meshes[1].vertices)
        assert {tuple(sorted(row)) for row in meshes[0].triangles.tolist()} == {
            tuple(sorted(row)) for row in meshes[1].triangles.tolist()
        }

    def test_a_mesh_that_many_use_is_read_once(self, monkeypatch: pytest.MonkeyPatch) -> None:
        mesh = add_cube("0").data
        for number in range(1, 500):
            item = bpy.data.objects.new(str(number), mesh)
            item.location.x, item.scale.y = 3.0 * number, -1.0 if number % 2 else 1.0
            item["synthroads_instance"] = number
            bpy.context.scene.collection.objects.link(item)
        read: list[str] = []

        def counted(name: str, *rest: Any) -> MeshCopy:
            read.append(name)
            return copy_mesh(name, *rest)

        monkeypatch.setattr(evaluated, "copy_mesh", counted)
        whole = scene_mesh()
        assert len(read) == 1
        assert len(whole) == 12 * 500
        assert np.unique(whole.instance_id).tolist() == list(range(500))
        middle = whole.vertices[whole.triangles].mean(axis=1)
        assert np.abs(middle[:, 0] - 3.0 * whole.instance_id).max() <= 1.0
        assert volume(whole) == pytest.approx(8.0 * 500, rel=1e-4)


class TestMaterials:
    def test_slots_keep_their_faces(self) -> None:
        cube = add_cube()
        own = bpy.data.materials.new("Own paint")
        for item in (material("asphalt"), own, None):
            cube.data.materials.append(item)
        cube.data.polygons.foreach_set("material_index", [0, 0, 1, 1, 2, 2])
        mesh = scene_mesh()
        names = [mesh.materials[index] for index in mesh.material]
        assert names == ["asphalt"] * 4 + ["Own paint"] * 4 + ["unknown"] * 4

    def test_a_material_of_the_object_wins(self) -> None:
        cube = add_cube()
        cube.data.materials.append(material("asphalt"))
        twin = bpy.data.objects.new("Twin", cube.data)
        bpy.context.scene.collection.objects.link(twin)
        twin.material_slots[0].link = "OBJECT"
        twin.material_slots[0].material = material("leaves")
        mesh = scene_mesh()
        assert {mesh.materials[index] for index in mesh.material} == {"asphalt", "leaves"}
