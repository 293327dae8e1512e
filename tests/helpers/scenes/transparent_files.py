"""Files of other programs with a card that lets light through: glTF, OBJ, USD and FBX, written without Blender's nodes.

Each card is 4 m wide and level, 3 m above the ground of 40 m; texture coordinates go from 0 to 1 along x and y.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .transparent_materials import CASES, GLASS, Nodes, add_card, add_ground, half, rising

Float = NDArray[np.float64]


def png(alpha: Float) -> bytes:
    """Return a green PNG with this alpha (h, w), the lowest row first."""
    pixels = np.zeros((*alpha.shape, 4), np.uint8)
    pixels[..., 1], pixels[..., 3] = 128, np.round(alpha[::-1] * 255)
    return _png(pixels, 6)


def grey_png(value: Float) -> bytes:
    """Return a grey PNG of values (h, w), the lowest row first."""
    return _png(np.round(value[::-1] * 255).astype(np.uint8)[..., None], 0)


def _png(pixels: NDArray[np.uint8], kind: int) -> bytes:
    height, width = pixels.shape[:2]
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


@dataclass(frozen=True)
class FileCase:
    """A file, and what its card must let through.

    Attributes:
        name: of the file.
        write: writes it.
        through: share of the light (N,) that goes on, by texture coordinates (N,).
    """

    name: str
    write: Callable[[Path], None]
    through: Callable[[Float, Float], Float | float]


def gltf(
    material: dict[str, Any],
    alpha: Float | None = None,
    sampler: dict[str, int] | None = None,
    scale: float = 1.0,
    colors: bool = False,
) -> Callable[[Path], None]:
    """Return what writes a .glb; ``{"texture": {}}`` in a material is the picture.

    Args:
        material: as in the file.
        alpha: of the picture; none without.
        sampler: of the texture.
        scale: factor on the texture coordinates, about the card's middle.
        colors: whether vertices have an alpha that rises along x.
    """

    def write(path: Path) -> None:
        place = np.array([(-2, 3, 2), (2, 3, 2), (2, 3, -2), (-2, 3, -2)], "<f4")
        ground = np.array([(-20, 0, 20), (20, 0, 20), (20, 0, -20), (-20, 0, -20)], "<f4")
        maps = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], "<f4")
        fade = np.array([(1, 1, 1, 0), (1, 1, 1, 1), (1, 1, 1, 1), (1, 1, 1, 0)], "<f4")
        parts = [place, ground, (maps - 0.5) * np.float32(scale) + 0.5, maps[:, ::-1].copy(), fade]
        parts.append(np.array([0, 1, 2, 0, 2, 3], "<u2"))
        kinds = ["VEC3", "VEC3", "VEC2", "VEC2", "VEC4", "SCALAR"]
        accessors: list[dict[str, Any]] = []
        for number, (part, kind) in enumerate(zip(parts, kinds, strict=True)):
            accessors.append({"bufferView": number, "componentType": 5123 if number == 5 else 5126, "count": len(part)})
            accessors[-1] |= {"type": kind}
            if kind == "VEC3":
                accessors[-1] |= {"min": part.min(axis=0).tolist(), "max": part.max(axis=0).tolist()}
        data = [part.astype(part.dtype).tobytes() for part in parts] + ([] if alpha is None else [png(alpha)])
        views, blob = [], b""
        for part in data:
            views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(part)})
            blob += part + b"\0" * (-len(part) % 4)
        attributes = {"POSITION": 0, "TEXCOORD_0": 2, "TEXCOORD_1": 3} | ({"COLOR_0": 4} if colors else {})
        card = {"attributes": attributes, "indices": 5, "material": 0}
        meshes = [{"primitives": [card]}, {"primitives": [{"attributes": {"POSITION": 1}, "indices": 5}]}]
        document = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
            "nodes": [{"mesh": 0, "name": "Card"}, {"mesh": 1, "name": "Ground"}], "meshes": meshes,
            "materials": [{"name": "Clear", "doubleSided": True} | material],
            "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(blob)}],
        }  # fmt: skip
        used = sorted({name for entry in (material, *_below(material)) for name in entry.get("extensions", {})})
        document |= {"extensionsUsed": used} if used else {}
        if alpha is not None:
            document |= {"images": [{"bufferView": 6, "mimeType": "image/png"}], "samplers": [sampler or {}]}
            document |= {"textures": [{"source": 0, "sampler": 0}]}
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(blob))
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
        path.write_bytes(head + chunks)

    return write


def _below(value: Any) -> list[dict[str, Any]]:
    if not isinstance(value, dict):
        return []
    return [entry for part in value.values() if isinstance(part, dict) for entry in (part, *_below(part))]


def _base(factor: float = 1.0, textured: bool = True, **texture: Any) -> dict[str, Any]:
    base: dict[str, Any] = {"baseColorFactor": [1.0, 1.0, 1.0, factor]}
    return {"pbrMetallicRoughness": base | ({"baseColorTexture": {"index": 0} | texture} if textured else {})}


def obj(lines: str) -> Callable[[Path], None]:
    """Return what writes an .obj whose material has these lines, with pictures of an alpha, ``a.png``, and of greys."""

    def write(path: Path) -> None:
        (path.parent / "a.png").write_bytes(png(half()))
        (path.parent / "g.png").write_bytes(grey_png(half()))
        path.with_suffix(".mtl").write_text(f"newmtl Clear\nKd 0.1 0.5 0.1\n{lines}\n")
        place = "".join(f"v {x} 3 {z}\n" for x, z in ((-2, 2), (2, 2), (2, -2), (-2, -2)))
        ground = "".join(f"v {x} 0 {z}\n" for x, z in ((-20, 20), (20, 20), (20, -20), (-20, -20)))
        maps = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        faces = "o Card\nusemtl Clear\nf 1/1 2/2 3/3 4/4\no Ground\nusemtl None\nf 5 6 7 8\n"
        path.write_text(f"mtllib {path.stem}.mtl\n{place}{ground}{maps}{faces}")

    return write


def usd(opacity: str, shaders: str = "") -> Callable[[Path], None]:
    """Return what writes a .usda whose material's surface has these lines, with more shaders beside it."""

    def write(path: Path) -> None:
        (path.parent / "a.png").write_bytes(png(half()))
        (path.parent / "r.png").write_bytes(png(rising()))
        path.write_text(f"""#usda 1.0
(
    defaultPrim = "Root"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "Root"
{{
    def Mesh "Ground"
    {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-20, -20, 0), (20, -20, 0), (20, 20, 0), (-20, 20, 0)]
    }}
    def Mesh "Card" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-2, -2, 3), (2, -2, 3), (2, 2, 3), (-2, 2, 3)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
            interpolation = "varying"
        )
        rel material:binding = </Root/Clear>
    }}
    def Material "Clear"
    {{
        token outputs:surface.connect = </Root/Clear/Surface.outputs:surface>
        def Shader "Surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.1, 0.5, 0.1)
            {opacity}
            token outputs:surface
        }}
        def Shader "Map"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
        {shaders}
    }}
}}
""")

    return write


def _usd_texture(file: str) -> str:
    return f"""def Shader "Picture"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./{file}@
            float2 inputs:st.connect = </Root/Clear/Map.outputs:result>
            float outputs:a
            float3 outputs:rgb
        }}"""


def exported(name: str) -> Callable[[Path], None]:
    """Return what has Blender export one of the materials of `transparent_materials`."""

    def write(path: Path) -> None:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        nodes = Nodes()
        CASES[name].build(nodes)
        add_ground()
        add_card(nodes.item)
        if path.suffix == ".fbx":
            bpy.ops.export_scene.fbx(filepath=str(path), path_mode="COPY", embed_textures=True)
        elif path.suffix == ".glb":
            bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB")
        else:
            bpy.ops.wm.usd_export(filepath=str(path))

    return write


_OPACITY = "float inputs:opacity.connect = </Root/Clear/Picture.outputs:a>"
CLAMP, MIRROR, NEAREST = 33071, 33648, 9728


def _right(u: Float, v: Float) -> Float:
    return (u > 0.5) * 1.0


FILES: dict[str, FileCase] = {
    "glTF opaque": FileCase("c.glb", gltf(_base(), half()), lambda u, v: 0.0),
    "glTF mask": FileCase("c.glb", gltf(_base() | {"alphaMode": "MASK"}, half()), _right),
    "glTF mask at 0.3": FileCase(
        "c.glb", gltf(_base() | {"alphaMode": "MASK", "alphaCutoff": 0.3}, rising()), lambda u, v: (u < 0.3) * 1.0
    ),
    "glTF mask at 0": FileCase(
        "c.glb", gltf(_base() | {"alphaMode": "MASK", "alphaCutoff": 0.0}, half()), lambda u, v: 0.0
    ),
    "glTF mask with a factor": FileCase(
        "c.glb", gltf(_base(0.8) | {"alphaMode": "MASK"}, rising()), lambda u, v: (u < 0.625) * 1.0
    ),
    "glTF mask without a texture": FileCase(
        "c.glb", gltf(_base(0.4, textured=False) | {"alphaMode": "MASK"}), lambda u, v: 1.0
    ),
    "glTF blend": FileCase("c.glb", gltf(_base() | {"alphaMode": "BLEND"}, rising()), lambda u, v: 1.0 - u),
    "glTF blend with a factor": FileCase(
        "c.glb", gltf(_base(0.5) | {"alphaMode": "BLEND"}, rising()), lambda u, v: 1.0 - 0.5 * u
    ),
    "glTF blend without a texture": FileCase(
        "c.glb", gltf(_base(0.25, textured=False) | {"alphaMode": "BLEND"}), lambda u, v: 0.75
    ),
    "glTF blend of vertices": FileCase(
        "c.glb", gltf(_base(textured=False) | {"alphaMode": "BLEND"}, colors=True), lambda u, v: 1.0 - u
    ),
    "glTF second coordinates": FileCase(
        "c.glb", gltf(_base(texCoord=1) | {"alphaMode": "MASK"}, half()), lambda u, v: (v < 0.5) * 1.0
    ),
    "glTF moved texture": FileCase(
        "c.glb",
        gltf(_base(extensions={"KHR_texture_transform": {"offset": [0.25, 0.0]}}) | {"alphaMode": "MASK"}, half()),
        lambda u, v: ((u > 0.25) & (u < 0.75)) * 1.0,
    ),
    "glTF clamped": FileCase(
        "c.glb", gltf(_base() | {"alphaMode": "MASK"}, half(), {"wrapS": CLAMP, "wrapT": CLAMP}, 2.0), _right
    ),
    "glTF mirrored": FileCase(
        "c.glb", gltf(_base() | {"alphaMode": "MASK"}, half(), {"wrapS": MIRROR, "wrapT": MIRROR}, 2.0), _right
    ),
    "glTF repeated": FileCase(
        "c.glb", gltf(_base() | {"alphaMode": "MASK"}, half(), {}, 2.0), lambda u, v: ((2 * u - 0.5) % 1 > 0.5) * 1.0
    ),
    "glTF nearest": FileCase(
        "c.glb", gltf(_base() | {"alphaMode": "BLEND"}, half(), {"magFilter": NEAREST, "minFilter": NEAREST}), _right
    ),
    "glTF glass": FileCase(
        "c.glb",
        gltf(_base(textured=False) | {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.5}}}),
        lambda u, v: 0.0,  # a default metal
    ),
    "glTF glass of no metal": FileCase(
        "c.glb",
        gltf(
            {"pbrMetallicRoughness": {"metallicFactor": 0.0}}
            | {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.5}}}
        ),
        lambda u, v: 0.5 * GLASS,
    ),
    "glTF unlit": FileCase(
        "c.glb", gltf(_base() | {"alphaMode": "MASK", "extensions": {"KHR_materials_unlit": {}}}, half()), _right
    ),
    "glTF of Blender": FileCase("c.glb", exported("greater than"), lambda u, v: (u <= 0.7) * 1.0),
    "OBJ dissolve": FileCase("c.obj", obj("d 0.4"), lambda u, v: 0.6),
    "OBJ transparency": FileCase("c.obj", obj("Tr 0.4"), lambda u, v: 0.4),
    "OBJ mask": FileCase("c.obj", obj("map_d g.png"), _right),
    "OBJ picture with a mask": FileCase("c.obj", obj("map_Kd a.png\nmap_d a.png"), _right),
    "OBJ picture alone": FileCase("c.obj", obj("map_Kd a.png"), lambda u, v: 0.0),
    # Since Blender 5 its importer takes an opacity without a threshold for glass, which is tinted.
    "USD opacity": FileCase(
        "c.usda",
        usd("float inputs:opacity = 0.4"),
        lambda u, v: 0.6 * (GLASS * 0.7 / 3 if bpy.app.version[0] > 4 else 1),
    ),
    "USD picture": FileCase("c.usda", usd(_OPACITY, _usd_texture("a.png")), _right),
    "USD threshold": FileCase(
        "c.usda",
        usd(f"{_OPACITY}\n      float inputs:opacityThreshold = 0.3", _usd_texture("r.png")),
        lambda u, v: (u < 0.3) * 1.0,
    ),
    "USD of Blender": FileCase("c.usdc", exported("alpha of an image"), _right),
    "FBX of Blender": FileCase("c.fbx", exported("alpha of an image"), _right),
    "FBX of one alpha": FileCase("c.fbx", exported("alpha of 0.3"), lambda u, v: 0.7),
}
"""Files by what they declare."""
