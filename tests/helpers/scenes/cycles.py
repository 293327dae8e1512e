"""Cycles as the judge of materials: their layers at given places."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import bpy

from synthroads_addon.blender.cameras.calculator import Calculator, opened_calculator, reading_copy


@contextmanager
def calculator(items: dict[int, bpy.types.Material], layers: Sequence[str]) -> Iterator[Calculator]:
    """Context of a calculator of materials by their index; removes all its data-blocks on exit.

    Args:
        items: materials that can be worked out, see `material_needs`.
        layers: those that are asked for.
    """
    with ExitStack() as stack:
        copies = {number: stack.enter_context(reading_copy(item, layers)) for number, item in items.items()}
        yield stack.enter_context(opened_calculator(copies, layers))
