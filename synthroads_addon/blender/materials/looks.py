"""How each material varies: noises of the base colour, dirt, and the special patterns of a few materials.

Wavelengths (m), amounts and other numbers of the noises are chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from ...road.pavement.field import Wear
from ...road.section import CONCRETES
from ..nodes import operations as op
from ..nodes.builder import Value
from .pavement import pavement_look
from .shading import Shade

COLOR = "vehicle_color"
"""Attribute of vehicles that the paint's base colour is read from."""
ROWS = "rows"
"""Attribute of fields: the unit vector across the rows of their crop."""
_DRILL, _TRAM = 3.0, 21.0
"""Distance between rows of a crop, and between the tracks of machines that tend it, m; chosen."""
VEHICLE_PLACE, VEHICLE_SEAMS = "vehicle_place_on_it", "vehicle_seams"
"""Attributes of vehicles: a point's place on the vehicle (m), with `VEHICLE_BASE` added to its height as the
attribute is 0 on other things; positions of the doors' seams along the vehicle (m), 0 for none."""
VEHICLE_BASE = 10.0
"""Height that is added in the attribute `VEHICLE_PLACE`, m; chosen."""
_SEAM_WIDTH, _SEAM_HEIGHTS, _SEAM_DARK = 0.010, (0.30, 1.02), 0.65
"""Width of a door's seam, heights of its ends (m), and the share of the brightness that it takes away; chosen."""
_DIRT_COLOR, _DIRTIEST, _DIRT_ENDS = (0.13, 0.115, 0.095), 0.85, 0.75
"""Base colour of dirt that wheels throw up, its largest share, and the height where it ends, m; chosen."""
ELEMENT = 6.0
"""Length of a concrete barrier between two joints, m."""
_JOINT = 0.02
"""Width of a joint, m; chosen."""
_STEEL = 0.5
"""Mean base colour of a gantry's steel, by which its attribute ``shade`` is divided."""
_COVER_TINT = 0.35
"""Share of the vehicle's colour in its cover's colour; the rest is the table's mean; chosen."""
_DRY = (0.55, 0.18, 0.25)
"""Change of red, green and blue between fresh and dry grass, as shares of the mean; chosen."""
_AUTUMN = (0.35, 0.12, 0.0)
"""Change of red, green and blue between a dark and a light tree's leaves, as shares of the mean; chosen."""


class _Noise(NamedTuple):
    """One noise of the base colour: its amount for `Shade.vary`, the rest for `Shade.noise`; all chosen."""

    amount: float | tuple[float, float, float]
    wavelength: float
    detail: float
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)


_TURF = (_Noise(0.45, 0.04, 2.0), _Noise(0.30, 0.7, 3.0), _Noise(0.30, 14.0, 3.0))
# Features about as large as the tufts are apart, and patches.
_GRASS = (_Noise(0.30, 0.15, 1.0), _Noise(_DRY, 0.9, 0.0), _Noise(0.30, 9.0, 2.0))
_LEAVES = (_Noise(0.35, 0.3, 1.0), _Noise(_AUTUMN, 8.0, 1.0), _Noise(0.25, 25.0, 1.0))
_BARK = (_Noise(0.35, 0.08, 3.0, (1.0, 1.0, 0.25)),)
# Film that is a little dirty in patches and in streaks that run down.
_SHEETING = (_Noise(0.05, 0.6, 3.0), _Noise(0.05, 0.15, 2.0, (1.0, 1.0, 0.15)))
# Weathered plastic or paint.
_HOUSING = (_Noise(0.08, 0.5, 3.0, (1.0, 1.0, 0.3)), _Noise(0.05, 0.04, 2.0))
_WORN = (_Noise(0.10, 0.05, 3.0),)
_SPECIES = ("maple", "birch", "poplar", "spruce", "pine", "hawthorn", "hazel", "blackthorn")

_NOISES: dict[str, tuple[_Noise, ...]] = {
    "verge": (_Noise(0.45, 0.03, 2.0), _Noise(0.30, 0.8, 3.0)),
    "median": _TURF,
    "grass_ground": _TURF,
    "gravel": (_Noise(0.4, 0.025, 2.0), _Noise(0.2, 0.6, 3.0), _Noise(0.15, 3.0, 2.0)),
    "soil": (_Noise(0.35, 0.05, 3.0), _Noise(0.20, 3.0, 2.0)),
    **dict.fromkeys(("grass", "meadow", "ryegrass", "reed"), _GRASS),
    **dict.fromkeys(
        ("wheat", "crop", "rapeseed"), (_Noise(0.16, 0.5, 2.0), _Noise(0.14, 9.0, 2.0), _Noise(0.12, 70.0, 2.0))
    ),
    **dict.fromkeys(("leaves", *(f"{species}_leaves" for species in _SPECIES)), _LEAVES),
    **dict.fromkeys(("bark", *(f"{species}_bark" for species in _SPECIES)), _BARK),
    "birch_bark": (_Noise(0.15, 0.2, 2.0),),
    "galvanised_steel": (_Noise(0.12, 0.08, 3.0), _Noise(0.10, 3.0, 2.0)),
    "barrier_concrete": (_Noise(0.10, 0.012, 1.0), _Noise(0.16, 0.9, 4.0), _Noise(0.12, 0.25, 2.0, (1.0, 1.0, 0.15))),
    # Board-marked, with stains that run down.
    "bridge_concrete": (_Noise(0.08, 0.012, 1.0), _Noise(0.14, 1.6, 4.0), _Noise(0.14, 0.5, 3.0, (1.0, 1.0, 0.12))),
    "noise_aluminium": (_Noise(0.08, 1.2, 3.0, (1.0, 1.0, 0.3)),),
    "noise_concrete": (_Noise(0.16, 0.02, 2.0), _Noise(0.14, 1.0, 4.0, (1.0, 1.0, 0.3))),
    "noise_wood": (_Noise(0.30, 0.12, 3.0, (1.0, 1.0, 0.06)), _Noise(0.18, 0.02, 2.0, (1.0, 1.0, 0.05))),
    "plaster": (_Noise(0.04, 0.02, 2.0), _Noise(0.10, 0.9, 3.0, (1.0, 1.0, 0.25)), _Noise(0.16, 30.0, 0.0)),
    "brick": (_Noise(0.22, 0.11, 1.0, (1.0, 1.0, 2.4)), _Noise(0.14, 0.7, 3.0)),
    # Stones of 16 cm and pavers of 10 cm, each a little lighter or darker, and moss or sand in patches.
    "granite": (_Noise(0.10, 0.008, 1.0), _Noise(0.08, 0.5, 2.0)),
    "setts": (_Noise(0.22, 0.12, 1.0), _Noise(0.10, 0.01, 1.0), _Noise(0.12, 1.1, 3.0)),
    "concrete_pavers": (_Noise(0.14, 0.09, 1.0), _Noise(0.06, 0.01, 1.0), _Noise(0.12, 1.4, 3.0)),
    "roof_tiles": (_Noise(0.20, 0.14, 1.0), _Noise(0.16, 1.6, 3.0), _Noise(0.25, 40.0, 0.0)),
    "wire_mesh": (_Noise(0.10, 0.2, 2.0),),
    "conductor": (_Noise(0.06, 2.0, 2.0),),
    "gantry_steel": (_Noise(0.06, 0.1, 3.0), _Noise(0.06, 2.5, 2.0, (1.0, 1.0, 0.3))),
    "plastic_red": _WORN,
    "rubber": _WORN,
    **dict.fromkeys((f"sheeting_{color}" for color in ("white", "red", "blue", "yellow", "grey", "green")), _SHEETING),
    "plastic_orange": _HOUSING,
    "cabinet_grey": _HOUSING,
    "tarpaulin": (_Noise(0.06, 1.5, 2.0),),
}


class _Dirt(NamedTuple):
    """Changes of roughness, specular and metallic by dirt, rust or wear where a noise is -1; their opposites at 1.

    The noise is the last of the material's noises; its standard deviation is about 0.17, that of leaves' noise 0.24.
    """

    roughness: float = 0.18
    specular: float = 0.14
    metallic: float = 0.0


_DIRT: dict[str, _Dirt] = {
    **dict.fromkeys(_NOISES, _Dirt()),
    "rubber": _Dirt(specular=0.02),
    "galvanised_steel": _Dirt(metallic=0.15),  # white rust
    "gantry_steel": _Dirt(metallic=0.3),  # paint over rust
    "board_back": _Dirt(metallic=0.3),
    "wire_mesh": _Dirt(metallic=0.15),
    "conductor": _Dirt(metallic=0.15),
    "car_paint": _Dirt(),
    "plastic_white": _Dirt(),
    "plastic_black": _Dirt(specular=0.03),
    "number_plate": _Dirt(),
    "sheeting_black": _Dirt(specular=0.03),
}
"""Dirt by material. Other materials keep the table's values: lamps, displays, glass, chrome, reflectors."""
_FILM_OF_DIRT = (0.4, 3.0, (1.0, 1.0, 0.5))
"""Wavelength (m), detail and stretch of the noise of dirt on materials that have no noise of their own; chosen."""


def _attribute(shade: Shade, name: str) -> Value:
    """Return a vector attribute of the mesh."""
    return shade.tree.node("ShaderNodeAttribute", attribute_name=name)["Vector"]


def _bay(shade: Shade) -> None:
    """Give panels slightly different brightness, each its own, by the number in the attribute ``bay``."""
    bay = op.component(_attribute(shade, "bay"), "X")
    number = shade.tree.node("ShaderNodeTexWhiteNoise", w=bay, noise_dimensions="1D")["Value"]
    shade.vary(0.08, number * 2.0 - 1.0)


def _gantry_steel(shade: Shade) -> None:
    """Make steel as bright as the attribute ``shade`` of its faces says."""
    shade.scale(op.component(_attribute(shade, "shade"), "X") / _STEEL)


def _paint(shade: Shade, share: float = 1.0) -> None:
    """Give the base colour a share of the vehicle's colour."""
    color_ratio = shade.tree.node(
        "ShaderNodeVectorMath", _attribute(shade, COLOR), shade.mean.base_color, operation="DIVIDE"
    )
    shade.scale(color_ratio.value if share == 1.0 else color_ratio.value * share + (1.0 - share,) * 3)


def _is_below(shade: Shade, value: Value, limit: float) -> Value:
    """Return 1 where a number is below a limit, else 0."""
    return shade.tree.node("ShaderNodeMath", value, limit, operation="LESS_THAN").value


def _vehicle_wear(shade: Shade) -> None:
    """Add the seams of a vehicle's doors, and dirt on its lower part."""
    place, seams = _attribute(shade, VEHICLE_PLACE), _attribute(shade, VEHICLE_SEAMS)
    y, z = op.component(place, "Y"), op.component(place, "Z") - VEHICLE_BASE
    # On other things the attribute is 0, which puts z far below any wheel: the mask is 1 on vehicles, else 0.
    vehicle_mask = 1.0 - _is_below(shade, z, -1.0)
    seam_bottom, seam_top = _SEAM_HEIGHTS
    door_mask = _is_below(shade, z, seam_top) - _is_below(shade, z, seam_bottom)
    for axis in "XYZ":  # up to three seams along the vehicle, of which 0 stands for none
        seam = op.component(seams, axis)
        seam_mask = _is_below(shade, op.unary("ABSOLUTE", y - seam), _SEAM_WIDTH / 2.0)
        seam_mask = seam_mask * (1.0 - _is_below(shade, op.unary("ABSOLUTE", seam), 1e-6))
        shade.scale(1.0 - seam_mask * door_mask * _SEAM_DARK)
    # Share of dirt: _DIRTIEST (1 - z / _DIRT_ENDS)^2 times a noise about 0.75. Chosen: most dirt is near the ground.
    noise = shade.noise(0.35, 3.0, (1.0, 1.0, 0.6)) * 0.5 + 0.75
    depth = op.minimum(op.maximum((_DIRT_ENDS - z) / _DIRT_ENDS, 0.0), 1.0)
    share = depth * depth * noise * _DIRTIEST * vehicle_mask
    # The factor is over the material's mean colour, so that the dirt's own colour is divided by that.
    dirt = tuple(part / mean for part, mean in zip(_DIRT_COLOR, shade.mean.base_color, strict=True))
    assert shade.factor is not None
    shade.factor = shade.factor * (1.0 - share) + op.vector(shade.tree, *dirt) * share
    assert shade.roughness is not None
    shade.roughness = shade.roughness + share * 0.5  # chosen: dust is matter than paint


def _joints(shade: Shade) -> None:
    """Darken the joints of a barrier at whole elements, by the attribute ``station``."""
    station = op.component(_attribute(shade, "station"), "X")
    distance = op.unary("ABSOLUTE", station % ELEMENT - ELEMENT / 2)
    joint = shade.tree.node("ShaderNodeMath", distance, _JOINT / 2, operation="LESS_THAN").value
    # A joint keeps a fifth of the brightness (chosen); the divisor is the mean, so that the element's mean stays.
    shade.scale((1.0 - joint * 0.8) / (1.0 - 0.8 * _JOINT / ELEMENT))


def _rows(shade: Shade) -> None:
    """Add the rows of a crop, and the tracks of the machines that tend it, across the vector attribute ``rows``."""
    offset = op.dot(shade.place, _attribute(shade, ROWS))
    row_wave = op.unary("SINE", offset * (2.0 * math.pi / _DRILL))
    shade.scale_texture(1.0 + row_wave * 0.07)
    # Two wheels, 1 m to either side of each multiple of _TRAM, leave tracks of 0.5 m (chosen: a tractor's).
    distance = op.unary("ABSOLUTE", op.unary("ABSOLUTE", offset % _TRAM - _TRAM / 2.0) - _TRAM / 2.0 + 1.0)
    track = shade.tree.node("ShaderNodeMath", distance, 0.25, operation="LESS_THAN").value
    # Both cover 1 m of _TRAM: the divisor is the mean, so that the field's mean stays.
    shade.scale_texture((1.0 - track * 0.4) / (1.0 - 0.4 * 1.0 / _TRAM))


def _film(shade: Shade, wear: Wear) -> None:
    """Add the film of a marking: worn by traffic, in spots as large as tyres' prints, with glass beads in it."""
    look, _ = pavement_look(shade, "paint", wear)
    # Wavelengths are chosen, m; the amounts so that a line's points vary as on four real roads, whose quartiles are 1.0
    # to 1.9 dB apart with the scanner's speckle (`python studies/realism/markings.py`).
    spots, stretches, beads = shade.noise(0.25, 3.0), shade.noise(2.5, 2.0), shade.noise(0.05, 3.0)
    film = (spots * 0.55 + 1.0) * (stretches * 0.4 + 1.0)
    shade.scale(look.brightness)
    shade.scale_texture(film)
    shade.vary(0.18, beads)
    shade.roughness = look.roughness + shade.layer("roughness", spots * 0.2)
    shade.specular = look.brightness * (shade.images.get("specular") or film * shade.mean.specular)


def _scars(shade: Shade) -> None:
    """Add dark scars across a white bark: where a flat noise is low."""
    scars = shade.noise(0.12, 1.0, (0.35, 0.35, 1.6))
    shade.scale_texture(shade.tree.node("ShaderNodeMapRange", scars, 0.25, 0.4, 1.12, 0.25).value)


def _clear(shade: Shade, share: float = 0.8) -> None:
    """Let a share of the light pass straight through."""
    shade.transparency = share


class _Texture(NamedTuple):
    """Texture of a pavement: noises of its aggregate, of its patches of binder or slurry, and of long stretches.

    Attributes:
        grain, mottle, stretches: amount and wavelength (m) of aggregate, patches and long stretches on the base colour;
            no stretches if their amount is 0.
        roughness_change: change of the roughness by the mottle.
        specular_change: change of the specular by the grain, as a share.
        relief: height of the grain, m.
    """

    grain: tuple[float, float]
    mottle: tuple[float, float]
    stretches: tuple[float, float]
    roughness_change: float
    specular_change: float
    relief: float


_PAVEMENTS = {
    "asphalt": _Texture((0.25, 0.012), (0.12, 0.6), (0.10, 25.0), 0.12, 0.6, 0.001),
    # Stones of 8 to 11 mm side by side, with mastic between them; the same without mastic, and so with pores.
    "stone_mastic_asphalt": _Texture((0.30, 0.016), (0.10, 0.5), (0.10, 25.0), 0.12, 0.6, 0.0013),
    "porous_asphalt": _Texture((0.38, 0.018), (0.08, 0.5), (0.08, 25.0), 0.10, 0.7, 0.0020),
    # A smooth mastic with rolled-in chippings of 2 to 4 mm, which lie unevenly.
    "mastic_asphalt": _Texture((0.20, 0.007), (0.20, 0.4), (0.10, 25.0), 0.16, 0.5, 0.0006),
    "concrete": _Texture((0.10, 0.01), (0.12, 1.5), (0.0, 25.0), 0.12, 0.5, 0.0005),
    "exposed_aggregate_concrete": _Texture((0.26, 0.012), (0.08, 1.2), (0.0, 25.0), 0.12, 0.55, 0.0009),
}


def _pavement(shade: Shade, kind: str, wear: Wear) -> None:
    """Add a pavement's field of station and offset, and its texture."""
    texture = _PAVEMENTS[kind]
    look, height = pavement_look(shade, "concrete" if kind in CONCRETES else "asphalt", wear)
    grain, mottle = shade.noise(texture.grain[1], 1.0), shade.noise(texture.mottle[1], 4.0)
    shade.scale(look.brightness)
    shade.vary(texture.grain[0], grain)
    shade.vary(texture.mottle[0], mottle)
    if texture.stretches[0]:
        shade.vary(texture.stretches[0], shade.noise(texture.stretches[1], 2.0))
    shade.roughness = look.roughness + shade.layer("roughness", mottle * texture.roughness_change)
    specular = shade.images.get("specular") or (grain * texture.specular_change + 1.0) * shade.mean.specular
    shade.specular = look.brightness * specular
    shade.relief = height if "normal" in shade.images else grain * texture.relief + (0.0 if height is None else height)


_BEFORE_NOISES: dict[str, Callable[[Shade], None]] = {
    **dict.fromkeys(("noise_aluminium", "noise_concrete", "noise_wood"), _bay),
    "gantry_steel": _gantry_steel,
    "car_paint": _paint,
    "tarpaulin": lambda shade: _paint(shade, _COVER_TINT),
}
_AFTER_NOISES = {
    **dict.fromkeys(("wheat", "crop", "rapeseed"), _rows),
    "barrier_concrete": _joints,
    "birch_bark": _scars,
    "acrylic_glass": _clear,
    "wire_mesh": lambda shade: _clear(shade, 0.88),
    "car_paint": _vehicle_wear,
}


_PAINTS = ("paint_white", "paint_yellow")


def _lay_dirt(shade: Shade, dirt: _Dirt, cleanness: Value) -> None:
    """Make the surface rougher, duller and less metallic where the noise `cleanness` (-1 to 1) is low."""
    shade.roughness = shade.layer("roughness", cleanness * -dirt.roughness)
    shade.specular = shade.layer("specular", cleanness * dirt.specular)
    if dirt.metallic:
        shade.metallic = shade.layer("metallic", cleanness * dirt.metallic)


def is_worn(name: str) -> bool:
    """Return whether the traffic's wear shows on a material of the table."""
    return name in _PAVEMENTS or name in _PAINTS


def vary_color(name: str, wear: Wear, shade: Shade) -> None:
    """Make the layers of the material `name` under construction vary; other materials keep their means."""
    if name in _PAVEMENTS:
        _pavement(shade, name, wear)
    if name in _BEFORE_NOISES:
        _BEFORE_NOISES[name](shade)
    noises = _NOISES.get(name, ())
    fields = [shade.noise(noise.wavelength, noise.detail, noise.stretch) for noise in noises]
    for noise, field in zip(noises, fields, strict=True):
        shade.vary(noise.amount, field)
    if name in _DIRT:
        _lay_dirt(shade, _DIRT[name], fields[-1] if fields else shade.noise(*_FILM_OF_DIRT))
    if name in _PAINTS:
        _film(shade, wear)
    if name in _AFTER_NOISES:
        _AFTER_NOISES[name](shade)
