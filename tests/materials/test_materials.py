"""The material table's optical fields, and what age, wear and rain do to them."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.materials.reflectance import facet_slope, facet_terms, returned_share
from synthroads_addon.materials.table import Material, material_table_path, materials, read_material_table
from synthroads_addon.materials.variation import vary_material
from synthroads_addon.road.surroundings import Environment, MaterialVariation

DRY, WET = Environment(), Environment(wetness=1.0)
MEAN = MaterialVariation()
PAINTS = ("paint_white", "paint_yellow")


def returned(material: Material, degrees: float) -> float:
    """Return the effective reflectance at an incidence angle: what comes back, of a perfect diffuser's at 0 degrees."""
    lobe = 1.0 / math.radians(material.retro_lobe_deg) ** 2
    cosine = math.cos(math.radians(degrees))
    share = returned_share(cosine, material.reflectivity, *facet_terms(material.slope), material.retroreflection, lobe)
    return float(share[0])


def test_no_surface_gives_back_more_than_it_gets() -> None:
    """Transmitted and scattered light share the light; retro-reflection only gathers it in one direction."""
    for name, material in materials().items():
        taken = 1.0 - material.transmission
        assert taken * material.reflectivity + material.transmission < 1.0, name


def test_what_lets_light_through() -> None:
    through = {name: row.transmission for name, row in materials().items() if row.transmission > 0}
    leaves = {name for name in materials() if name.endswith("leaves")}
    assert set(through) == {*leaves, "grass", "meadow", "ryegrass", "reed", "glass", "acrylic_glass", "wire_mesh"}
    assert all(0.1 <= through[name] <= 0.3 for name in leaves)
    assert {name for name, row in materials().items() if row.gap_size > 0.0} == leaves
    # Twice 85 % of a window, twice 92 % of acrylic glass.
    assert through["glass"] == pytest.approx(0.85**2, abs=0.01)
    assert through["acrylic_glass"] == pytest.approx(0.92**2, abs=0.01)


def test_slope_is_given_or_follows_from_the_roughness() -> None:
    rough = materials()["soil"]
    assert rough.facet_slope is None
    assert rough.slope == float(facet_slope(rough.roughness))
    measured = {"asphalt": (0.2, 0.35), "concrete": (0.15, 0.25), "paint_white": (0.1, 0.2)}
    for name, (low, high) in (measured | {"galvanised_steel": (0.03, 0.08)}).items():
        assert low <= materials()[name].slope <= high, name
        assert materials()[name].slope != float(facet_slope(materials()[name].roughness))


def test_retroreflectors_are_where_road_users_need_them() -> None:
    retro = {name: row.retroreflection for name, row in materials().items() if row.retroreflection > 0}
    sheeting = {f"sheeting_{color}" for color in ("white", "yellow", "red", "blue", "grey", "green")}
    assert set(retro) == {*sheeting, *PAINTS, "reflector", "number_plate"}
    assert all(50 <= retro[name] <= 1000 for name in sheeting | {"reflector", "number_plate"})
    assert max(sheeting, key=lambda name: retro[name]) == "sheeting_white"


def test_sheeting_falls_off_as_the_standard_allows() -> None:
    """EN 12899-1, class RA2, white, 12': 250, 150, 110 cd/lx/m2 at 5, 30, 40 degrees; the effective reflectance is
    pi R_A / cos of the entrance angle."""
    white = materials()["sheeting_white"]
    standard = {degrees: value / math.cos(math.radians(degrees)) for degrees, value in ((5, 250), (30, 150), (40, 110))}
    for degrees in (30, 40):
        got = returned(white, degrees) / returned(white, 5)
        assert got == pytest.approx(standard[degrees] / standard[5], rel=0.2)
    assert 0.25 < returned(white, 5) / (math.pi * standard[5]) < 1.0


def test_markings_in_use_are_as_bright_as_standards_have_them() -> None:
    """EN 1436: white markings on asphalt have a diffuse Qd of 130 mcd/m2/lx (Q3) new, 100 (Q2) at least in use; class
    R2 has 100 mcd/m2/lx at an entrance angle of 88.76 degrees. CIE 144: asphalt (R2, R3) has a Q0 of 0.07 cd/m2/lx.
    Times pi these are effective reflectances.
    """
    asphalt = materials()["asphalt"].reflectivity
    assert asphalt == pytest.approx(math.pi * 0.07, rel=0.05)
    assert math.pi * 0.1 < materials()["paint_white"].reflectivity < math.pi * 0.13
    assert math.pi * 0.08 < materials()["paint_yellow"].reflectivity < math.pi * 0.13
    low, high = (10.0 * math.log10((qd + 0.1) / 0.07) for qd in (0.1, 0.13))
    white = materials()["paint_white"]
    assert low < 10.0 * math.log10((white.reflectivity + white.retroreflection) / asphalt) < high
    for name in PAINTS:
        assert returned(materials()[name], 88.76) == pytest.approx(math.pi * 0.1, rel=0.3)


def test_worn_paint_has_lost_its_beads() -> None:
    by_wear = [vary_material("paint_white", MaterialVariation(paint_wear=wear), DRY) for wear in (0.0, 0.2, 0.6, 1.0)]
    retro = [material.retroreflection for material in by_wear]
    assert retro == sorted(retro, reverse=True)
    assert retro[1] == pytest.approx(materials()["paint_white"].retroreflection)
    assert retro[-1] == pytest.approx(0.0)
    assert by_wear[-1].slope == pytest.approx(materials()["asphalt"].slope)
    assert by_wear[-1].reflectivity == pytest.approx(materials()["asphalt"].reflectivity)


def test_water_drowns_beads_and_smooths_facets_but_leaves_sheeting() -> None:
    for name in PAINTS:
        dry, wet = (vary_material(name, MEAN, environment) for environment in (DRY, WET))
        assert 0.1 < wet.retroreflection / dry.retroreflection < 0.3
        assert wet.slope < dry.slope
        assert wet.reflectivity < dry.reflectivity
    assert vary_material("soil", MEAN, WET).slope < vary_material("soil", MEAN, DRY).slope
    assert vary_material("sheeting_white", MEAN, WET) == materials()["sheeting_white"]


def test_grass_is_the_less_green_the_drier_it_is_and_never_without_red() -> None:
    for name in ("verge", "median", "grass_ground", "grass", "meadow", "ryegrass", "reed"):
        colors = [
            np.array(vary_material(name, MaterialVariation(grass_dryness=dryness), DRY).base_color)
            for dryness in np.linspace(0.0, 1.0, 11)
        ]
        redness = [red / green for red, green, _ in colors]
        assert np.all(np.diff(redness) > 0.0), name
        assert 0.35 < redness[0] < 0.65, f"{name}: chlorophyll takes half of the red of lush grass, not all"
        assert redness[-1] == pytest.approx(0.27 / 0.22)
        assert max(np.abs(np.diff(colors, axis=0)).max(axis=1)) < 0.04, "no step where the table's mean is"


def test_the_default_road_has_the_tables_means() -> None:
    for name, mean in materials().items():
        same = vary_material(name, MEAN, DRY)
        for field in type(mean).model_fields:
            assert getattr(same, field) == pytest.approx(getattr(mean, field)), (name, field)


@given(
    st.builds(
        MaterialVariation,
        asphalt_age=st.floats(0, 1),
        asphalt_brightness=st.floats(0.5, 2),
        concrete_brightness=st.floats(0.5, 2),
        paint_wear=st.floats(0, 1),
        grass_dryness=st.floats(0, 1),
    ),
    st.floats(0, 1),
)
def test_every_roads_materials_can_be_written_and_read(variation, wetness) -> None:
    for name in materials():
        got = vary_material(name, variation, Environment(wetness=wetness))
        assert Material.from_dict(got.to_dict()) == got
        assert got.transmission == materials()[name].transmission
        assert np.isfinite(returned(got, 45.0))


def test_materials_of_earlier_files_have_no_optics() -> None:
    old = Material.from_dict({"base_color": [0.3, 0.3, 0.3], "roughness": 0.8, "specular": 0.15})
    assert (old.transmission, old.facet_slope, old.retroreflection) == (0.0, None, 0.0)


@pytest.mark.parametrize(
    ("field", "value"),
    [("transmission", 1.0), ("gap_size", -0.1), ("facet_slope", -0.1), ("retroreflection", -1), ("retro_lobe_deg", 0)],
)
def test_impossible_values_are_refused(field, value) -> None:
    with pytest.raises(InputError, match=field):
        Material.from_dict(materials()["asphalt"].to_dict() | {field: value})


def test_shipped_tables_have_names_and_others_are_files(tmp_path: Path) -> None:
    shifted = read_material_table(material_table_path("shifted"))
    assert set(shifted) <= set(materials())
    assert all(0 < row.reflectivity < 1 for row in shifted.values())
    assert material_table_path(str(tmp_path / "own.json")) == tmp_path / "own.json"
    with pytest.raises(InputError, match="shifted"):
        material_table_path("shiftet")


def test_reflectivities_are_plausible_at_905_nm() -> None:
    wanted = {"asphalt": 0.22, "paint_white": 0.36, "grass": 0.5, "leaves": 0.5, "soil": 0.3}
    wanted |= {"galvanised_steel": 0.5, "plastic_white": 0.7, "concrete": 0.37, "plastic_black": 0.06}
    for name, reflectivity in wanted.items():
        assert materials()[name].reflectivity == pytest.approx(reflectivity, abs=0.03), name
    assert max(row.reflectivity for row in materials().values()) < 1.0
