"""No field of the materials' variation without effect on what the laser meets, but for those that aren't built."""

from __future__ import annotations

from synthroads_addon.materials.table import materials
from synthroads_addon.materials.variation import vary_material
from synthroads_addon.road.surroundings import Environment, MaterialVariation
from tests.helpers.page_modules import ROOT

NOT_BUILT = {"patch_density", "crack_density", "wheel_track_polish", "seed"}
"""Fields that nothing shows yet; the documentation says so."""


def test_every_variation_changes_a_material_but_those_that_are_not_built() -> None:
    mean, dry = MaterialVariation(), Environment()
    without = set()
    for name in MaterialVariation.model_fields:
        other = mean.model_copy(update={name: getattr(mean, name) + (7 if name == "seed" else 0.2)})
        if all(vary_material(one, mean, dry) == vary_material(one, other, dry) for one in materials()):
            without.add(name)
    assert without == NOT_BUILT


def test_the_pages_say_what_nothing_shows() -> None:
    for page in ("limits.md", "parameters.md"):
        text = (ROOT / "docs" / page).read_text(encoding="utf-8")
        said = (part for part in text.split("\n\n") if "othing shows the" in part)
        paragraph = next(said)
        assert all(f"`{name}`" in paragraph for name in NOT_BUILT | {"slab_length"}), page
