"""Colours and material layers of points: what every source of them gives, and the materials' own values."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ...base.arithmetic.loops import point_loops
from ...base.arrays import AnyArray, ArrayRows, Bool, Float, Float32, Index, UInt8, UInt16, dot_rows, take_rows
from ...base.turns.main_thread import MainThreadCalls
from ...cloud.points import NO_MATERIAL
from ...materials.table import Material
from .light import CloudShadows, SunAndSky
from .tunnel_light import TunnelLight

ColourSource = Literal["auto", "nodes", "images", "returns", "material"]
Engine = Literal["cycles", "eevee"]
ColourMode = Literal["lit", "unlit", "false_colour"]
Lighting = Literal["direct", "path"]


@dataclass(frozen=True)
class ColourSettings:
    """Settings of the points' colours and material layers: their source, the renderer, images, RGB mode and lighting.

    Attributes:
        image_spacing: distance between two images along the path, m.
        ground_sampling_distance: width of a pixel at the usual range, m.
        samples: samples per pixel of the lit colours.
        source: each material's nodes at the very returns, images, a pixel per return, or each material's mean; auto
            takes the nodes, and for whole light paths a pixel per return where that is there.
        engine: renderer of the images.
        mode: what RGB shows.
        lighting: sun and open sky without noise, or whole light paths.
        max_resolution: largest side of an image, px.
    """

    image_spacing: float
    ground_sampling_distance: float
    samples: int
    source: ColourSource = "auto"
    engine: Engine = "cycles"
    mode: ColourMode = "lit"
    lighting: Lighting = "direct"
    max_resolution: int = 4096


def takes_nodes(settings: ColourSettings) -> bool:
    """Return whether colours and layers are evaluated from the materials' nodes at the returns, without images."""
    direct = settings.engine == "cycles" and settings.lighting == "direct"
    return settings.source == "nodes" or (settings.source == "auto" and direct)


MATERIAL_LAYERS: dict[str, int] = {"base_color": 3, "roughness": 1, "metallic": 1, "specular": 1}
"""Layers of the surface itself, and their components."""
FROM_MATERIAL, FROM_NODES, NEARBY, FROM_RETURN = 0, 253, 254, 255
"""`LayerValues.source` of a material's mean, of its nodes at the very return, of a place of the same material close by,
and of a pixel per return; n in between is the n-th best image."""
_SRGB_POWER = np.float32(1 / 2.4)
"""Exponent of sRGB's encoding (IEC 61966-2-1): 1 / 2.4."""
_FALSE_COLOUR = ("roughness", "metallic", "specular")
"""Layers that stand for red, green and blue in a picture of the surface."""


@dataclass(frozen=True)
class LayerValues:
    """Colour and material layers of N points, with the code of the source that each point's values come from.

    Attributes:
        arrays: by layer: ``rgb`` (N, 3) uint16 sRGB, ``base_color`` (N, 3) float32 linear, the others (N,) float32.
        source: (N,) uint8: `FROM_MATERIAL`, `FROM_NODES`, `NEARBY`, `FROM_RETURN`, or the rank of the image, from 1.
    """

    arrays: dict[str, NDArray[np.generic]]
    source: UInt8


def source_name(number: int) -> str:
    """Return the name that reports use for a code of `LayerValues.source`, such as "image" or "nearby"."""
    names = {FROM_MATERIAL: "material", 1: "image", FROM_NODES: "nodes", NEARBY: "nearby", FROM_RETURN: "return"}
    return names.get(number, "next image")


def shares_by_source(counts: NDArray[np.integer]) -> dict[str, float]:
    """Return the fraction of the points, 0 to 1, that took their layers from each source, by the source's name.

    Args:
        counts: (256,) points by source.
    """
    total = max(1, int(counts.sum()))
    shares: dict[str, float] = {}
    for number in np.flatnonzero(counts):
        name = source_name(int(number))
        shares[name] = shares.get(name, 0.0) + int(counts[number]) / total
    return {name: round(share, 6) for name, share in shares.items()}


@dataclass(frozen=True)
class SeenPoints(ArrayRows):
    """N points on the surface where the scanner's beam met it, without measurement errors.

    Attributes:
        position: (N, 3) where the surface was hit, in the scene as it was rendered: local, m.
        scanner: (N, 3) where the pulse came from, local, m.
        normal: (N, 3) unit normals towards the scanner.
        material: (N,) indices into the scene mesh's materials.
        time: (N,) s since the scan's start.
        face: (N,) triangle of the scene, those that move after those that stand; None where nobody asks.
        sunlit: (N,) whether the sun reaches it; None where nobody asks.
    """

    position: Float
    scanner: Float
    normal: NDArray[np.floating]
    material: UInt16
    time: Float
    face: Index | None = None
    sunlit: Bool | None = None

    def __len__(self) -> int:
        return len(self.position)

    @cached_property  # several ask for it
    def towards_scanner(self) -> Float32:
        """Return the unit vectors (N, 3) from the points to the scanner."""
        if (loops := point_loops()) is not None:
            return loops.towards(self.position, self.scanner)
        towards = (self.scanner - self.position).astype(np.float32)
        towards /= np.maximum(np.sqrt(dot_rows(towards, towards)), 1e-9)[:, None]
        return np.asarray(towards)


class LayerSource(Protocol):
    """Interface of what gives points colours and material layers: nodes, images, a pixel per return, or means.

    Any threads may use it side by side.
    """

    @property
    def calls(self) -> MainThreadCalls | None:
        """Return the calls that it has the main thread make, which alone may render; None if it makes none."""

    @property
    def report(self) -> dict[str, Any]:
        """Return a summary of what was rendered, as JSON data; empty if nothing was."""

    def sample(self, points: SeenPoints, names: frozenset[str]) -> LayerValues:
        """Return the named colour and material layers of N points.

        Args:
            points: none of which lies in the air.
            names: ``rgb`` and layers of `MATERIAL_LAYERS`; none other is computed.
        """
        ...


@dataclass(frozen=True)
class SurfaceConstants:
    """Mean layer values of M materials, and flags of the layers that vary over a material's surface.

    Attributes:
        values: by layer of `MATERIAL_LAYERS`: (M, 3) or (M,) float32.
        varies: by layer: (M,) bool; where False the mean is the exact value everywhere and nothing need be rendered.
    """

    values: dict[str, Float32]
    varies: dict[str, Bool]

    def complete(self, name: str, values: Float32, rendered: Bool, material: UInt16) -> Float32:
        """Return the values of a layer at N points, with means filled in, in place, where nothing was rendered.

        Args:
            name: of the layer.
            values: (N, C) rendered; any numbers elsewhere.
            rendered: (N,) which of them are rendered, mostly nearly all.
            material: (N,) indices.
        """
        means = self.values[name]
        result = values.reshape(-1, *means.shape[1:])
        missing_rows = np.flatnonzero(~rendered)
        if len(missing_rows):
            result[missing_rows] = take_rows(means, np.take(material, missing_rows))
        return result

    def chosen(self, name: str, rows: Index | None, point_values: Float32 | None, material: UInt16) -> Float32 | None:
        """Return a layer's values (K, ...) at points by compiled loops: their own, or means of even materials.

        None where no compiled loops are in use, or a row or a material isn't there.

        Args:
            name: of the layer.
            rows: (K,) of the points; None for all.
            point_values: (N, C) values of all N points; None to have means alone.
            material: (N,) indices.
        """
        if (loops := point_loops()) is None:
            return None
        return loops.layer(rows, point_values, material, self.varies[name], self.values[name])

    def varying_layers(self, names: frozenset[str]) -> tuple[str, ...]:
        """Return those of the named layers that vary in some material, in the order of `MATERIAL_LAYERS`."""
        return tuple(name for name in MATERIAL_LAYERS if name in names and bool(self.varies[name].any()))


def surface_constants(rows: Sequence[Material], varies: dict[str, Bool] | None = None) -> SurfaceConstants:
    """Return the mean layer values of materials, in their order.

    Args:
        rows: M materials.
        varies: (M,) by layer, whether it varies over the material's surface; None: no layer does.
    """
    values = {
        name: np.array([getattr(row, name) for row in rows], np.float32).reshape((-1, 3) if parts == 3 else (-1,))
        for name, parts in MATERIAL_LAYERS.items()
    }
    no_flags = {name: np.zeros(len(rows), bool) for name in MATERIAL_LAYERS}
    return SurfaceConstants(values, no_flags if varies is None else varies)


def needed_layers(names: frozenset[str], mode: ColourMode) -> frozenset[str]:
    """Return the names of the surface layers from which the named ones are computed, `rgb` by its mode."""
    layer_names = names - {"rgb"}
    if "rgb" in names:
        layer_names |= set(_FALSE_COLOUR) if mode == "false_colour" else {"base_color"}
    return frozenset(layer_names)


def decode_srgb(encoded: Float) -> Float:
    """Return the linear values of sRGB-encoded ones (IEC 61966-2-1), both 0 to 1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def encode_srgb(linear: NDArray[np.floating]) -> UInt16:
    """Return linear colours as 16-bit sRGB (IEC 61966-2-1), clipped to what that can show."""
    linear = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    if (loops := point_loops()) is not None:
        return loops.encoded(linear, np.power(linear, _SRGB_POWER))
    curve = np.float32(1.055) * np.power(linear, _SRGB_POWER) - np.float32(0.055)
    encoded = np.where(linear <= 0.0031308, np.float32(12.92) * linear, curve)
    return np.asarray(encoded * np.float32(65535.0) + np.float32(0.5), dtype=np.uint16)


def sample_points(source: LayerSource, points: SeenPoints, names: frozenset[str]) -> LayerValues:
    """Return the named layers of N points; those in the air get zeros and `FROM_MATERIAL` as their source."""
    surface_rows = np.flatnonzero(points.material != NO_MATERIAL)
    if len(surface_rows) == len(points):
        return source.sample(points, names)
    values = source.sample(points.select(surface_rows), names)

    def fill(array: NDArray[np.generic], fill_value: int) -> AnyArray:
        """Return values (K, ...) of the points on surfaces as (N, ...) of all points."""
        result = np.full((len(points), *array.shape[1:]), fill_value, array.dtype)
        result[surface_rows] = array
        return result

    arrays = {name: fill(array, 0) for name, array in values.arrays.items()}
    return LayerValues(arrays, fill(values.source, FROM_MATERIAL))


@dataclass(frozen=True)
class MaterialLayers:
    """Layer source of the materials' mean values, lit by sun and sky without shadows of objects; thread-safe.

    Attributes:
        constants: of the scene's materials.
        mode: what RGB shows.
        light: sun and sky, exposed.
        clouds: shadows that drift, or None.
        tunnels: light in tunnels, or None.
        report: empty, as nothing is rendered.
    """

    constants: SurfaceConstants
    mode: ColourMode = "lit"
    light: SunAndSky = field(default_factory=SunAndSky)
    clouds: CloudShadows | None = None
    tunnels: TunnelLight | None = None
    report: dict[str, Any] = field(default_factory=dict)
    calls = None

    def sample(self, points: SeenPoints, names: frozenset[str]) -> LayerValues:
        """Return the named layers of N points from their materials' mean values."""
        return self.layer_values(points, {}, np.full(len(points), FROM_MATERIAL, np.uint8), names)

    def layer_values(
        self, points: SeenPoints, channels: dict[str, Float32], source: UInt8, names: frozenset[str]
    ) -> LayerValues:
        """Return the named layers of N points: rendered values where given and the material varies, else the means.

        Args:
            points: N points; their times are those at which they were seen.
            channels: rendered layers (N, C) by name, and ``sun`` and ``sky``, the exposed light of each that the
                surfaces reflect. Rows of points that nothing was rendered for aren't read.
            source: (N,) of `LayerValues`.
            names: of the layers.
        """
        rendered = source != FROM_MATERIAL
        everywhere = bool(rendered.all())
        layers: dict[str, Float32] = {}
        for name in sorted(needed_layers(names, self.mode)):
            values = self.constants.chosen(name, None, channels.get(name), points.material) if everywhere else None
            if values is not None:
                layers[name] = values
            elif name in channels:
                use = rendered & np.take(self.constants.varies[name], points.material)
                layers[name] = self.constants.complete(name, channels[name].copy(), use, points.material)
            else:
                layers[name] = take_rows(self.constants.values[name], points.material)
        arrays: dict[str, NDArray[np.generic]] = {name: layers[name] for name in layers.keys() & names}
        if "rgb" in names:
            arrays["rgb"] = self._rgb(points, layers, channels, rendered)
        return LayerValues(arrays, source)

    def _rgb(
        self, points: SeenPoints, layers: dict[str, Float32], channels: dict[str, Float32], rendered: Bool
    ) -> UInt16:
        """Return the RGB colours (N, 3), 16-bit sRGB, of points by the mode.

        Args:
            points: N points.
            layers: values of the surface layers that the mode needs.
            channels: see `layer_values`.
            rendered: (N,) whether anything was rendered for a point.
        """
        if self.mode == "false_colour":
            return encode_srgb(np.stack([layers[name] for name in _FALSE_COLOUR], axis=1))
        color = layers["base_color"]
        if self.mode == "unlit":
            return encode_srgb(color)
        everywhere = bool(rendered.all())
        if everywhere and "sun" in channels:
            sun = channels["sun"]
        else:
            sun = color * self.light.sunlight(points.normal)
            if "sun" in channels:
                sun[rendered] = channels["sun"][rendered]
        is_plain = self.clouds is None and self.tunnels is None
        if everywhere and "sky" not in channels and is_plain and (loops := point_loops()) is not None:
            normal = np.asarray(points.normal, np.float32)
            light_above, light_below = (
                np.asarray(self.light.above, np.float32),
                np.asarray(self.light.below, np.float32),
            )
            linear = loops.daylight(sun, color, normal, light_above, light_below)
            return loops.encoded(linear, np.power(linear, _SRGB_POWER))
        sky = color * self.light.sky(points.normal)
        if "sky" in channels:
            sky[rendered] = channels["sky"][rendered]
        if self.clouds is not None:
            sun = sun * self.clouds.transmission(points.position, points.time)[:, None]
        if self.tunnels is not None:
            daylight, lamps = self.tunnels.light(points.position)
            return encode_srgb((sun + sky) * daylight + color * lamps)
        return encode_srgb(sun + sky)
