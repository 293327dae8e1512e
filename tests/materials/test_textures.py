"""Folders of textures: what is found in them, what is refused, and which set a road takes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.materials.textures import TEXTURE_LAYERS, texture_files, texture_sets
from synthroads_addon.road.surroundings import MaterialTexture, MaterialVariation
from synthroads_addon.sampling.surroundings import sample_materials
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.scenes.texture_folder import plain, write_png, write_set

GREY = plain(128, 128, 128)


def folder_of_sets(folder: Path) -> str:
    """Return a folder of textures with three sets of asphalt and one of verges."""
    for name in ("fresh", "old", "worn"):
        write_set(folder / "asphalt" / name, base_color=GREY)
    write_set(folder / "verge", 3.5, base_color=GREY, normal=GREY)
    (folder / "LICENCE.txt").write_text("none", encoding="utf-8")
    (folder / ".git").mkdir()
    return str(folder)


def test_sets_are_found_by_material_with_the_size_that_the_nearest_file_says(tmp_path: Path) -> None:
    folder = folder_of_sets(tmp_path)
    (tmp_path / "asphalt" / "texture.json").write_text('{"tile": 1.5}', encoding="utf-8")
    (tmp_path / "asphalt" / "old" / "texture.json").write_text('{"tile": 4}', encoding="utf-8")
    sets = texture_sets(folder)
    assert {name: [(Path(s.folder).name, s.tile) for s in found] for name, found in sets.items()} == {
        "asphalt": [("fresh", 1.5), ("old", 4.0), ("worn", 1.5)],
        "verge": [("verge", 3.5)],
    }
    assert list(texture_files(sets["verge"][0].folder)) == ["base_color", "normal"]
    write_set(tmp_path / "soil", base_color=GREY)
    assert texture_sets(folder)["soil"][0].tile == MaterialTexture(material="soil", folder="x").tile == 2.0


def test_the_seed_chooses_among_a_materials_sets_and_whatever_else_is_drawn_stays(tmp_path: Path) -> None:
    limits = RoadScenario(textures=folder_of_sets(tmp_path))
    drawn = [sample_materials(limits, seed) for seed in range(30)]
    chosen = [Path(variation.textures[0].folder).name for variation in drawn]
    assert {chosen.count(name) > 4 for name in ("fresh", "old", "worn")} == {True}
    assert drawn[7] == sample_materials(limits, 7)
    assert {[texture.material for texture in variation.textures][-1] for variation in drawn} == {"verge"}
    without = sample_materials(RoadScenario(), 7)
    assert without.textures == ()
    assert drawn[7].model_copy(update={"textures": ()}) == without
    assert MaterialVariation.from_dict(json.loads(drawn[7].to_json())) == drawn[7]


@pytest.mark.parametrize(
    ("made", "message"),
    [
        ("ashpalt/base_color.png", r"ashpalt: no material of the table has this name \(did you mean 'asphalt'\?\)$"),
        ("asphalt/rougness.png", r"rougness.png: an image must be named after a layer: .*\(did you mean 'roughness'"),
        ("asphalt/old/notes.txt", r"old: holds no image of a layer: base_color, roughness, .* with one of \.png"),
        ("asphalt/base_color.gif", r"asphalt: holds no image of a layer"),
        ("LICENCE.txt", r"must hold a folder named after a material of the table, such as asphalt$"),
    ],
)
def test_what_is_wrong_in_a_folder_is_named_in_one_line(tmp_path: Path, made: str, message: str) -> None:
    write_png(tmp_path / made, GREY)
    with pytest.raises(InputError, match=message) as error:
        texture_sets(str(tmp_path))
    assert "\n" not in str(error.value)


def test_a_folder_or_an_image_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"nowhere: a folder of textures is needed here \(No such file"):
        sample_materials(RoadScenario(textures=str(tmp_path / "nowhere")), 1)
    with pytest.raises(MissingFileError, match="null"):
        texture_sets("a\0b")
    image = tmp_path / "asphalt" / "base_color.png"
    write_png(image, GREY)
    image.write_bytes(b"GIF89a")
    with pytest.raises(InputError, match=r"base_color.png: is no PNG, JPEG, OpenEXR or TIFF image$"):
        texture_sets(str(tmp_path))
    image.unlink()
    image.symlink_to(tmp_path / "gone.png")
    with pytest.raises(MissingFileError, match=r"base_color.png: an image is needed here \(No such file"):
        texture_sets(str(tmp_path))


def test_a_layer_has_one_image_a_material_one_set_and_a_tile_a_size(tmp_path: Path) -> None:
    write_set(tmp_path / "asphalt", 0.0, base_color=GREY)
    with pytest.raises(InputError, match=r"texture.json: tile is 0"):
        texture_sets(str(tmp_path))
    write_set(tmp_path / "asphalt", 1.0)
    write_png(tmp_path / "asphalt" / "Base_Color.JPG", GREY)
    with pytest.raises(InputError, match="gives the same layer: leave one of them out"):
        texture_sets(str(tmp_path))
    one = {"material": "asphalt", "folder": "a"}
    with pytest.raises(InputError, match="textures has 'asphalt' twice"):
        MaterialVariation.from_dict({"textures": [one, one | {"folder": "b"}]})
    assert TEXTURE_LAYERS[0] == "base_color"
