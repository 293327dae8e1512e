"""OpenCRG read back by a reader that follows the published format: heights and places within a millimetre."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.pavement.surface import PavementSurface
from synthroads_addon.road.section import Carriageway
from synthroads_addon.twin.opencrg import ACROSS, write_opencrg
from tests.helpers.effects.road_cases import base_road

MILLIMETRE = 0.001


class CrgFile:
    """An OpenCRG 1.1 file of the format KRBI: values of its header by keyword, and its channels (R, 1 + V)."""

    def __init__(self, path: Path) -> None:
        text, _, data = path.read_bytes().partition(b"$" * 72 + b"\n")
        lines = text.decode("ascii").splitlines()
        assert max(map(len, lines)) <= 72
        pairs = [line.partition("=") for line in lines if "=" in line]
        self.head = {key.strip(): float(value) for key, equals, value in pairs if equals}
        channels = [line for line in lines if line.startswith("D:")]
        assert channels[0] == "D:reference line phi,rad"
        assert "#:KRBI" in lines
        assert len(data) % 80 == 0
        numbers = np.frombuffer(data, ">f4")
        rows = len(numbers) // len(channels)
        self.records = numbers[: rows * len(channels)].reshape(rows, -1).astype(np.float64)
        padding = numbers[rows * len(channels) :]
        assert np.isnan(padding).all()
        whole = [not np.isnan(record).all() for record in self.records]
        self.records = self.records[whole]
        self.v = (
            self.head["LONG_SECTION_V_RIGHT"] + np.arange(len(channels) - 1) * self.head["LONG_SECTION_V_INCREMENT"]
        )
        self.u = self.head["REFERENCE_LINE_START_U"] + np.arange(len(self.records)) * self.step

    @property
    def step(self) -> float:
        return self.head["REFERENCE_LINE_INCREMENT"]

    def line(self) -> np.ndarray:
        """Return the reference line's points (R, 2): from the start, leg by leg in their headings."""
        heading = self.records[1:, 0]
        legs = np.column_stack([np.cos(heading), np.sin(heading)]) * self.step
        start = [self.head["REFERENCE_LINE_START_X"], self.head["REFERENCE_LINE_START_Y"]]
        return np.vstack([start, start + np.cumsum(legs, axis=0)])

    def elevation(self) -> np.ndarray:
        """Return elevations (R, V); the line's own is the same all along."""
        return self.head["REFERENCE_LINE_START_Z"] + self.records[:, 1:]


@pytest.fixture(scope="module")
def road() -> RoadParameters:
    return RoadParameters.from_dict(base_road({}))


@pytest.fixture(scope="module")
def file(road: RoadParameters, tmp_path_factory: pytest.TempPathFactory) -> CrgFile:
    path = tmp_path_factory.mktemp("crg") / "twin.crg"
    write_opencrg(road, path, 0.005)
    return CrgFile(path)


def test_heights_read_back_are_those_of_the_pavement(road: RoadParameters, file: CrgFile) -> None:
    geometry, surface = RoadGeometry(road), PavementSurface(RoadGeometry(road))
    assert file.u[-1] == pytest.approx(geometry.length, abs=1e-9)
    assert file.head["REFERENCE_LINE_END_U"] == pytest.approx(geometry.length)
    along, across = (grid.ravel() for grid in np.meshgrid(file.u, file.v, indexing="ij"))
    paved = surface.is_paved("left", along, across) | surface.is_paved("right", along, across)
    found = file.elevation().ravel()
    edge = {side: section.paved_edge(along) for side, section in geometry.sections.items()}
    assert np.isnan(found[(across > edge["left"] + 1e-6) | (-across > edge["right"] + 1e-6)]).all()
    # The median is filled in, so that there are no gaps.
    assert not np.isnan(found[(across < edge["left"] - 1e-6) & (-across < edge["right"] - 1e-6)]).any()
    assert 0.6 < paved.mean() < 0.95
    paved &= ~np.isnan(found)
    rows = np.flatnonzero(paved)[::7]
    expected = geometry.elevation(along[rows], across[rows]) + surface.height(along[rows], across[rows])
    off = np.abs(found[rows] - expected - road.transform.translate[2])
    # On a joint's very edge rounding says which side a place is on.
    joint = {carriageway.pavement.joint_depth for carriageway in road.of_type(Carriageway).values()}
    assert np.mean(off > MILLIMETRE / 10.0) < 1e-3
    assert off.max() < max(joint) + MILLIMETRE / 10.0
    # Waves, tracks and damage are in it.
    assert surface.height(along[rows], across[rows]).std() > MILLIMETRE


def test_places_read_back_are_those_of_the_alignment(road: RoadParameters, file: CrgFile) -> None:
    geometry, line = RoadGeometry(road), file.line()
    east, north = road.transform.translate[:2]
    expected = geometry.alignment.position(file.u) + [east, north]
    assert np.abs(line - expected).max() < MILLIMETRE
    assert line[-1] == pytest.approx([file.head["REFERENCE_LINE_END_X"], file.head["REFERENCE_LINE_END_Y"]], abs=1e-3)
    # Long sections run beside the line: by the mean direction of the legs around each point.
    legs = np.diff(line, axis=0)
    along = legs[:-1] + legs[1:]
    left = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    for offset in file.v[[0, -1]]:
        place = geometry.alignment.place(file.u[1:-1], np.full(len(left), offset)) + [east, north]
        assert np.abs(line[1:-1] + left * offset - place).max() < MILLIMETRE
    assert file.v[0] < -10.0 < 10.0 < file.v[-1]
    assert np.diff(file.v) == pytest.approx(ACROSS)
