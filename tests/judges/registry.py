"""The one list of judges: what each judges, how it is installed, its version, its verdict and a file it must refuse."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Literal

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.judges import (
    cityjson,
    clouds,
    coordinates,
    ifc,
    images,
    lanelets,
    learning,
    libopendrive,
    opendrive,
    parameters,
    scenes,
    sumo,
    sweeps,
    web_ifc,
)
from tests.judges.samples import Samples

ROOT = Path(__file__).resolve().parents[2]
REQUIRED = "SYNTHROADS_REQUIRE_JUDGES"
"""Environment variable: set, a judge that pip brings and that isn't here is a failure."""
EXTRAS = ("judges", "dev")
"""Extras of pyproject.toml that bring judges; those of `dev` are libraries of ours as well."""
WITH_PIP = "pip install -e '.[dev,judges]'"

Manager = Literal["pip", "pip --no-deps", "npm", "cmake", "file"]


@dataclass(frozen=True)
class Judge:
    """A program of others.

    Attributes:
        name: what it is called; of pip's and npm's also the package.
        judges: the files it judges, and what it looks at.
        manager: what installs it; what `bring` installs goes into ``build/judges``.
        install: the command that installs it, or what to do.
        version: returns its version; None if it isn't here.
        verdict: returns what it finds in the files; nothing if they are right.
        spoil: returns files of which one is wrong; None if there is no file.
        bring: installs it if it can; None if it is installed by hand.
    """

    name: str
    judges: str
    manager: Manager
    install: str
    version: Callable[[], str | None]
    verdict: Callable[[Samples], list[str]]
    spoil: Callable[[Samples], Samples] | None = None
    bring: Callable[[], None] | None = None

    @property
    def slow(self) -> bool:
        """Whether it is left to the slow tests: it has to be downloaded or built."""
        return self.bring is not None

    def comes_with_pip(self) -> bool:
        """Return whether the tests' environment on this Python and system is meant to have it."""
        wanted = _requirements().get(canonicalize_name(self.name), [])
        return self.manager == "pip" and any(item.marker is None or item.marker.evaluate() for item in wanted)


@cache
def _requirements() -> dict[str, list[Requirement]]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found: dict[str, list[Requirement]] = {}
    brought = [text for extra in EXTRAS for text in project["optional-dependencies"][extra]]
    for text in (*project["dependencies"], *brought):
        found.setdefault(canonicalize_name(Requirement(text).name), []).append(Requirement(text))
    return found


def _with_pip(
    name: str,
    judges: str,
    verdict: Callable[[Samples], list[str]],
    spoil: Callable[[Samples], Samples] | None = None,
) -> Judge:
    def version() -> str | None:
        try:
            return metadata.version(name)
        except metadata.PackageNotFoundError:
            return None

    return Judge(name, judges, "pip", WITH_PIP, version, verdict, spoil)


_ALL = (
    _with_pip(
        "asam-qc-opendrive",
        "OpenDRIVE: ASAM's 23 checks, the XML schema of 1.8 among them",
        opendrive.quality_verdict,
        opendrive.with_a_wrong_spiral,
    ),
    _with_pip(
        "eclipse-sumo",
        "OpenDRIVE: lanes, speeds and profile, and vehicles that drive along each through lane, none on a shoulder",
        sumo.verdict,
        sumo.with_an_arc_the_wrong_way,
    ),
    _with_pip("pyxodr", "OpenDRIVE: borders of all lanes", opendrive.pyxodr_verdict, opendrive.with_a_wide_lane),
    _with_pip("ad-map-access", "OpenDRIVE: edges of all lanes", opendrive.ad_map_verdict, opendrive.with_a_wide_lane),
    Judge(
        "libOpenDRIVE",
        "OpenDRIVE: the surface, lane by lane",
        "cmake",
        f"its source and README in {libopendrive.SOURCE}; apt install cmake g++ libpugixml-dev",
        libopendrive.version,
        libopendrive.verdict,
        opendrive.with_a_wide_lane,
        libopendrive.bring,
    ),
    _with_pip(
        "ifcopenshell",
        "IFC: schema and the standard's express rules",
        ifc.verdict,
        ifc.with_a_negative_length,
    ),
    Judge(
        "web-ifc",
        "IFC: products, meshes and their extents, the alignment; not what is placed along it",
        "npm",
        f"node and npm, then: npm install --prefix build/judges/web-ifc web-ifc@{web_ifc.VERSION}",
        web_ifc.version,
        web_ifc.verdict,
        web_ifc.with_a_wrong_radius,
        web_ifc.bring,
    ),
    Judge(
        "cityjson-schema",
        "CityJSON: the official JSON schema of 2.0.2",
        "file",
        f"the schema as {cityjson.BESIDE}, or its path in {cityjson.VARIABLE}",
        cityjson.version,
        cityjson.verdict,
        cityjson.with_wrong_semantics,
    ),
    _with_pip(
        "cjio",
        "CityJSON: vertices, coordinate system, the centreline's length, lanes' widths",
        cityjson.cjio_verdict,
        cityjson.with_a_moved_vertex,
    ),
    _with_pip(
        "jsonschema",
        "the parameter set: the published JSON schema",
        parameters.verdict,
        parameters.with_a_negative_length,
    ),
    _with_pip(
        "pyproj",
        "coordinate systems that OpenDRIVE, IFC, CityJSON, LAZ and E57 name",
        coordinates.verdict,
        coordinates.with_another_meridian,
    ),
    _with_pip("laszip", "LAZ: every point", clouds.laszip_verdict, clouds.with_another_scale),
    _with_pip("copclib", "COPC: every point, in the right node", clouds.copclib_verdict, clouds.with_a_smaller_root),
    _with_pip("plyfile", "PLY: every point", clouds.plyfile_verdict, clouds.with_another_point),
    _with_pip("pypcd4", "PCD: every point", clouds.pypcd4_verdict, clouds.with_another_label),
    _with_pip("pye57", "E57: every point", clouds.pye57_verdict, clouds.with_a_broken_page),
    Judge(
        "nuscenes-devkit",
        "nuScenes: points, boxes and tracks; KITTI, by its reader of that: points and boxes",
        "pip --no-deps",
        f"pip install --no-deps --target build/judges/nuscenes-devkit {' '.join(sweeps.PACKAGES['nuscenes-devkit'])}",
        sweeps.version_of("nuscenes-devkit"),
        sweeps.nuscenes_verdict,
        sweeps.with_a_turned_car,
        sweeps.bring("nuscenes-devkit"),
    ),
    Judge(
        "pykitti",
        "SemanticKITTI: points, poses, times",
        "pip --no-deps",
        f"pip install --no-deps --target build/judges/pykitti {' '.join(sweeps.PACKAGES['pykitti'])}",
        sweeps.version_of("pykitti"),
        sweeps.pykitti_verdict,
        sweeps.with_another_pose,
        sweeps.bring("pykitti"),
    ),
    Judge(
        "vcd",
        "OpenLABEL: the JSON schema of 1.0",
        "pip --no-deps",
        f"pip install --no-deps --target build/judges/vcd {sweeps.PACKAGES['vcd'][0]}",
        sweeps.version_of("vcd"),
        sweeps.openlabel_verdict,
        sweeps.with_an_empty_cuboid,
        sweeps.bring("vcd"),
    ),
    Judge(
        "gltf-validator",
        "glTF, and the tiles of 3D Tiles: Khronos' rules, every triangle",
        "npm",
        f"node and npm, then: npm install --prefix build/judges/gltf-validator gltf-validator@{scenes.GLTF_VALIDATOR}",
        scenes.gltf_version,
        scenes.gltf_verdict,
        scenes.with_a_wrong_bound,
        scenes.bring_gltf,
    ),
    Judge(
        "usd-core",
        "USD: unit and axis, every face's class and instance, places, shared meshes",
        "pip --no-deps",
        f"pip install --no-deps --target build/judges/usd-core usd-core=={scenes.USD_CORE}",
        scenes.usd_version,
        scenes.usd_verdict,
        scenes.with_another_class,
        scenes.bring_usd,
    ),
    Judge(
        "lanelet2",
        "Lanelet2: edges of all lanes, neighbours and followers in its routing graph",
        "pip --no-deps",
        f"pip install --no-deps --target build/judges/lanelet2 lanelet2=={lanelets.VERSION} (Linux)",
        lanelets.version,
        lanelets.verdict,
        lanelets.with_a_moved_node,
        lanelets.bring,
    ),
    Judge(
        "nerfstudio",
        "transforms.json of images: the ray of each pixel, by pinhole, fisheye and panorama",
        "pip --no-deps",
        f"pip install --no-deps --target build/judges/nerfstudio {' '.join(images.PACKAGES)}",
        images.version,
        images.verdict,
        images.with_another_focal_length,
        images.bring,
    ),
    _with_pip("scikit-learn", "scores of the segmentation's evaluation", learning.sklearn_verdict),
    Judge(
        "openpoints",
        "PointNeXt: parameters, and outputs and gradients of the smallest network",
        "pip --no-deps",
        f"pip install --no-deps --target build/judges/openpoints openpoints=={learning.OPENPOINTS}",
        learning.openpoints_version,
        learning.openpoints_verdict,
        bring=learning.bring_openpoints,
    ),
)
JUDGES = {judge.name: judge for judge in _ALL}
"""Every judge by its name."""


def require(name: str) -> Judge:
    """Return a judge; skip the test, or a module's tests, with what to install if it isn't here.

    One that pip brings to this Python fails the test where the environment variable `REQUIRED` is set.
    """
    judge = JUDGES[name]
    if judge.version() is None and judge.bring:
        judge.bring()
    if judge.version() is not None:
        return judge
    missing = f"{name} isn't here: {judge.install}"
    if os.environ.get(REQUIRED) and judge.comes_with_pip():
        pytest.fail(missing, pytrace=False)
    pytest.skip(missing, allow_module_level=True)
