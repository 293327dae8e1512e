"""Layers of each return from its material's nodes at the very place; see `calculator`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from threading import Lock
from typing import Any, Protocol

import numpy as np

from ...base.arithmetic.loops import point_loops
from ...base.arrays import AnyArray, Bool, Float32, Index, UInt16, take_rows
from ...base.turns.main_thread import MainThreadCalls
from ...scanning.colour.colour import (
    FROM_NODES,
    LayerSource,
    LayerValues,
    MaterialLayers,
    SeenPoints,
)
from ...scanning.colour.reflection import reflected_sunlight
from ...scanning.colour.request import LayerRequest
from ...scanning.colour.surfaces import SceneSurfaces
from ...scanning.scene.surface_values import POSITION, SurfaceInput
from ..materials.inputs import INCOMING, TRUE_NORMAL

_OF_POINT: dict[SurfaceInput, Callable[[SeenPoints, Index], AnyArray]] = {
    TRUE_NORMAL: lambda points, rows: take_rows(points.normal, rows),
    INCOMING: lambda points, rows: take_rows(points.towards_scanner, rows),
}


class LayerCalculator(Protocol):
    """Works out layers of materials at places.

    Attributes:
        materials: indices of those that it works out.
        layers: names of the layers that come back.
        at_once: places that are worked out at once.
        main_thread: whether it must be used on Blender's main thread; else any threads may use it side by side.
    """

    materials: frozenset[int]
    layers: tuple[str, ...]
    at_once: int
    main_thread: bool

    def inputs_of(self, material: int) -> frozenset[SurfaceInput]:
        """Return what a material asks for, by its index."""
        ...

    def calculate(self, material: Index, values: dict[SurfaceInput, Float32]) -> dict[str, Float32]:
        """Return the layers (N, C) of N places, see `Calculator.calculate`."""
        ...


@dataclass(frozen=True)
class MaterialWork:
    """Work on materials, and how it is done.

    Attributes:
        calculators: of the materials that vary, each of some.
        kernels: how materials are worked out, as the report says it.
        rendered: why Cycles works materials out that others have programs for, by material.
    """

    calculators: Sequence[LayerCalculator]
    kernels: str
    rendered: Mapping[int, str]


class NodeLayers:
    """Source of each return's layers, evaluated from its material's nodes; what is rendered, the main thread renders.

    Args:
        calls: those that it has the main thread make.
        work: what works materials out.
        surfaces: what materials ask of the places.
        fallback: the materials' means.
        rest: what gives the layers of materials that can't be worked out; None for their means.
        obstacles: names of nodes that stand in the way, by material.
        request: that is answered: its scene, and where that begins in the whole road, of which it may be a section.
    """

    def __init__(
        self,
        calls: MainThreadCalls,
        work: MaterialWork,
        surfaces: SceneSurfaces,
        fallback: MaterialLayers,
        rest: LayerSource | None,
        obstacles: Mapping[int, tuple[str, ...]],
        request: LayerRequest,
    ) -> None:
        self._frame, self._unit, materials = np.array(request.frame), request.mesh.unit, request.mesh.materials
        self._work, self._surfaces, self.material, self._rest = work, surfaces, fallback, rest
        self._obstacles, self._materials = obstacles, materials
        self._left_out, self._worked_out, self._counting = np.zeros(len(materials), np.int64), 0, Lock()
        known = np.zeros(len(materials), bool)
        known[list(obstacles)] = True
        self._hard: Bool = known
        self._layers = work.calculators[0].layers if work.calculators else ()
        self._worker = np.full(len(materials), -1, np.int8)
        for number, calculator in enumerate(self._work.calculators):
            self._worker[list(calculator.materials)] = number
        varying = np.zeros(len(materials), bool)
        for name in self._layers:
            varying |= fallback.constants.varies[name]
        self._worker[~varying] = -1
        self._calls = calls
        renders = rest is not None or any(calculator.main_thread for calculator in work.calculators)
        self.calls = calls if renders else None

    @property
    def report(self) -> dict[str, Any]:
        """Return returns and layers evaluated, and materials left out with why and their points, as JSON data."""
        result: dict[str, Any] = {}
        if self._work.calculators:
            result = {"returns": self._worked_out, "layers": list(self._layers), "kernels": self._work.kernels}
        if self._work.rendered:
            reasons = self._work.rendered.items()
            result["by_cycles"] = {self._materials[index]: {"because_of": why} for index, why in reasons}
        if self._obstacles:
            result["left_out"] = {
                self._materials[index]: {"because_of": list(names), "points": int(self._left_out[index])}
                for index, names in self._obstacles.items()
            }
        return result

    def sample(self, points: SeenPoints, names: frozenset[str]) -> LayerValues:
        """Return the wanted layers of N points, and how each point got them (its source)."""
        hard = self._hard[points.material]
        if not hard.any():
            return self._work_out(points, names)
        with self._counting:
            self._left_out += np.bincount(points.material[hard], minlength=len(self._left_out))
        easy, other = np.flatnonzero(~hard), np.flatnonzero(hard)
        rest = self._rest or self.material
        parts = [
            (easy, self._work_out(points.select(easy), names)),
            (other, rest.sample(points.select(other), names)),
        ]
        arrays = {}
        for name, array in parts[0][1].arrays.items():
            arrays[name] = np.empty((len(points), *array.shape[1:]), array.dtype)
        source = np.empty(len(points), np.uint8)
        for rows, values in parts:
            source[rows] = values.source
            for name, array in values.arrays.items():
                arrays[name][rows] = array
        return LayerValues(arrays, source)

    def _work_out(self, points: SeenPoints, wanted: frozenset[str]) -> LayerValues:
        source = np.full(len(points), FROM_NODES, np.uint8)
        channels: dict[str, Float32] = {}
        if self._work.calculators:
            worker = np.take(self._worker, points.material)
            parts = {name: (len(points), 3 if name == "base_color" else 1) for name in self._layers}
            channels = {name: np.zeros(shape, np.float32) for name, shape in parts.items()}
            for number, calculator in enumerate(self._work.calculators):
                mine = np.flatnonzero(worker == number)
                for start in range(0, len(mine), calculator.at_once):
                    self._calculate(calculator, points, mine[start : start + calculator.at_once], channels)
            with self._counting:
                self._worked_out += int((worker >= 0).sum())
        if "rgb" in wanted and self.material.mode == "lit":
            channels["sun"] = self._sunlight(points, channels)
        return self.material.layer_values(points, channels, source, wanted)

    def _calculate(
        self, calculator: LayerCalculator, points: SeenPoints, rows: Index, channels: dict[str, Float32]
    ) -> None:
        """Evaluate the layers of the points of `rows` and write them into the channels, in place."""
        material = np.take(points.material, rows)
        order = np.argsort(material, kind="stable")
        rows, material = np.take(rows, order), np.take(material, order)
        values = self._inputs(calculator, points, rows, material)

        def calculate() -> dict[str, Float32]:
            return calculator.calculate(material.astype(np.intp), values)

        worked_out = self._calls.call(calculate) if calculator.main_thread else calculate()
        for name, array in worked_out.items():
            if (loops := point_loops()) is not None:
                loops.spread(rows, array, channels[name])
            else:
                channels[name][rows] = array

    def _inputs(
        self, calculator: LayerCalculator, points: SeenPoints, rows: Index, material: UInt16
    ) -> dict[SurfaceInput, Float32]:
        """Return the values (N, 4) float32 of all inputs that the materials (ascending) of the points `rows` read."""
        asked: dict[SurfaceInput, list[int]] = {}
        starts = [0, *(np.flatnonzero(material[1:] != material[:-1]) + 1).tolist()]
        spans = dict(zip(material[starts].tolist(), pairwise([*starts, len(material)]), strict=True))
        for number in spans:
            for what in calculator.inputs_of(number):
                asked.setdefault(what, []).append(number)
        values: dict[SurfaceInput, Float32] = {}
        together: dict[tuple[int, ...], list[SurfaceInput]] = {}
        for what, numbers in asked.items():
            if what == POSITION or what in _OF_POINT:
                values[what] = self._of_points(what, points, rows)
            else:
                together.setdefault(tuple(numbers), []).append(what)
        for several, inputs in together.items():
            places = [spans[number] for number in several]
            if len(places) == len(spans):
                values |= self._surfaces.read(inputs, points, rows)
                continue
            mine = np.concatenate([rows[start:end] for start, end in places])
            for what, array in self._surfaces.read(inputs, points, mine).items():
                first, values[what] = 0, np.zeros((len(rows), 4), np.float32)
                for start, end in places:
                    values[what][start:end] = array[first : first + end - start]
                    first += end - start
        return values

    def _of_points(self, what: SurfaceInput, points: SeenPoints, rows: Index) -> Float32:
        """Return an input's values (N, 4) that follow from the points of `rows` alone."""
        loops = point_loops()
        if loops is not None and what in (POSITION, TRUE_NORMAL) and points.normal.dtype == np.float64:
            source, shift = (points.position, self._frame) if what == POSITION else (points.normal, None)
            return loops.inputs(rows, source, shift, self._unit)
        values = np.zeros((len(rows), 4), np.float32)
        if what == POSITION:
            values[:, :3] = (take_rows(points.position, rows) + self._frame) / self._unit
        else:
            values[:, :3] = _OF_POINT[what](points, rows)
        return values

    def _sunlight(self, points: SeenPoints, channels: dict[str, Float32]) -> Float32:
        """Return the sunlight (N, 3) that points reflect towards the scanner, exposed; 0 in shadow."""
        result = np.zeros((len(points), 3), np.float32)
        light = self.material.light
        normal = np.asarray(points.normal, np.float32)
        lit = normal @ light.direction.astype(np.float32) > 0.0
        if points.sunlit is not None:
            lit &= points.sunlit
        rows = np.flatnonzero(lit)
        material = np.take(points.material, rows)

        constants = self.material.constants

        def layer(name: str) -> Float32:
            """Return a layer's values at the lit points: evaluated where it varies, else the material's constant."""
            if (values := constants.chosen(name, rows, channels.get(name), points.material)) is not None:
                return values
            if name not in channels:
                return take_rows(constants.values[name], material)
            use = np.take(constants.varies[name], material)
            return constants.complete(name, take_rows(channels[name], rows), use, material)

        view = take_rows(points.towards_scanner, rows)
        color, roughness, metallic, specular = map(layer, ("base_color", "roughness", "metallic", "specular"))
        shares = reflected_sunlight(
            color, roughness, metallic, specular, take_rows(normal, rows), view, light.direction
        )
        if (loops := point_loops()) is not None:
            loops.spread(rows, shares, result, light.sun.astype(np.float32))
        else:
            result[rows] = shares * light.sun.astype(np.float32)
        return result
