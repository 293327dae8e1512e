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

_POINT_INPUTS: dict[SurfaceInput, Callable[[SeenPoints, Index], AnyArray]] = {
    TRUE_NORMAL: lambda points, rows: take_rows(points.normal, rows),
    INCOMING: lambda points, rows: take_rows(points.towards_scanner, rows),
}
"""Inputs of materials that follow from the points alone: functions of points and their row numbers, to (N, 3)."""


class LayerCalculator(Protocol):
    """Evaluates layers of materials at places.

    Attributes:
        materials: indices of the materials that it evaluates.
        layers: names of the layers that it returns.
        at_once: largest number of places that one call evaluates.
        main_thread: whether only Blender's main thread may use it; else any threads may use it side by side.
    """

    materials: frozenset[int]
    layers: tuple[str, ...]
    at_once: int
    main_thread: bool

    def inputs_of(self, material: int) -> frozenset[SurfaceInput]:
        """Return the inputs (position, normal, attributes, ...) that the material with this index reads."""
        ...

    def calculate(self, material: Index, values: dict[SurfaceInput, Float32]) -> dict[str, Float32]:
        """Return the layers (N, C) of N places, see `Calculator.calculate`."""
        ...


@dataclass(frozen=True)
class MaterialWork:
    """Calculators of a scene's materials, and what the report says of them.

    Attributes:
        calculators: each evaluates some of the materials that vary.
        kernels: how materials are evaluated, as the report says it.
        rendered: for each material that Cycles evaluates for lack of a program, by index: why it has none.
    """

    calculators: Sequence[LayerCalculator]
    kernels: str
    rendered: Mapping[int, str]


class NodeLayers:
    """Source of each return's layers, evaluated from its material's nodes; what is rendered, the main thread renders.

    Args:
        calls: queue of calls that Blender's main thread makes for other threads.
        work: calculators that evaluate the materials' nodes.
        surfaces: the scene mesh's values (attributes, UV maps, ...) that materials read.
        fallback: the materials' mean values.
        rest: source for materials whose nodes can't be evaluated; None to give them their mean values.
        obstacles: names of the nodes that can't be evaluated, by index of the material.
        request: the layers that are requested, the scene mesh, and the origin of its coordinates in the whole road.
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
        self._has_obstacle: Bool = np.zeros(len(materials), bool)
        self._has_obstacle[list(obstacles)] = True
        self._layers = work.calculators[0].layers if work.calculators else ()
        # Number of the calculator of each material, -1 for materials that don't vary.
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
        """Return as JSON data what was evaluated (returns, layers, kernels), and which materials weren't and why."""
        result: dict[str, Any] = {}
        if self._work.calculators:
            result = {"returns": self._worked_out, "layers": list(self._layers), "kernels": self._work.kernels}
        if self._work.rendered:
            reasons = self._work.rendered.items()
            result["by_cycles"] = {self._materials[index]: {"because_of": reason} for index, reason in reasons}
        if self._obstacles:
            result["left_out"] = {
                self._materials[index]: {"because_of": list(names), "points": int(self._left_out[index])}
                for index, names in self._obstacles.items()
            }
        return result

    def sample(self, points: SeenPoints, names: frozenset[str]) -> LayerValues:
        """Return the requested layers of N points, and by what each point got them (`source`)."""
        has_obstacle = self._has_obstacle[points.material]
        if not has_obstacle.any():
            return self._work_out(points, names)
        with self._counting:
            self._left_out += np.bincount(points.material[has_obstacle], minlength=len(self._left_out))
        calculable_rows, obstacle_rows = np.flatnonzero(~has_obstacle), np.flatnonzero(has_obstacle)
        obstacle_source = self._rest or self.material
        parts = [
            (calculable_rows, self._work_out(points.select(calculable_rows), names)),
            (obstacle_rows, obstacle_source.sample(points.select(obstacle_rows), names)),
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

    def _work_out(self, points: SeenPoints, names: frozenset[str]) -> LayerValues:
        """Return the requested layers of N points whose materials' nodes can be evaluated."""
        source = np.full(len(points), FROM_NODES, np.uint8)
        channels: dict[str, Float32] = {}
        if self._work.calculators:
            worker = np.take(self._worker, points.material)
            shapes = {name: (len(points), 3 if name == "base_color" else 1) for name in self._layers}
            channels = {name: np.zeros(shape, np.float32) for name, shape in shapes.items()}
            for number, calculator in enumerate(self._work.calculators):
                rows = np.flatnonzero(worker == number)
                for start in range(0, len(rows), calculator.at_once):
                    self._calculate(calculator, points, rows[start : start + calculator.at_once], channels)
            with self._counting:
                self._worked_out += int((worker >= 0).sum())
        if "rgb" in names and self.material.mode == "lit":
            channels["sun"] = self._sunlight(points, channels)
        return self.material.layer_values(points, channels, source, names)

    def _calculate(
        self, calculator: LayerCalculator, points: SeenPoints, rows: Index, channels: dict[str, Float32]
    ) -> None:
        """Evaluate the layers of the points with the numbers `rows`, and write them into the channels, in place."""
        material = np.take(points.material, rows)
        # Calculators expect the places sorted by material.
        order = np.argsort(material, kind="stable")
        rows, material = np.take(rows, order), np.take(material, order)
        values = self._inputs(calculator, points, rows, material)

        def calculate() -> dict[str, Float32]:
            return calculator.calculate(material.astype(np.intp), values)

        layers = self._calls.call(calculate) if calculator.main_thread else calculate()
        for name, array in layers.items():
            if (loops := point_loops()) is not None:
                loops.spread(rows, array, channels[name])
            else:
                channels[name][rows] = array

    def _inputs(
        self, calculator: LayerCalculator, points: SeenPoints, rows: Index, material: UInt16
    ) -> dict[SurfaceInput, Float32]:
        """Return the values (N, 4) float32 of all inputs that the materials of N points read, by input.

        Args:
            calculator: the calculator of these materials.
            points: all points.
            rows: (N,) numbers of the points among them.
            material: (N,) index of each point's material, ascending.
        """
        # Start and end of each material's points among `rows`.
        starts = [0, *(np.flatnonzero(material[1:] != material[:-1]) + 1).tolist()]
        spans = dict(zip(material[starts].tolist(), pairwise([*starts, len(material)]), strict=True))
        materials_of: dict[SurfaceInput, list[int]] = {}
        for number in spans:
            for surface_input in calculator.inputs_of(number):
                materials_of.setdefault(surface_input, []).append(number)
        values: dict[SurfaceInput, Float32] = {}
        # Inputs that the same materials read are looked up together, which is faster.
        inputs_of: dict[tuple[int, ...], list[SurfaceInput]] = {}
        for surface_input, numbers in materials_of.items():
            if surface_input == POSITION or surface_input in _POINT_INPUTS:
                values[surface_input] = self._of_points(surface_input, points, rows)
            else:
                inputs_of.setdefault(tuple(numbers), []).append(surface_input)
        for reading_materials, inputs in inputs_of.items():
            reading_spans = [spans[number] for number in reading_materials]
            if len(reading_spans) == len(spans):
                values |= self._surfaces.read(inputs, points, rows)
                continue
            reading_rows = np.concatenate([rows[start:end] for start, end in reading_spans])
            for surface_input, array in self._surfaces.read(inputs, points, reading_rows).items():
                # Points of materials that don't read this input have 0.
                input_values = values[surface_input] = np.zeros((len(rows), 4), np.float32)
                position = 0
                for start, end in reading_spans:
                    input_values[start:end] = array[position : position + end - start]
                    position += end - start
        return values

    def _of_points(self, surface_input: SurfaceInput, points: SeenPoints, rows: Index) -> Float32:
        """Return the values (N, 4) of an input that follows from the points of `rows` alone: position, normal, view."""
        loops = point_loops()
        if loops is not None and surface_input in (POSITION, TRUE_NORMAL) and points.normal.dtype == np.float64:
            source, shift = (points.position, self._frame) if surface_input == POSITION else (points.normal, None)
            return loops.inputs(rows, source, shift, self._unit)
        values = np.zeros((len(rows), 4), np.float32)
        if surface_input == POSITION:
            values[:, :3] = (take_rows(points.position, rows) + self._frame) / self._unit
        else:
            values[:, :3] = _POINT_INPUTS[surface_input](points, rows)
        return values

    def _sunlight(self, points: SeenPoints, channels: dict[str, Float32]) -> Float32:
        """Return the sunlight (N, 3) that points reflect towards the scanner, exposed; 0 in shadow."""
        result = np.zeros((len(points), 3), np.float32)
        light = self.material.light
        normal = np.asarray(points.normal, np.float32)
        sunlit = normal @ light.direction.astype(np.float32) > 0.0
        if points.sunlit is not None:
            sunlit &= points.sunlit
        rows = np.flatnonzero(sunlit)
        material = np.take(points.material, rows)

        constants = self.material.constants

        def layer(name: str) -> Float32:
            """Return a layer's values at the lit points: evaluated where it varies, else the material's constant."""
            if (values := constants.chosen(name, rows, channels.get(name), points.material)) is not None:
                return values
            if name not in channels:
                return take_rows(constants.values[name], material)
            is_varying = np.take(constants.varies[name], material)
            return constants.complete(name, take_rows(channels[name], rows), is_varying, material)

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
