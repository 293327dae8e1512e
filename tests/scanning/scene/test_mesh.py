"""Triangles of a scene: their normals and areas, and arrays that are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.scanning.scene.mesh import SceneMesh, empty_scene_mesh


class TestSceneMesh:
    def arrays(self) -> dict[str, Any]:
        return {
            "vertices": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], np.float32),
            "triangles": np.array([[0, 1, 2], [0, 1, 3]], np.int32),
            "class_id": np.zeros(2, np.uint8),
            "instance_id": np.zeros(2, np.uint32),
            "material": np.zeros(2, np.uint16),
            "materials": ("asphalt",),
            "origin": np.zeros(3),
        }

    def test_normals_and_areas(self) -> None:
        mesh = SceneMesh(**self.arrays())
        assert mesh.normals().tolist() == [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]
        assert mesh.areas().tolist() == [0.5, 0.0]
        assert mesh.normals().dtype == np.float64
        assert len(empty_scene_mesh(np.zeros(3)).normals()) == 0

    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("vertices", np.zeros((4, 3))),
            ("vertices", np.full((4, 3), np.nan, np.float32)),
            ("triangles", np.array([[0, 1, 2], [0, 1, 4]], np.int32)),
            ("triangles", np.array([[0, 1, 2], [0, -1, 3]], np.int32)),
            ("triangles", np.zeros((2, 4), np.int32)),
            ("class_id", np.zeros(3, np.uint8)),
            ("instance_id", np.zeros(2, np.int32)),
            ("material", np.ones(2, np.uint16)),
            ("origin", np.array([0.0, np.inf, 0.0])),
        ],
    )
    def test_wrong_arrays_are_refused_by_name(self, field: str, value: object) -> None:
        with pytest.raises(InputError, match=f"scene mesh: {field}"):
            SceneMesh(**self.arrays() | {field: value})
