"""Classes by the names of things."""

from __future__ import annotations

import pytest

from synthroads_addon.base.class_mapping import ClassMapping, NameClasses
from synthroads_addon.base.classes import class_id
from synthroads_addon.base.errors import InputError


def test_the_first_pattern_that_fits_counts() -> None:
    names = NameClasses(ClassMapping(objects={"Tree.1": "pole", "Tree*": "vegetation", "*": "bridge"}))
    found = [names.find("objects", name) for name in ("Tree.1", "Tree.2", "tree")]
    assert found == [class_id(name) for name in ("pole", "vegetation", "bridge")]
    assert names.find("materials", "Tree.1") is None


def test_the_first_name_that_has_a_class_counts() -> None:
    names = NameClasses(ClassMapping(objects={"B": "pole", "C": "bridge"}))
    assert names.find("objects", "A", "B", "C") == class_id("pole")
    assert names.find("objects", "A") is None


def test_patterns_are_those_of_a_shell_and_case_matters() -> None:
    names = NameClasses(ClassMapping(materials={"[Ss]ign.???": "road_sign"}))
    fits = {name: names.find("materials", name) is not None for name in ("Sign.001", "sign.abc", "SIGN.001", "Sign.01")}
    assert fits == {"Sign.001": True, "sign.abc": True, "SIGN.001": False, "Sign.01": False}


def test_a_pattern_for_numbered_copies_fits_the_first_one_too() -> None:
    names = NameClasses(ClassMapping(objects={"Lamp.*": "pole"}))
    fits = {name: names.find("objects", name) is not None for name in ("Lamp", "Lamp.001", "Lamps", "lamp", "A Lamp")}
    assert fits == {"Lamp": True, "Lamp.001": True, "Lamps": False, "lamp": False, "A Lamp": False}


def test_classes_are_those_of_a_scheme() -> None:
    mapping = ClassMapping(objects={"Bank*": "bench"})
    assert NameClasses(mapping, {"bench": 254}).find("objects", "Bank.002") == 254
    mapping.check({"bench": 254}, "classes.json")
    with pytest.raises(InputError, match=r"classes.json: objects.Bank\* is 'bench': must be one of .*'beach'"):
        mapping.check(["ground", "beach"], "classes.json")


def test_a_pattern_that_a_stronger_one_hides_has_matched() -> None:
    names = NameClasses(ClassMapping(objects={"*": "pole", "Tree*": "vegetation", "Car*": "vehicle"}))
    names.find("objects", "Tree")
    assert names.unmatched_patterns() == ("objects: Car*",)


def test_without_a_mapping_nothing_is_found() -> None:
    names = NameClasses(None)
    assert names.find("objects", "Tree") is None
    assert names.unmatched_patterns() == ()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"object": {}}, "unknown key 'object'.*did you mean 'objects'"),
        ({"materials": {"Lack": 3}}, "materials.Lack is 3"),
        ({"collections": ["pole"]}, "collections"),
        ([], "must be a JSON object"),
    ],
)
def test_wrong_mappings_are_refused(data: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ClassMapping.from_dict(data, "classes.json")
