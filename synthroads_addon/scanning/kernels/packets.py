"""Rays cast by Embree in packets: its own functions for 4, 8 or 16 rays at once, which `embreex` doesn't call.

`embreex` brings Embree's library. Its C interface is called by `packets.c`, a loop over the rays of a whole call, and
by ctypes where a scene is made. Before the first scene what both say is compared with `embreex`, ray by ray.
"""

from __future__ import annotations

import ctypes
import math
import weakref
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Bool, Float32, Index
from ...base.remarks import warn
from .library import NoKernelError, load_kernel

COHERENT = 1 << 16
"""RTC_RAY_QUERY_FLAG_COHERENT: a packet's rays are followed together, which may choose either face of an edge."""
LEAST_COSINE, WIDEST = math.cos(math.radians(3.0)), 3.0
"""Rays of a packet are cast together where the angles between them and the first have at least this cosine, and their
origins lie within this distance (m) of its: others are faster one by one. Measured: docs/casters.md."""

MOST_CHANGES = 5.0 / 7.0
"""Nor are they cast together where a larger share of the rays before met another face than their neighbour."""

_EMBREE = 404
"""Version of Embree, 100 times the major and the minor one, whose structures packets.c has."""
_LIBRARIES = ("../embreex.libs/libembree4*.so*", "../embreex.libs/embree4*.dll", ".dylibs/libembree4*.dylib")
"""Where the wheels of Linux, Windows and macOS have Embree, from the package's own folder."""
_VERSION, _NATIVE = 0, ((16, 34), (8, 33), (4, 32))
"""RTCDeviceProperty of the version, and of each width, the widest first: whether the processor has it."""
_ROBUST, _TRIANGLES = 1 << 2, 0
_INDEX, _VERTEX, _UINT3, _FLOAT3 = 0, 1, 0x5003, 0x9003
_ROW = 12
"""Bytes of three numbers."""
_OUT_OF_MEMORY = 4

_POINTER, _SIZE, _INT = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "rtcNewDevice": (_POINTER, [ctypes.c_char_p]),
    "rtcReleaseDevice": (None, [_POINTER]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_POINTER, _INT]),
    "rtcGetDeviceError": (_INT, [_POINTER]),
    "rtcNewScene": (_POINTER, [_POINTER]),
    "rtcReleaseScene": (None, [_POINTER]),
    "rtcSetSceneFlags": (None, [_POINTER, _INT]),
    "rtcCommitScene": (None, [_POINTER]),
    "rtcNewGeometry": (_POINTER, [_POINTER, _INT]),
    "rtcReleaseGeometry": (None, [_POINTER]),
    "rtcSetSharedGeometryBuffer": (None, [_POINTER, _INT, ctypes.c_uint, _INT, _POINTER, _SIZE, _SIZE, _SIZE]),
    "rtcCommitGeometry": (None, [_POINTER]),
    "rtcAttachGeometry": (ctypes.c_uint, [_POINTER, _POINTER]),
}
"""Results and arguments of the functions of Embree that are called from here (rtcore_device.h and its like)."""


class _Casts(ctypes.Structure):
    """How rays are cast; as `Casts` in packets.c."""

    _fields_ = (
        ("one", _POINTER),
        ("packet", _POINTER),
        ("width", ctypes.c_int32),
        ("occluded", ctypes.c_int32),
        ("flags", ctypes.c_uint32),
        ("least_cosine", ctypes.c_float),
        ("widest", ctypes.c_float),
        ("most_changes", ctypes.c_int32),
        ("changes", ctypes.c_int32),
    )


class _Rays(ctypes.Structure):
    """Rays, row by row; as `Rays` in packets.c."""

    _fields_ = (
        ("origin", _POINTER),
        ("direction", _POINTER),
        ("limit", _POINTER),
        ("limit_step", ctypes.c_int64),
    )


@dataclass(frozen=True)
class Packing:
    """How rays are packed, other than for tests always the same.

    Attributes:
        flags: RTCRayQueryFlags of packets.
        least_cosine: see `LEAST_COSINE`; above 1 all rays are cast one by one, below -1 none for its direction.
        widest: see `WIDEST`.
        most_changes: see `MOST_CHANGES`.
        width: rays per packet, 4, 8 or 16; None for the widest that the processor has.
    """

    flags: int = COHERENT
    least_cosine: float = LEAST_COSINE
    widest: float = WIDEST
    most_changes: float = MOST_CHANGES
    width: int | None = None


USUAL = Packing()


@dataclass(frozen=True)
class Packets:
    """Embree's library, the kernel that calls it, and the number of rays that the processor casts at once.

    Attributes:
        embree: Embree's library.
        kernel: packets.c, compiled.
        width: rays per packet, 4, 8 or 16.
    """

    embree: ctypes.CDLL
    kernel: ctypes.CDLL
    width: int


@cache
def usable_packets() -> Packets | NoKernelError:
    """Return the libraries that cast rays in packets, or why this machine has none; found out once.

    Where packets should work but differ from single rays, a warning is given.
    """
    try:
        packets = _load()
    except NoKernelError as error:
        return error
    if _same_as_embreex(packets):
        return packets
    warn("Embree's packets of rays don't agree with its single rays on this machine: rays are cast one by one")
    return NoKernelError("packets differ from single rays")


def _load() -> Packets:
    """Return the libraries with their functions' signatures; raise `NoKernelError` if this isn't the Embree meant."""
    kernel = load_kernel("packets")
    kernel.synthroads_cast.restype = None
    kernel.synthroads_cast.argtypes = [_POINTER, _POINTER, ctypes.c_int64, _POINTER, _POINTER]
    import embreex.rtcore  # loads the library, and what it needs

    folder = Path(embreex.__file__).parent
    paths = [path for pattern in _LIBRARIES for path in folder.glob(pattern)]
    if not paths:
        raise NoKernelError(f"embreex {version('embreex')} has no library of Embree")
    try:
        embree = ctypes.CDLL(str(paths[0]))
        for name, (result, arguments) in _SIGNATURES.items():
            function = getattr(embree, name)
            function.restype, function.argtypes = result, arguments
        for width, _ in _NATIVE:
            _functions(embree, width, occluded=False), _functions(embree, width, occluded=True)
    except (OSError, AttributeError) as error:
        raise NoKernelError(f"{paths[0].name} can't be used ({error})") from error
    device = embree.rtcNewDevice(None)
    try:
        embree_version = int(embree.rtcGetDeviceProperty(device, _VERSION))
        native = [width for width, number in _NATIVE if embree.rtcGetDeviceProperty(device, number)]
    finally:
        embree.rtcReleaseDevice(device)
    if embree_version // 100 != _EMBREE:
        raise NoKernelError(f"Embree is {embree_version}, and not {_EMBREE}xx")
    if not native:
        raise NoKernelError("Embree has no packets for this processor")
    return Packets(embree, kernel, native[0])


def _functions(embree: ctypes.CDLL, width: int, occluded: bool) -> tuple[int | None, int | None]:
    """Return the addresses of Embree's functions that cast one ray, and a packet of rays.

    Args:
        embree: the library.
        width: rays per packet.
        occluded: functions that only tell whether anything is hit; else those that find the first face.
    """
    name = "rtcOccluded" if occluded else "rtcIntersect"
    single_ray, ray_packet = (ctypes.cast(getattr(embree, f"{name}{number}"), _POINTER).value for number in (1, width))
    return single_ray, ray_packet


class PacketScene:
    """A mesh in Embree, at which rays are cast in packets.

    Args:
        packets: the libraries.
        vertices: (V, 3) m.
        triangles: (T, 3) indices; not copied where they are int32 and C-contiguous.
        robust: no ray slips through an edge that two faces share.
        packing: of the rays.

    Raises:
        MemoryError: too little for Embree's tree.
        RuntimeError: Embree says that something else is wrong.
    """

    def __init__(
        self,
        packets: Packets,
        vertices: Float32,
        triangles: NDArray[np.int32],
        robust: bool = True,
        packing: Packing = USUAL,
    ) -> None:
        self._packets, self._packing = packets, packing
        self._triangles = len(triangles)
        if not self._triangles:
            return
        # Embree reads 16 bytes at each vertex: of the last, 4 beyond it.
        padded_vertices = np.zeros((len(vertices) + 1, 3), np.float32)
        padded_vertices[:-1] = vertices
        indices = np.ascontiguousarray(triangles, np.int32)
        embree = packets.embree
        device = embree.rtcNewDevice(None)
        try:
            self._scene = embree.rtcNewScene(device)
            # The arrays are Embree's as long as the scene is.
            weakref.finalize(self, _release, embree, self._scene, padded_vertices, indices)
            embree.rtcSetSceneFlags(self._scene, _ROBUST if robust else 0)
            mesh = embree.rtcNewGeometry(device, _TRIANGLES)
            for kind, form, array, count in (
                (_VERTEX, _FLOAT3, padded_vertices, len(vertices)),
                (_INDEX, _UINT3, indices, len(indices)),
            ):
                embree.rtcSetSharedGeometryBuffer(mesh, kind, 0, form, array.ctypes.data, 0, _ROW, count)
            embree.rtcCommitGeometry(mesh)
            embree.rtcAttachGeometry(self._scene, mesh)
            embree.rtcReleaseGeometry(mesh)
            embree.rtcCommitScene(self._scene)
            error_code = embree.rtcGetDeviceError(device)
        finally:
            embree.rtcReleaseDevice(device)
        if error_code:
            raise MemoryError if error_code == _OUT_OF_MEMORY else RuntimeError(f"Embree's error {error_code}")

    def cast(self, origins: Float32, directions: Float32, maximum_range: float | Float32) -> NDArray[np.int32]:
        """Return the index (N,) of the first face that each ray (N, 3) hits within its range (m), -1 for none."""
        return self._cast(origins, directions, maximum_range, occluded=False)

    def occluded(self, origins: Float32, directions: Float32, maximum_range: float | Float32) -> Bool:
        """Return a mask (N,) of the rays (N, 3) that hit anything within their range (m)."""
        return self._cast(origins, directions, maximum_range, occluded=True) > 0

    def _cast(
        self, origins: Float32, directions: Float32, maximum_range: float | Float32, occluded: bool
    ) -> NDArray[np.int32]:
        """Return a face (N,) that each ray hits, -1 for none.

        Args:
            origins, directions: (N, 3) m, and unit vectors.
            maximum_range: of all rays, or (N,) of each, m.
            occluded: any face will do, with 1 in place of its number; else it is the first one.
        """
        faces = np.full(len(origins), -1, np.int32)
        if not self._triangles or not len(origins):
            return faces
        origins, directions = (np.ascontiguousarray(array, np.float32) for array in (origins, directions))
        limits = np.ascontiguousarray(maximum_range, np.float32)
        if origins.shape != (len(faces), 3) or directions.shape != origins.shape or limits.size not in (1, len(faces)):
            raise ValueError(
                f"origins, directions and ranges of rays must have the shapes (N, 3), (N, 3), 1 or N, but have "
                f"{origins.shape}, {directions.shape}, {limits.shape}"
            )
        rays = _Rays(origins.ctypes.data, directions.ctypes.data, limits.ctypes.data, int(limits.size > 1))
        self._packets.kernel.synthroads_cast(
            ctypes.byref(self.casting(occluded)), self._scene, len(faces), ctypes.byref(rays), faces.ctypes.data
        )
        return faces

    def casting(self, occluded: bool = False) -> ctypes.Structure:
        """Return the settings of casting, `Casts` of packets.c, for a call that begins with no ray cast yet.

        Args:
            occluded: see `_cast`.
        """
        packing = self._packing
        width = packing.width or self._packets.width
        functions = _functions(self._packets.embree, width, occluded)
        changes = int((width - 1) * packing.most_changes + 1e-6)
        return _Casts(*functions, width, occluded, packing.flags, packing.least_cosine, packing.widest, changes, 0)

    @property
    def native(self) -> tuple[int, int]:
        """Return the addresses of packets.c's casting function and of Embree's scene, which must have faces."""
        function = ctypes.cast(self._packets.kernel.synthroads_cast, _POINTER).value
        assert function is not None
        return function, self._scene


def _release(embree: ctypes.CDLL, scene: int, *_arrays: Any) -> None:
    """Free a scene of Embree; the arrays that it reads live as long as this call is due."""
    embree.rtcReleaseScene(scene)


def _same_as_embreex(packets: Packets) -> bool:
    """Return whether rays at a small mesh meet the faces that `embreex` finds, in packets and one by one."""
    # Like the library, only where it is there.
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    vertices, triangles = _waves()
    reference = EmbreeScene(robust=True)
    # Each ray meets a face of its own.
    scene = PacketScene(packets, vertices, triangles, packing=replace(USUAL, most_changes=1.0))
    TriangleMesh(reference, vertices, triangles)
    for origins, directions, limits in _test_rays(vertices[triangles].mean(axis=1)):
        reference_faces = reference.run(origins, directions, dists=limits.copy())
        reference_occlusion = reference.run(origins, directions, dists=limits.copy(), query="OCCLUDED") == 0
        if (scene.cast(origins, directions, limits) != reference_faces).any():
            return False
        if (scene.occluded(origins, directions, limits) != reference_occlusion).any():
            return False
    return True


_SIDE = 7
"""Vertices along a side of the mesh for the comparison."""


def _waves() -> tuple[Float32, NDArray[np.int32]]:
    """Return the vertices (49, 3), m, and triangles (72, 3) of a mesh with hills, 6 m x 6 m, to compare casters at."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(_SIDE), np.arange(_SIDE), indexing="ij"))
    vertices = np.column_stack([x, y, np.sin(2.0 * x) * np.cos(3.0 * y)]).astype(np.float32)
    corner = (np.arange(_SIDE - 1)[:, None] * _SIDE + np.arange(_SIDE - 1)).ravel()
    lower_triangles = np.column_stack([corner, corner + _SIDE, corner + 1])
    upper_triangles = np.column_stack([corner + 1, corner + _SIDE, corner + _SIDE + 1])
    return vertices, np.concatenate([lower_triangles, upper_triangles]).astype(np.int32)


def _test_rays(targets: Float32) -> Iterator[tuple[Float32, Float32, Float32]]:
    """Yield origins (N, 3), directions (N, 3) and ranges (N,), m, of rays at places (N, 3) within faces.

    First all rays come from one place high above, so that they run side by side, then from places on all sides. Every
    fifth ray is too short to reach its place.
    """
    steps: Index = np.arange(len(targets))
    for height, radius in ((200.0, 0.0), (2.5, 4.0)):
        origins = np.empty((len(targets), 3), np.float32)
        turn = 2.4 * steps  # from each ray to the next, rad
        # Around the middle of the mesh; the phase of 1.6 makes a sine, nearly, of the cosine.
        origins[:, 0], origins[:, 1] = (3.0 + radius * np.cos(turn + phase) for phase in (0.0, 1.6))
        origins[:, 2] = height
        offset = targets - origins
        length = np.sqrt(np.einsum("ij,ij->i", offset, offset))
        limits = np.where(steps % 5 == 4, 0.2, 2.0) * length
        yield origins, (offset / length[:, None]).astype(np.float32), limits.astype(np.float32)
