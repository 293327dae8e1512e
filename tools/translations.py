"""List what the catalogues of translations lack, and what is left over in them: ``python tools/translations.py``.

It needs Blender (bpy), as it reads the labels and tooltips of the registered panel. ``--write`` adds what is missing to
the catalogues with empty translations, and sorts them; fill them in, and run it again.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
UI = ROOT / "synthroads_addon" / "ui"
_DRAWING = {
    "draw_text": 1,
    "draw_flag": 3,
    "value_row": 1,
    "draw_menu": 3,
    "right_label": 1,
    "poll_message_set": 0,
    "said": 0,
}
"""Function -> place of its argument that is shown."""
_NAMES = ("nothing_done", "no_picture", "reason", "FIRST_STEPS", "IN_BLENDER", "_SURENESS", "_ENDS")
"""Names whose texts are shown."""
_RETURNING = {"succeed", "_sentence", "_compare", "_count", "result_lines", "verdict"}
"""Functions of the panel whose returned texts are shown."""


def source_messages() -> set[str]:
    """Return the texts that the panel's source shows itself, with holes where something is filled in."""
    return {text for path in sorted(UI.rglob("*.py")) for text in _shown(ast.parse(path.read_text("utf-8")))}


def drawn_messages() -> set[str]:
    """Return what is written over the view of drawn roads and of dots: texts that functions put together."""
    import numpy as np

    from synthroads_addon.fitting.tangents import Corner
    from synthroads_addon.jobs.drawn_axis import place_text, rounded_axis
    from synthroads_addon.scenario.road import RoadScenario
    from synthroads_addon.ui.drawing.sketch import radius_text, state_text
    from synthroads_addon.ui.drawing.stations import Dot

    road = RoadScenario()
    bends = np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0], [500.0, 200.0, 0.0], [700.0, 150.0, 0.0]])
    bent, straight = rounded_axis(bends, [None] * 2, road), rounded_axis(bends[:2], [], road)
    texts = [*map(state_text, [None, bent, straight]), place_text(bent.axis, (10.0, 3.0))]
    texts.append(radius_text(Corner(1, 0.5, 900.0, 640.0, 100.0, 0.0, 0.0)))
    for kind in ("start", "end", "element", "vertical"):
        texts.append(f"{Dot(kind, '8', 1, 10.0, 0.0, (0.0, 0.0, 0.0)).title}: station 10.00 m")
    return {line for text in texts for line in text.splitlines()}


def _shown(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield from _of_call(node)
        elif isinstance(node, ast.FunctionDef) and node.name in _RETURNING:
            for part in ast.walk(node):
                if isinstance(part, ast.Return) and part.value is not None:
                    yield from _texts(part.value)
        elif isinstance(node, ast.Assign) and any(
            isinstance(target, ast.Name) and target.id in _NAMES for target in node.targets
        ):
            yield from _texts(node.value)


def _of_call(node: ast.Call) -> Iterator[str]:
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if name in _DRAWING and len(node.args) > _DRAWING[name]:
        yield from _texts(node.args[_DRAWING[name]])
    if name == "InputError" and len(node.args) == 3:
        yield from _texts(node.args[2])
    if name == "report" and len(node.args) == 2:
        yield from _texts(node.args[1])
    if name == "aside" and len(node.args) == 3:
        yield from _texts(node.args[2])
    if name == "Step" and len(node.args) == 2:
        yield from _texts(node.args[1])
    for keyword in node.keywords:
        if keyword.arg == "text" and name in ("label", "operator", "menu", "prop", "progress"):
            yield from _texts(keyword.value)


def _texts(node: ast.expr) -> Iterator[str]:
    """Yield the texts of an expression: a constant, an f-string with holes, either of two, all of some."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        if any(letter.isalpha() for letter in node.value):
            yield node.value
    elif isinstance(node, ast.JoinedStr):
        text, number = "", 0
        for part in node.values:
            if isinstance(part, ast.Constant):
                text += str(part.value)
            else:
                text, number = f"{text}{{{number}}}", number + 1
        if len([letter for letter in text if letter.isalpha()]) > 1:
            yield text
    for part in _parts_of(node):
        yield from _texts(part)


def _parts_of(node: ast.expr) -> list[ast.expr]:
    """Return the expressions that may be shown for another: both sides of a condition, and what a table holds."""
    if isinstance(node, ast.IfExp):
        return [node.body, node.orelse]
    if isinstance(node, ast.Dict):
        return node.values
    return node.elts if isinstance(node, ast.Tuple | ast.List) else []


def main() -> int:
    """Print what each catalogue lacks and has left over; return 1 if anything."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="add what is missing with empty translations, and sort")
    arguments = parser.parse_args()
    import synthroads_addon
    from synthroads_addon.ui.translations.blender import registered_messages
    from synthroads_addon.ui.translations.catalogue import FOLDER, languages
    from tools.library_messages import data_messages, library_messages

    synthroads_addon.register()
    needed = registered_messages() | source_messages() | library_messages() | data_messages() | drawn_messages()
    synthroads_addon.unregister()
    is_complete = True
    for language in languages():
        path = FOLDER / f"{language}.json"
        messages = json.loads(path.read_text(encoding="utf-8"))
        missing, left_over = compare(messages, needed)
        is_complete &= not missing and not left_over
        print(f"{language}: {len(missing)} missing, {len(left_over)} left over of {len(messages)}")
        print("\n".join([*(f"  + {json.dumps(text, ensure_ascii=False)}" for text in missing)]))
        print("\n".join([*(f"  - {json.dumps(text, ensure_ascii=False)}" for text in left_over)]))
        if arguments.write:
            messages |= dict.fromkeys(missing, "")
            text = json.dumps(dict(sorted(messages.items())), ensure_ascii=False, indent=1)
            path.write_text(f"{text}\n", encoding="utf-8")
    return 0 if is_complete else 1


def compare(messages: dict[str, str], needed: set[str]) -> tuple[list[str], list[str]]:
    """Return what a catalogue lacks, in the parts that patterns leave, and its entries that nothing needs, sorted."""
    from synthroads_addon.ui.translations.catalogue import Catalogue

    catalogue, missing = Catalogue({text: value for text, value in messages.items() if value}), set[str]()
    used: set[str] = set()
    for text in needed:
        missing |= catalogue.missing(text, used)
    return sorted(missing), sorted(set(messages) - used - missing)


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)  # Blender's own way out may wait for ever
