"""Classes that a scheme tells apart beyond the full table, given to the faces of a scene: see `ClassSelector`."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ...base.class_mapping import fits_pattern
from ...base.classes import ClassScheme, ClassSelector, class_id
from ...base.errors import InputError, nearest_name
from ...materials.table import entry_of
from ...road.instances import InstanceNumbers
from ...road.objects import RoadObject
from ...road.parameters import AnyObject, RoadParameters
from ...road.things.asset import Asset
from .mesh import SceneMesh
from .motion import ScannedScene

_TYPES: dict[str, type[RoadObject]] = {
    kind.model_fields["type"].default: kind for kind in get_args(get_args(AnyObject)[0])
}
"""Every type of object of a parameter set."""


def check_selectors(scheme: ClassScheme, source: str) -> None:
    """Raise `InputError` if a class scheme's selector names an unknown type of thing or a field it hasn't.

    Args:
        scheme: of classes.
        source: its file.
    """
    for number, selector in scheme.selectors():
        field = f"{source}: {scheme.fine[number].name}.of"
        if selector.thing and selector.thing not in _TYPES:
            hint = nearest_name(selector.thing, _TYPES)
            raise InputError(f"{field}.thing", selector.thing, f"must be one of {', '.join(_TYPES)}{hint}")
        for name in selector.where:
            fields = _TYPES[selector.thing or ""].model_fields
            if name not in fields:
                hint = nearest_name(name, fields)
                raise InputError(f"{field}.where", name, f"must be a field of {selector.thing}{hint}")


def check_asset_classes(scheme: ClassScheme, road: RoadParameters) -> None:
    """Raise `InputError`, naming the asset, if a road's free asset has a class that the scheme lacks."""
    class_names = scheme.source_ids()
    for name, item in road.of_type(Asset).items():
        if item.class_name not in class_names:
            hint = nearest_name(item.class_name, class_names)
            asset_title = f"{item.name} of {item.library}"
            choices = ", ".join(class_names)
            remedy = f"{asset_title}: must be a class of the scheme {scheme.name} (cloud.classes): {choices}{hint}"
            raise InputError(f"objects.{name}.class_name", item.class_name, remedy)


def classify_scene(scene: ScannedScene, scheme: ClassScheme, road: RoadParameters | None) -> ScannedScene:
    """Return a scene whose faces have the classes of a scheme's selectors; the first that fits a face counts.

    Args:
        scene: its faces have classes of the full table.
        scheme: one without selectors returns the scene itself.
        road: that the scene shows; without one nothing is a thing or an asset.
    """
    selectors = list(scheme.selectors())
    if not selectors:
        return scene
    numbers = InstanceNumbers(road) if road else None
    rules = [_Rule(number, selector, _object_ids(selector, road), numbers) for number, selector in selectors]
    moving = tuple(replace(body, mesh=_classify(body.mesh, rules)) for body in scene.moving)
    return replace(scene, static=_classify(scene.static, rules), moving=moving)


@dataclass(frozen=True)
class _Rule:
    """A class selector bound to a road's objects, with the class id that it gives.

    Attributes:
        number: ``class_id`` of what it finds.
        selector: what it looks for.
        names: ids of the objects that it means; None if it means no objects in particular.
        numbers: of the road's objects.
    """

    number: int
    selector: ClassSelector
    names: frozenset[str] | None
    numbers: InstanceNumbers | None

    def fits(self, mesh: SceneMesh) -> NDArray[np.bool_]:
        """Return a mask (T,) of the mesh's faces that the selector matches."""
        mask = np.ones(len(mesh), dtype=bool)
        if self.selector.class_name is not None:
            mask &= mesh.class_id == class_id(self.selector.class_name)
        if self.selector.material is not None:
            materials = [fits_pattern(entry_of(name), self.selector.material) for name in mesh.materials]
            mask &= np.array(materials, dtype=bool)[mesh.material]
        if self.names is not None:
            present, faces = np.unique(mesh.instance_id, return_inverse=True)
            owners = [self.numbers.owner(number) if self.numbers else None for number in present.tolist()]
            mask &= np.array([owner in self.names for owner in owners], dtype=bool)[faces]
        return mask


def _classify(mesh: SceneMesh, rules: Iterable[_Rule]) -> SceneMesh:
    """Return a mesh with the class of the first rule that fits each face; other faces keep theirs."""
    class_ids = mesh.class_id.copy()
    for rule in reversed(list(rules)):
        class_ids[rule.fits(mesh)] = rule.number
    return replace(mesh, class_id=class_ids)


def _object_ids(selector: ClassSelector, road: RoadParameters | None) -> frozenset[str] | None:
    """Return the ids of the road's objects that a selector matches; None if it says nothing of objects."""
    if selector.thing is None and selector.asset is None:
        return None
    items = road.objects.items() if road else ()
    return frozenset(name for name, item in items if _means(selector, item))


def _means(selector: ClassSelector, item: RoadObject) -> bool:
    """Return whether a selector matches an object: its asset, its type, and its fields' values."""
    if selector.asset is not None and not (isinstance(item, Asset) and fits_pattern(item.name, selector.asset)):
        return False
    if selector.thing is not None and not isinstance(item, _TYPES[selector.thing]):
        return False
    return all(fits_pattern(str(getattr(item, name)), pattern) for name, pattern in selector.where.items())
