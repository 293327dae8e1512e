"""Programs for the kernel of materials: what they work out, by how many registers, and what they refuse."""

from __future__ import annotations

import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.scanning.kernels import library
from synthroads_addon.scanning.kernels.library import FOLDER, NoKernelError, load_kernel, source_digest
from synthroads_addon.scanning.kernels.materials import LANES, run_program, usable_materials
from synthroads_addon.scanning.kernels.program import SCRATCH, WORDS, MaterialProgram, Op, ProgramBuilder
from synthroads_addon.scanning.scene.surface_values import SurfaceInput
from tools.build_kernels import source_digest as digest_of_the_tool

pytestmark = pytest.mark.any_blender

PLACE = SurfaceInput("position")


def run(program: MaterialProgram, values: np.ndarray, narrow: bool = False) -> dict[str, np.ndarray]:
    kernel = usable_materials()
    assert not isinstance(kernel, NoKernelError), f"{kernel}: python tools/build_kernels.py"
    return run_program(kernel, program, dict.fromkeys(program.inputs, values), len(values), narrow)


def places(count: int) -> np.ndarray:
    return np.random.default_rng(2).uniform(-9.0, 9.0, (count, 4)).astype(np.float32)


def test_operations_are_those_of_the_source() -> None:
    source = (FOLDER / "materials.c").read_text(encoding="utf-8")
    found = re.search(r"enum \{\s*(LOAD,.*?)\s*\};", source, re.DOTALL)
    assert found is not None
    assert [name.strip() for name in found[1].split(",")] == [op.name for op in Op]
    for name, value in (("WORDS", WORDS),):
        assert f"#define {name} {value}\n" in source
    assert f"#define LANES {LANES}\n" in (FOLDER / "lanes" / "numbers.h").read_text(encoding="utf-8")


def _sum_and_product() -> ProgramBuilder:
    builder = ProgramBuilder()
    x, y = (builder.load(PLACE, part) for part in range(2))
    half = builder.constant(0.5)
    builder.output("roughness", [builder.add(Op.ADD, builder.add(Op.MULTIPLY, x, y), half)])
    builder.output("base_color", [x, half, builder.add(Op.SUBTRACT, y, x)])
    return builder


@pytest.mark.parametrize("count", [0, 1, LANES - 1, LANES, LANES + 1, 1000])
@pytest.mark.parametrize("narrow", [False, True])
def test_any_number_of_places(count: int, narrow: bool) -> None:
    values = places(count)
    found = run(_sum_and_product().build(("roughness", "base_color")), values, narrow)
    x, y = values[:, 0], values[:, 1]
    np.testing.assert_array_equal(found["roughness"], (x * y + np.float32(0.5))[:, None])
    np.testing.assert_array_equal(found["base_color"], np.stack([x, np.full_like(x, 0.5), y - x], axis=1))


def test_only_what_is_asked_for_is_worked_out() -> None:
    builder = _sum_and_product()
    seldom = SurfaceInput("uv")
    builder.output("metallic", [builder.load(seldom, 2)])
    program = builder.build(("roughness",))
    assert (program.outputs, program.inputs) == ((("roughness", 1),), (PLACE,))
    assert len(program.code) < len(builder.build(("roughness", "base_color")).code)
    assert builder.build(("metallic",)).inputs == (seldom,)


def test_what_is_the_same_everywhere_is_worked_out_once_and_equal_operations_are_one() -> None:
    builder = ProgramBuilder()
    x, two, three = builder.load(PLACE, 0), builder.constant(2.0), builder.constant(3.0)
    six = builder.add(Op.MULTIPLY, two, three)
    assert builder.add(Op.MULTIPLY, two, three) == six
    builder.output("roughness", [builder.add(Op.ADD, x, builder.add(Op.SINE, six))])
    program = builder.build(("roughness",))
    assert program.uniform == 2
    values = places(150)
    expected = values[:, :1] + np.float32(np.sin(6.0))
    np.testing.assert_array_equal(run(program, values)["roughness"], expected)


def test_registers_are_used_again_and_never_while_they_are_needed() -> None:
    """A long chain beside values that are needed at its very end."""
    builder = ProgramBuilder()
    parts = [builder.load(PLACE, part) for part in range(4)]
    total = parts[0]
    for step in range(200):
        total = builder.add(Op.ADD, builder.add(Op.MULTIPLY, total, builder.constant(0.5)), parts[step % 4])
    builder.output("roughness", [builder.add(Op.MULTIPLY, total, parts[3])])
    program = builder.build(("roughness",))
    assert program.registers <= 8
    values = places(100)
    expected = values[:, 0]
    for step in range(200):
        expected = expected * np.float32(0.5) + values[:, step % 4]
    np.testing.assert_array_equal(run(program, values)["roughness"][:, 0], expected * values[:, 3])


FUNCTIONS: dict[Op, tuple[Callable[[np.ndarray], np.ndarray], float, float]] = {
    Op.EXPONENT: (np.exp, -80.0, 80.0),
    Op.SINE: (np.sin, -3e38, 3e38),
    Op.COSINE: (np.cos, -1e6, 1e6),
    Op.TANGENT: (np.tan, -1e5, 1e5),
    Op.ARCSINE: (np.arcsin, -1.0, 1.0),
    Op.ARCCOSINE: (np.arccos, -1.0, 1.0),
    Op.ARCTANGENT: (np.arctan, -1e9, 1e9),
    Op.SINH: (np.sinh, -80.0, 80.0),
    Op.COSH: (np.cosh, -80.0, 80.0),
    Op.TANH: (np.tanh, -12.0, 12.0),
    Op.LOGARITHM: (np.log, 1e-30, 1e30),
}
"""Functions of their own, and where they are compared with those of the C library."""


@pytest.mark.parametrize("op", FUNCTIONS)
def test_functions_are_within_a_digit_of_the_c_librarys(op: Op) -> None:
    function, low, high = FUNCTIONS[op]
    random = np.random.default_rng(9)
    near = random.uniform(max(low, -4.0), min(high, 4.0), 20_000)
    wide = np.concatenate([near, random.uniform(low, high, 20_000), [low, high, max(low, -1e-20), min(high, 1e-20)]])
    if low > 0.0:
        wide = np.concatenate([np.abs(near) + low, 10.0 ** random.uniform(-30.0, 30.0, 20_000)])
    values = np.zeros((len(wide), 4), np.float32)
    values[:, 0] = wide
    builder = ProgramBuilder()
    builder.output("roughness", [builder.add(op, builder.load(PLACE, 0))])
    found = run(builder.build(("roughness",)), values)["roughness"][:, 0]
    exact = function(values[:, 0].astype(np.float64))
    spacing = np.spacing(np.maximum(np.abs(exact), 1e-30).astype(np.float32)).astype(np.float64)
    assert (np.abs(found - exact) <= 0.51 * spacing).all()


def test_threads_side_by_side_give_the_same() -> None:
    builder = ProgramBuilder()
    place = [builder.load(PLACE, part) for part in (0, 1, 2, 0)]
    numbers = [builder.constant(value) for value in (3.0, 0.5, 2.0, 0.0, 1.0)]
    noise = builder.add(Op.FRACTAL, *place, *numbers, settings=(3, 1, 1))
    builder.output("roughness", [noise])
    program, values = builder.build(("roughness",)), places(6400)
    whole = run(program, values)["roughness"]
    with ThreadPoolExecutor(4) as pool:
        parts = list(pool.map(lambda part: run(program, part)["roughness"], np.split(values, 40)))
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert 0.3 < whole.mean() < 0.7
    assert whole.std() > 0.05


def test_values_of_another_shape_are_refused() -> None:
    program = _sum_and_product().build(("roughness",))
    kernel = usable_materials()
    assert not isinstance(kernel, NoKernelError)
    with pytest.raises(ValueError, match=r"must be \(7, 4\)"):
        run_program(kernel, program, {PLACE: places(6)}, 7)
    assert SCRATCH >= 8  # what octaves need, see lanes/noise.h


def test_a_library_of_another_header_is_refused(tmp_path: Path) -> None:
    source = FOLDER / "materials.c"
    assert source_digest(source) == digest_of_the_tool(source)
    headers = [*FOLDER.glob("*.h"), *(FOLDER / "lanes").glob("*.h")]
    for path in (source, *headers, *FOLDER.glob("materials-*")):
        copy = tmp_path / path.relative_to(FOLDER)
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(path.read_bytes())
    load_kernel("materials", tmp_path)
    header = tmp_path / "lanes" / "noise.h"
    header.write_text(header.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    with pytest.raises(NoKernelError, match="of another version: install SynthRoads again"):
        load_kernel("materials", tmp_path)
    assert library.FOLDER == FOLDER
