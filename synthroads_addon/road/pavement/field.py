"""How brightness, roughness and height of a pavement differ from their means, as a field of station and offset.

Written once for two evaluators: NumPy arrays here, a node group in Blender's materials. Either hands in a `Calculus`.

What is in it, and where its figures come from:

- **Wheel tracks**: traffic's lateral places are about normal, with a standard deviation of 0.2 to 0.3 m (Buiter et al.
  1989, Transportation Research Record 1227; Blab & Litzka 1995), two tracks 1.8 m apart. Tyres wear the binder off and
  polish the aggregate: asphalt is brighter and smoother there, concrete darker by rubber. Heavy vehicles keep to the
  right, so that the tracks fade from lane to lane inwards.
- **Oil** and dirt drip between the tracks: a darker strip along the lane's middle.
- **Joints** of asphalt: the paver's lengthwise joint beside each lane's outer boundary, and those at the ends of a
  day's work, sealed by bitumen; what was paved at once is as bright as itself and differs from its neighbours.
- **Slabs** of concrete: joints every slab length and between lanes, sealed (ZTV Beton-StB: 8 to 10 mm wide); each slab
  is of its own pour.
- **Markings** lose their film where tyres cross them: lines between lanes, arrows in the wheel tracks. There tyres
  leave rubber as well; dirt dims a line in stretches, and stretches that were painted anew have neither.
- **Patches** are black in their first year, then bleached, each of a mix of its own; open cracks are dark; sealed ones
  are a smooth band of bitumen. Where a marking was ground off the aggregate is bare: brighter and rougher.
- **Ages**: what was paved earlier or later than the rest is brighter or darker than it, see `materials.variation`.
- **Heights**: wheel tracks are as deep as they are worn, with the mean of a lane at 0; joints lie lower. Patches and
  cracks have heights of their own, and waves are `unevenness`.

Amplitudes: airborne scans of two German dual carriageways have medians of intensity, by offset, that are 0.15 to 0.3 dB
higher in the tracks than between them, with 0.1 to 0.3 dB from lane to lane, averaged over 300 to 1,100 m.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from ...base.arrays import Float

CODES, HALF_UNIT = 32, 16.0
"""A place's code is the kind of strip, 32 times the number of what it belongs to, and the half width of its lane as a
share of 16 m; of a patch it is the age."""
LANE, SHOULDER, BAY = 1, 9, 10
"""Kinds of strips: of the outermost lane, those of the others follow; those that no lane's traffic wears. 0 is a place
of which nothing is known: it has its material's mean."""
PAINT_CROSSED, PAINT_BESIDE, PAINT_AREA, PAINT_IN_LANE = 16, 17, 18, 19
"""Kinds of markings by the traffic that wears them: lines that lane changes cross, lines beside the lanes, hatched
areas, and what lies in a lane, of which `PavementPlace.across` counts from the lane's middle."""
PATCH, OPEN_CRACK, SEALED_CRACK, REMOVED_MARKING = 24, 25, 26, 27
"""Kinds of repaired and damaged places; above the strips' and the markings'."""

_TRACK, _TRACK_WIDTH, _OIL_WIDTH = 1.8, 0.3, 0.35
"""Distance between a lane's tracks; standard deviations across of a track and of the oil strip, m."""
_TRACKS_MEAN, _OIL_MEAN = 0.40, 0.23
"""Means of tracks and oil strip over a lane of 3.75 m: a lane as a whole keeps its material's mean."""
_LESS_INWARDS = 0.6
"""By how much the wear of a lane falls behind with each lane outside of it."""
DAY = 650.0
"""Length that is paved in a day, m."""
_SLOW, _CHANGES = 30.0, 7.0
"""Distances of the knots of the slow variation along a lane, and of where lane changes cross a line, m: at a speed of
30 m/s a change takes 100 m, in which a tyre is on the line for 10 m."""
_CROSSED, _BESIDE, _AREA, _IN_LANE = 1.0, 0.2, 0.4, 0.6
"""Wear of lines that lane changes cross, of lines beside the lanes, of hatched areas, of arrows between the wheel
tracks; in a wheel track it is 1."""
SEAM, SEAM_INWARDS, _RAMP = 0.02, 0.13, 0.004
"""Width of a paver's joint, its distance from the lane's boundary, and over which its edge fades, m."""
SLAB_JOINT = 0.010
"""Width of a sealed joint between slabs, m."""
_PATCHY = 0.5
"""Amplitude of either variation of a film's wear along the road, as a share of it. Chosen."""
_FILM_DARKER, _FILM_ROUGHER = 0.22, -0.06
"""Share that a lost film takes off a marking's brightness, and what it adds to its roughness. Chosen."""
_FILM_MEAN = 0.05
"""Share by which a marking without wear is brighter than the mean. Chosen: about `_FILM_DARKER` times `_BESIDE`, so
that the mean over a road's film, mostly edge lines, is 1."""
_NEW_FILM = 0.17
"""Share by which a new film is brighter than the mean one. It is what `materials.variation` makes of a wear of 0 beside
the usual 0.2: its reflectivity and beads together return 0.77 where the table's return 0.66."""
_RENEWAL, _MARK = 120.0, 4.0
"""Lengths of a line that is painted anew at once, and that a tyre blackens, m. Chosen: a day's closure of a lane or a
part of it; a tyre of 0.2 m that crosses a line of 0.15 m at 1 : 12, as in a swerve."""
_RUBBER_DARKER = 0.55
"""Share of a marking's brightness that a tyre's mark takes. Chosen: black lies on the grains' tops, white between."""
ASPHALT_OF_AGE = (0.38, 0.96, 1.06)
"""Factor on asphalt under its binder's black film, on the bare aggregate below it, and on old asphalt, see `age`."""
FILM_LASTS = 0.05
"""Age at which traffic has left 1/e of the binder's film: about a year of twenty."""
_MIXES, _MIX_DEVIATION = 250.0, 0.12
"""Steps of a patch's age that have a mix of their own, and by how much mixes are brighter or darker at most, as a
share. Chosen: more steps than a road has patches; a little more than lanes and shoulder differ by."""
_GROUND = 1.22
"""Brightness of where a marking was ground off."""
_KNOTS = 64.0
"""Between numbers of two places along the road in a hash's key: more than there are strips."""


class Calculus(Protocol):
    """Functions that operands of the field must know beside sums, products and comparisons with numbers."""

    def floor(self, value: Any) -> Any:
        """Return the largest whole numbers that aren't larger."""

    def absolute(self, value: Any) -> Any:
        """Return values without sign."""

    def exponential(self, value: Any) -> Any:
        """Return e to the power of values."""

    def smaller(self, value: Any, other: Any) -> Any:
        """Return the smaller of two."""

    def larger(self, value: Any, other: Any) -> Any:
        """Return the larger of two."""

    def below(self, value: Any, limit: Any) -> Any:
        """Return 1 where values are below a limit, else 0."""

    def hash(self, key: Any, seed: Any) -> Any:
        """Return numbers from 0 to 1 that follow from whole numbers and look random."""


class Wear(NamedTuple):
    """Parameters of the field.

    Attributes:
        polish: of the wheel tracks, 0 to 1.
        seed: 0 to 65535.
        renewed: share of the lines' length that was painted anew.
        dirt: share of markings' brightness that dirt takes, in the mean over what wasn't painted anew.
        rubber: share of the length of lines that tyres cross most that is blackened by rubber; of others less.
    """

    polish: Any
    seed: Any
    renewed: Any = 0.0
    dirt: Any = 0.0
    rubber: Any = 0.0


class PavementPlace(NamedTuple):
    """Where a place lies on the pavement.

    Attributes:
        station: m.
        across: distance from its lane's middle, m, positive outwards.
        code: what it belongs to, see `place_code`.
        age: by how much it is brighter for its age than its material's mean, as a share.
    """

    station: Any
    across: Any
    code: Any
    age: Any = 0.0


class Shape(NamedTuple):
    """Depths of a pavement.

    Attributes:
        tracks: of the outermost lane's wheel tracks below what is beside them, m.
        joints: of joints below the pavement, m.
    """

    tracks: Any
    joints: Any


class Look(NamedTuple):
    """Difference of a place from its material's mean.

    Attributes:
        brightness: factor on base colour and specular, with a mean of 1.
        roughness: what is added.
    """

    brightness: Any
    roughness: Any


def place_code(kind: Any, number: Any, half_width: Any = 0.0) -> Any:
    """Return the code of places on what has a kind and a number, in a lane of a half width (m)."""
    return kind + CODES * number + half_width / HALF_UNIT


def damage_code(kind: int, age: float = 0.0) -> float:
    """Return the code of places on a patch of an age (0 to 1), or on a crack."""
    return kind + min(age, 0.999)


class _Strip(NamedTuple):
    """Decoded place on the pavement.

    Attributes:
        owner: whole part of the code: kind and number of what the place belongs to; 0 where nothing is known.
        kind: of strip, marking or damage.
        half: half width of its lane, m.
        wear: how much traffic wears it, 1 in the outermost lane, less inwards, 0 where no lane is.
        strip: 1 on strips and markings, 0 on repaired and damaged places.
        track, oil: wheel tracks and oil strip, from 0 to 1 across the lane, less their means.
    """

    owner: Any
    kind: Any
    half: Any
    wear: Any
    strip: Any
    track: Any
    oil: Any


def _decode(m: Calculus, place: PavementPlace) -> _Strip:
    """Return what a place's code says, with the profiles of wheel tracks and oil across its lane, each of mean 0."""
    owner_code = m.floor(place.code)
    kind = owner_code - m.floor(owner_code * (1.0 / CODES)) * CODES
    distance_from_track = m.absolute(place.across) - _TRACK / 2.0
    track = m.exponential(distance_from_track * distance_from_track * (-0.5 / _TRACK_WIDTH**2))
    oil = m.exponential(place.across * place.across * (-0.5 / _OIL_WIDTH**2))
    wear = m.below(kind, SHOULDER - 0.5) / (1.0 + _LESS_INWARDS * m.larger(kind - LANE, 0.0))
    half_width = (place.code - owner_code) * HALF_UNIT
    return _Strip(owner_code, kind, half_width, wear, m.below(kind, PATCH - 0.5), track - _TRACKS_MEAN, oil - _OIL_MEAN)


def _signed_hash(m: Calculus, owner: Any, number: Any, seed: Any) -> Any:
    """Return numbers from -1 to 1 that look random and follow from an owner's code and a whole number of it."""
    return m.hash(owner + number * _KNOTS, seed) * 2.0 - 1.0


def _line(m: Calculus, distance: Any, width: float) -> Any:
    """Return 1 on a line of a width (m) at distances (m) from its middle, 0 beside it."""
    return m.smaller(m.larger((width / 2.0 - distance) * (1.0 / _RAMP) + 0.5, 0.0), 1.0)


def _slow(m: Calculus, place: PavementPlace, owner: Any, seed: Any, spacing: float = _SLOW) -> Any:
    """Return a smooth variation along the road from -1 to 1, of each lane for itself, by knots (m) apart."""
    knot_coordinate = place.station * (1.0 / spacing)
    knot = m.floor(knot_coordinate)
    share = knot_coordinate - knot
    weight = share * share * (3.0 - 2.0 * share)
    rear_value, front_value = (_signed_hash(m, owner, knot + step, seed + 1.0) for step in (0.0, 1.0))
    return rear_value + (front_value - rear_value) * weight


def _asphalt_joint(m: Calculus, place: PavementPlace, strip: _Strip) -> Any:
    """Return 1 on the paver's joints: beside each lane's outer boundary, and between two days' work."""
    distance_in_day = place.station % DAY
    day_joint = _line(m, m.smaller(distance_in_day, DAY - distance_in_day), SEAM)
    seam = m.below(strip.kind, SHOULDER - 0.5) * _line(m, m.absolute(place.across + SEAM_INWARDS - strip.half), SEAM)
    return m.larger(seam, day_joint)


def _slab_joint(m: Calculus, place: PavementPlace, strip: _Strip, slab_length: Any) -> Any:
    """Return 1 on the joints between slabs of concrete."""
    distance_in_slab = (
        place.station % slab_length
    )  # exact in float32 as well, which a difference of large quotients isn't
    distance_to_transverse = m.smaller(distance_in_slab, slab_length - distance_in_slab)
    distance_to_longitudinal = m.absolute(m.absolute(place.across) - strip.half) + (
        1.0 - m.below(strip.kind, SHOULDER - 0.5)
    )
    return _line(m, m.smaller(distance_to_transverse, distance_to_longitudinal), SLAB_JOINT)


def _height(m: Calculus, strip: _Strip, joint: Any, shape: Shape) -> Any:
    """Return the height (m) of a strip of pavement, 0 of all else."""
    is_paved = strip.strip * (1.0 - m.below(strip.owner, 0.5))
    return (strip.wear * strip.track * shape.tracks + joint * shape.joints) * is_paved * -1.0


def asphalt_height(m: Calculus, place: PavementPlace, shape: Shape) -> Any:
    """Return the height (m) of asphalt above its mean surface at places; 0 on patches and cracks."""
    strip = _decode(m, place)
    return _height(m, strip, _asphalt_joint(m, place, strip), shape)


def concrete_height(m: Calculus, place: PavementPlace, shape: Shape, slab_length: Any) -> Any:
    """Return the height (m) of concrete above its mean surface at places; 0 on patches and cracks."""
    strip = _decode(m, place)
    return _height(m, strip, _slab_joint(m, place, strip, slab_length), shape)


def _patch_brightness(m: Calculus, age: Any, seed: Any) -> Any:
    """Return the brightness of patches of an age (0 to 1): they bleach as all asphalt does, each of a mix of its own.

    A patch is black in its first year alone, as `age.asphalt_brightness` of roads in use says; relative to pavement
    that has bleached it is 0.38 when new, 0.96 without its film and 1.06 when old.
    """
    new_factor, bare_factor, old_factor = ASPHALT_OF_AGE
    film = m.exponential(age * (-1.0 / FILM_LASTS))
    mix = m.hash(m.floor(age * _MIXES), seed) * 2.0 - 1.0
    return bare_factor + film * (new_factor - bare_factor) + age * (old_factor - bare_factor) + mix * _MIX_DEVIATION


def _repaired(m: Calculus, strip: _Strip, look: Look, seed: Any) -> Look:
    """Return the look where patches and cracks have theirs in place of the pavement's.

    The figures are chosen: an open crack darker than the pavement, a sealed one smoother, a removed marking brighter
    and rougher; of patches see `_patch_brightness`. Masks are 0 or 1 since nodes of materials know no branches.
    """
    age = strip.half * (1.0 / HALF_UNIT)
    is_removed = 1.0 - m.below(strip.kind, REMOVED_MARKING - 0.5)
    is_sealed = 1.0 - m.below(strip.kind, SEALED_CRACK - 0.5) - is_removed
    is_cracked = 1.0 - m.below(strip.kind, OPEN_CRACK - 0.5) - is_removed
    is_patch = 1.0 - is_cracked - is_removed
    brightness = (
        _patch_brightness(m, age, seed) * is_patch + is_cracked * 0.45 - is_sealed * 0.05 + is_removed * _GROUND
    )
    roughness = (0.06 - 0.1 * age) * is_patch + is_cracked * 0.05 - is_sealed * 0.4 + is_removed * 0.08
    is_strip, is_known = strip.strip, 1.0 - m.below(strip.owner, 0.5)
    blended = look.brightness * is_strip + brightness * (1.0 - is_strip)
    return Look(
        (blended - 1.0) * is_known + 1.0,
        (look.roughness * is_strip + roughness * (1.0 - is_strip)) * is_known,
    )


def asphalt_look(m: Calculus, place: PavementPlace, wear: Wear) -> Look:
    """Return how asphalt differs from its mean at places.

    Args:
        m: functions for the operands.
        place: N places.
        wear: parameters.
    """
    strip = _decode(m, place)
    day_deviation = _signed_hash(m, strip.owner, m.floor(place.station / DAY), wear.seed)
    slow_variation = _slow(m, place, strip.owner, wear.seed)
    polish = strip.wear * strip.track * wear.polish
    joint = _asphalt_joint(m, place, strip)
    traffic_factor = 1.0 + 0.55 * polish - 0.14 * strip.wear * strip.oil
    brightness = (
        (1.0 + 0.09 * day_deviation + 0.04 * slow_variation) * traffic_factor * (1.0 - 0.35 * joint) * (1.0 + place.age)
    )
    roughness = 0.05 * day_deviation + 0.02 * slow_variation - 0.3 * polish - 0.1 * joint
    return _repaired(m, strip, Look(brightness, roughness), wear.seed)


def concrete_look(m: Calculus, place: PavementPlace, wear: Wear, slab_length: Any) -> Look:
    """Return how concrete differs from its mean at places.

    Args:
        m: functions for the operands.
        place: N places.
        wear: parameters.
        slab_length: distance of the joints, m.
    """
    strip = _decode(m, place)
    slab = m.floor(place.station / slab_length)
    joint = _slab_joint(m, place, strip, slab_length)
    slab_deviation = _signed_hash(m, strip.owner, slab, wear.seed)
    slow_variation = _slow(m, place, strip.owner, wear.seed)
    polish = strip.wear * strip.track * wear.polish
    traffic_factor = 1.0 - 0.4 * polish - 0.1 * strip.wear * strip.oil
    brightness = (
        (1.0 + 0.06 * slab_deviation + 0.03 * slow_variation) * traffic_factor * (1.0 - 0.6 * joint) * (1.0 + place.age)
    )
    roughness = 0.05 * slab_deviation + 0.02 * slow_variation - 0.25 * polish - 0.25 * joint
    return _repaired(m, strip, Look(brightness, roughness), wear.seed)


def paint_look(m: Calculus, place: PavementPlace, wear: Wear) -> Look:
    """Return how a marking differs from its mean at places: film, dirt and rubber, and what was painted anew.

    Kinds of markings are told apart by masks of 0 or 1, since nodes of materials know no branches.

    Args:
        m: functions for the operands.
        place: N places, of which `across` matters in lanes only.
        wear: parameters, whose polish says nothing here.
    """
    strip = _decode(m, place)
    # Each mask is 1 from its kind on: the sums below go from the wear of one kind to that of the next.
    from_beside_on = 1.0 - m.below(strip.kind, PAINT_BESIDE - 0.5)
    from_area_on = 1.0 - m.below(strip.kind, PAINT_AREA - 0.5)
    is_in_lane = 1.0 - m.below(strip.kind, PAINT_IN_LANE - 0.5)
    line_wear = _CROSSED + from_beside_on * (_BESIDE - _CROSSED) + from_area_on * (_AREA - _BESIDE)
    # In a lane the wear is _IN_LANE + (1 - _IN_LANE) times the tracks' profile: 1 in the middle of a track.
    track_profile = strip.track + _TRACKS_MEAN
    traffic_wear = line_wear + is_in_lane * (track_profile * (1.0 - _IN_LANE) + _IN_LANE - _AREA)
    long_variation = _slow(m, place, strip.owner, wear.seed)
    short_variation = _slow(m, place, strip.owner, wear.seed + 1.0, _CHANGES)
    is_known = 1.0 - m.below(strip.owner, 0.5)
    film_loss = traffic_wear * (1.0 + _PATCHY * long_variation + _PATCHY * short_variation) * is_known
    is_renewed = _share_of_lengths(m, place, strip.owner, _RENEWAL, wear.seed + 3.0, wear.renewed) * is_known
    is_black = _share_of_lengths(m, place, strip.owner, _MARK, wear.seed + 4.0, wear.rubber * traffic_wear) * is_known
    dirt_variation = _slow(m, place, strip.owner, wear.seed + 5.0)
    dirt = m.smaller(wear.dirt * (1.0 + dirt_variation) * is_known, 1.0)
    film = 1.0 + is_known * _FILM_MEAN - film_loss * _FILM_DARKER
    old_brightness = film * (1.0 - dirt) * (1.0 - is_black * _RUBBER_DARKER)
    return Look(
        brightness=old_brightness * (1.0 - is_renewed) + is_renewed * (1.0 + _NEW_FILM),
        roughness=film_loss * _FILM_ROUGHER * (1.0 - is_renewed),
    )


def _share_of_lengths(m: Calculus, place: PavementPlace, owner: Any, length: float, seed: Any, share: Any) -> Any:
    """Return 1 on a share of an owner's pieces of a length (m), drawn at random, else 0."""
    piece = m.floor(place.station * (1.0 / length))
    return m.below(_signed_hash(m, owner, piece, seed) * 0.5 + 0.5, share)


class ArrayCalculus:
    """`Calculus` of NumPy arrays in float64; its hash is that of Blender's White Noise texture in two dimensions."""

    def floor(self, value: Float) -> Float:
        """Return the largest whole numbers that aren't larger."""
        return np.floor(value)

    def absolute(self, value: Float) -> Float:
        """Return values without sign."""
        return np.abs(value)

    def exponential(self, value: Float) -> Float:
        """Return e to the power of values."""
        return np.exp(value)

    def smaller(self, value: Float, other: Float | float) -> Float:
        """Return the smaller of two."""
        return np.minimum(value, other)

    def larger(self, value: Float, other: Float | float) -> Float:
        """Return the larger of two."""
        return np.maximum(value, other)

    def below(self, value: Float, limit: Float | float) -> Float:
        """Return 1 where values are below a limit, else 0."""
        return np.asarray(value < limit, dtype=np.float64)

    def hash(self, key: Float, seed: Float | float) -> Float:
        """Return numbers from 0 to 1 that follow from whole numbers: Jenkins' lookup3 of their bits as float32."""
        with np.errstate(over="ignore"):
            key, seed = np.broadcast_arrays(np.asarray(key, np.float32), np.asarray(seed, np.float32))
            initial_word = np.uint32(0xDEADBEEF + (2 << 2) + 13)
            a = np.ascontiguousarray(key).view(np.uint32) + initial_word
            b = np.ascontiguousarray(seed).view(np.uint32) + initial_word
            c = np.full(a.shape, initial_word, np.uint32)
            for rotation, (target, source) in zip(
                (14, 11, 25, 16, 4, 14, 24), ((2, 1), (0, 2), (1, 0)) * 3, strict=False
            ):
                parts = [a, b, c]
                mixed = parts[target] ^ parts[source]
                parts[target] = mixed - (
                    parts[source] << np.uint32(rotation) | parts[source] >> np.uint32(32 - rotation)
                )
                a, b, c = parts
        return c.astype(np.float64) / float(0xFFFFFFFF)
