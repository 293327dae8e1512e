"""How each material varies: noises of the base colour added up, and what a few materials have beside them."""

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
"""Widths that machines drill a field in and tend it in, m."""
VEHICLE_PLACE, VEHICLE_SEAMS = "vehicle_place_on_it", "vehicle_seams"
"""Attributes of vehicles: where a point is on it (m), with a height that `VEHICLE_BASE` is added to, as it is 0 on what
is no vehicle; where its doors' seams are along it (m), 0 for none."""
VEHICLE_BASE = 10.0
_SEAM_WIDTH, _SEAM_HEIGHTS, _SEAM_DARK = 0.010, (0.30, 1.02), 0.65
"""Width of a door's seam, heights that it is between (m), and how much of the brightness it takes."""
_DIRT_COLOR, _DIRTIEST, _DIRT_ENDS = (0.13, 0.115, 0.095), 0.85, 0.75
"""Base colour of what wheels throw up, its largest share, and the height at which there is none of it any more, m."""
ELEMENT = 6.0
"""Length of a concrete barrier between two joints, m."""
_JOINT = 0.02  # m
_STEEL = 0.5
"""Mean base colour of a gantry's steel: what its attribute ``shade`` is a share of."""
_COVER_TINT = 0.35
"""How much of the vehicle's colour its cover has; the rest is the table's mean."""
_DRY = (0.55, 0.18, 0.25)
"""How much red, green and blue change between fresh and dry grass, as shares of the mean."""
_AUTUMN = (0.35, 0.12, 0.0)
"""The same between a dark and a light tree's leaves."""


class _Noise(NamedTuple):
    """One noise: see `Shade.vary` and `Shade.noise`."""

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
    "roof_tiles": (_Noise(0.20, 0.14, 1.0), _Noise(0.16, 1.6, 3.0), _Noise(0.25, 40.0, 0.0)),
    "wire_mesh": (_Noise(0.10, 0.2, 2.0),),
    "conductor": (_Noise(0.06, 2.0, 2.0),),
    "gantry_steel": (_Noise(0.06, 0.1, 3.0), _Noise(0.06, 2.5, 2.0, (1.0, 1.0, 0.3))),
    "plastic_red": _WORN,
    "rubber": _WORN,
    **dict.fromkeys((f"sheeting_{color}" for color in ("white", "red", "blue", "yellow", "grey")), _SHEETING),
    "plastic_orange": _HOUSING,
    "cabinet_grey": _HOUSING,
    "tarpaulin": (_Noise(0.06, 1.5, 2.0),),
}


class _Dirt(NamedTuple):
    """By how much dirt, rust or wear changes roughness, specular and metallic where a noise is -1; at 1 it is as clean.

    The noise is the last of the material's own; its standard deviation is about 0.17, that of leaves' 0.24.
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
"""Materials that aren't in it stay as the table has them: lamps, displays, glass, chrome, reflectors."""
_FILM_OF_DIRT = (0.4, 3.0, (1.0, 1.0, 0.5))
"""Wavelength (m), detail and stretch of the noise of dirt on what has none of its own."""


def _attribute(shade: Shade, name: str) -> Value:
    return shade.tree.node("ShaderNodeAttribute", attribute_name=name)["Vector"]


def _bay(shade: Shade) -> None:
    """Panels that differ a little, by the attribute ``bay``."""
    bay = op.component(_attribute(shade, "bay"), "X")
    number = shade.tree.node("ShaderNodeTexWhiteNoise", w=bay, noise_dimensions="1D")["Value"]
    shade.vary(0.08, number * 2.0 - 1.0)


def _gantry_steel(shade: Shade) -> None:
    """Steel as bright as its faces' attribute ``shade`` says."""
    shade.scale(op.component(_attribute(shade, "shade"), "X") / _STEEL)


def _paint(shade: Shade, share: float = 1.0) -> None:
    """Let the base colour have a share of the vehicle's colour."""
    color = shade.tree.node("ShaderNodeVectorMath", _attribute(shade, COLOR), shade.mean.base_color, operation="DIVIDE")
    shade.scale(color.value if share == 1.0 else color.value * share + (1.0 - share,) * 3)


def _below(shade: Shade, value: Value, limit: float) -> Value:
    """Return 1 where a number is below a limit, else 0."""
    return shade.tree.node("ShaderNodeMath", value, limit, operation="LESS_THAN").value


def _vehicle_wear(shade: Shade) -> None:
    """Seams of a vehicle's doors, and dirt on its lower part."""
    place, seams = _attribute(shade, VEHICLE_PLACE), _attribute(shade, VEHICLE_SEAMS)
    y, z = op.component(place, "Y"), op.component(place, "Z") - VEHICLE_BASE
    # Where the attribute is missing it is 0, and z far below any wheel: the mask (1 on vehicles, else 0) is by that.
    vehicle_mask = 1.0 - _below(shade, z, -1.0)
    low, high = _SEAM_HEIGHTS
    door_mask = _below(shade, z, high) - _below(shade, z, low)
    for axis in "XYZ":  # up to three seams along the vehicle, of which 0 stands for none
        seam = op.component(seams, axis)
        seam_mask = _below(shade, op.unary("ABSOLUTE", y - seam), _SEAM_WIDTH / 2.0)
        seam_mask = seam_mask * (1.0 - _below(shade, op.unary("ABSOLUTE", seam), 1e-6))
        shade.scale(1.0 - seam_mask * door_mask * _SEAM_DARK)
    # Share of dirt: _DIRTIEST (1 - z / _DIRT_ENDS)^2 times a noise about 0.75. Chosen: wheels throw most up low.
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
    """Dark joints at whole elements, by the attribute ``station``."""
    station = op.component(_attribute(shade, "station"), "X")
    distance = op.unary("ABSOLUTE", station % ELEMENT - ELEMENT / 2)
    joint = shade.tree.node("ShaderNodeMath", distance, _JOINT / 2, operation="LESS_THAN").value
    # A joint keeps a fifth of the brightness (chosen); the divisor is the mean, so that the element's mean stays.
    shade.scale((1.0 - joint * 0.8) / (1.0 - 0.8 * _JOINT / ELEMENT))


def _rows(shade: Shade) -> None:
    """Rows of a crop, and the tracks of the machines that tend it, across the vector attribute ``rows``."""
    across = op.dot(shade.place, _attribute(shade, ROWS))
    drills = op.unary("SINE", across * (2.0 * math.pi / _DRILL))
    shade.scale_texture(1.0 + drills * 0.07)
    # Two wheels, 1 m to either side of each multiple of _TRAM, leave tracks of 0.5 m (chosen: a tractor's).
    distance = op.unary("ABSOLUTE", op.unary("ABSOLUTE", across % _TRAM - _TRAM / 2.0) - _TRAM / 2.0 + 1.0)
    track = shade.tree.node("ShaderNodeMath", distance, 0.25, operation="LESS_THAN").value
    # Both cover 1 m of _TRAM: the divisor is the mean, so that the field's mean stays.
    shade.scale_texture((1.0 - track * 0.4) / (1.0 - 0.4 * 1.0 / _TRAM))


def _film(shade: Shade, wear: Wear) -> None:
    """Film of a marking: worn where traffic crosses it, in spots as large as tyres' prints; with beads in it."""
    look, _ = pavement_look(shade, "paint", wear)
    spots, stretches, beads = shade.noise(0.25, 3.0), shade.noise(2.5, 2.0), shade.noise(0.05, 3.0)
    film = (spots * 0.9 + 1.0) * (stretches * 0.7 + 1.0)
    shade.scale(look.brightness)
    shade.scale_texture(film)
    shade.vary(0.18, beads)
    shade.roughness = look.roughness + shade.layer("roughness", spots * 0.2)
    shade.specular = look.brightness * (shade.images.get("specular") or film * shade.mean.specular)


def _scars(shade: Shade) -> None:
    """Dark scars across a white bark."""
    scars = shade.noise(0.12, 1.0, (0.35, 0.35, 1.6))
    shade.scale_texture(shade.tree.node("ShaderNodeMapRange", scars, 0.25, 0.4, 1.12, 0.25).value)


def _clear(shade: Shade, share: float = 0.8) -> None:
    shade.transparency = share


class _Texture(NamedTuple):
    """Texture of a pavement: noises of its aggregate, of its patches of binder or slurry, and of long stretches.

    Attributes:
        grain, mottle, wide: amount and wavelength (m) of each on the base colour; no third one if its amount is 0.
        rough: how much the roughness varies with the mottle.
        gloss: how much the specular varies with the grain, as a share.
        relief: height of the grain, m.
    """

    grain: tuple[float, float]
    mottle: tuple[float, float]
    wide: tuple[float, float]
    rough: float
    gloss: float
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
    """Pavement: its field of station and offset, and its texture."""
    texture = _PAVEMENTS[kind]
    look, height = pavement_look(shade, "concrete" if kind in CONCRETES else "asphalt", wear)
    grain, mottle = shade.noise(texture.grain[1], 1.0), shade.noise(texture.mottle[1], 4.0)
    shade.scale(look.brightness)
    shade.vary(texture.grain[0], grain)
    shade.vary(texture.mottle[0], mottle)
    if texture.wide[0]:
        shade.vary(texture.wide[0], shade.noise(texture.wide[1], 2.0))
    shade.roughness = look.roughness + shade.layer("roughness", mottle * texture.rough)
    specular = shade.images.get("specular") or (grain * texture.gloss + 1.0) * shade.mean.specular
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


def _lay_dirt(shade: Shade, dirt: _Dirt, clean: Value) -> None:
    """Make the surface rougher, duller and less metallic where a noise is low."""
    shade.roughness = shade.layer("roughness", clean * -dirt.roughness)
    shade.specular = shade.layer("specular", clean * dirt.specular)
    if dirt.metallic:
        shade.metallic = shade.layer("metallic", clean * dirt.metallic)


def is_worn(name: str) -> bool:
    """Return whether the traffic's wear shows on a material of the table."""
    return name in _PAVEMENTS or name in _PAINTS


def vary_color(name: str, wear: Wear, shade: Shade) -> None:
    """Let the layers vary as those of a material of the table do; others keep their mean."""
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
