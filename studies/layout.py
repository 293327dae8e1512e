"""Draw docs/pictures/layout.png: the packages of the source as floors, read from the contracts in pyproject.toml.

Usage: python studies/layout.py

Each box has the first line of its package's docstring and its number of Python files, so the picture is drawn anew when
files have moved.
"""

from __future__ import annotations

import ast
import sys
import textwrap
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.figure import new_figure, save_figure  # noqa: E402

TARGET = ROOT / "docs" / "pictures" / "layout.png"
ADDON = "synthroads_addon"
COLORS = {"commands": "#dfe3ea", "learning": "#e9dff0", "Blender": "#f7dcc4", "plain": "#d8eadf"}
"""Colour of a box by what its package is or uses."""
WIDTH, SIDE, GAP = 10.0, 2.2, 0.07
"""Width of the picture and of the box beside the floors, and what is left between boxes, inches."""
LINE, LETTER = 0.165, 0.0725
"""Height of a line of text and width of a letter, inches."""


@dataclass(frozen=True)
class Rules:
    """Layers and forbidden imports of packages, as the contracts in pyproject.toml have them.

    Attributes:
        floors: of the add-on from top to bottom, each the packages side by side on it.
        hidden: packages of the add-on that `ml` must not import.
        without_blender: packages that must not import Blender's modules.
    """

    floors: list[list[str]]
    hidden: frozenset[str]
    without_blender: frozenset[str]


def read_rules() -> Rules:
    """Read the layers and forbidden imports from the import contracts in pyproject.toml."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts: list[dict[str, Any]] = settings["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract.get("containers") == [ADDON])
    forbidding_contracts = [contract for contract in contracts if contract["type"] == "forbidden"]
    learning_contract = next(contract for contract in forbidding_contracts if contract["source_modules"] == ["ml"])
    blender_contract = next(contract for contract in forbidding_contracts if "bpy" in contract["forbidden_modules"])
    return Rules(
        [[name.strip() for name in layer.split("|")] for layer in layers],
        frozenset(name.rpartition(".")[2] for name in learning_contract["forbidden_modules"]),
        frozenset(name.rpartition(".")[2] for name in blender_contract["source_modules"]),
    )


@dataclass(frozen=True)
class Box:
    """A package's box in the picture: text, colour and place.

    Attributes:
        name: of the package.
        text: what it holds, and further lines.
        files: number of its Python files.
        color: of the box.
        left, width: inches.
    """

    name: str
    text: str
    files: int
    color: str
    left: float
    width: float

    @property
    def lines(self) -> list[str]:
        """Return the text as lines wrapped to the box's width."""
        letters = int((self.width - 2 * GAP) / LETTER)
        return [line for part in self.text.splitlines() for line in textwrap.wrap(part, letters) or [""]]

    @property
    def height(self) -> float:
        """Return the box's height that its text needs, inches."""
        return LINE * (len(self.lines) + 1) + 3 * GAP

    def draw(self, axes: Axes, top: float, height: float) -> None:
        """Draw the box with its upper edge at `top` and the given height (inches) into the axes."""
        corner = (self.left, top - height)
        style = "round,pad=0,rounding_size=0.05"
        axes.add_patch(
            FancyBboxPatch(corner, self.width, height, boxstyle=style, facecolor=self.color, edgecolor="#555555")
        )
        axes.text(self.left + GAP, top - GAP, self.name, weight="bold", size=10, va="top")
        axes.text(self.left + self.width - GAP, top - GAP, f"{self.files} files", size=8, va="top", ha="right")
        for number, line in enumerate(self.lines, 1):
            axes.text(self.left + GAP, top - GAP - 0.02 - LINE * number, line, size=8.5, va="top")


def make_box(folder: Path, color: str, left: float, width: float, further_lines: Sequence[str] = ()) -> Box:
    """Return a package's box from its docstring, folders and number of files; `further_lines` are lines below."""
    tree = ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))
    lines = [(ast.get_docstring(tree) or "").split("\n\n")[0].replace("`", "")]
    if parts := sorted(path.parent.name for path in folder.glob("*/__init__.py")):
        lines.append(f"Folders: {', '.join(parts)}")
    return Box(folder.name, "\n".join([*lines, *further_lines]), len(list(folder.rglob("*.py"))), color, left, width)


def floor_boxes(rules: Rules) -> Iterator[list[Box]]:
    """Yield the boxes of each floor, from top to bottom; `ml` stands beside those that it may import."""
    for names in rules.floors:
        side_width = 0.0 if set(names) <= rules.hidden else SIDE + GAP
        width = (WIDTH - side_width - (len(names) - 1) * GAP) / len(names)
        yield [
            make_box(
                ROOT / ADDON / name,
                COLORS["plain" if name in rules.without_blender else "Blender"],
                number * (width + GAP),
                width,
            )
            for number, name in enumerate(names)
        ]


def draw(axes: Axes, rules: Rules) -> float:
    """Draw all boxes and the legend from 0 downwards into the axes; return their depth, inches."""
    head = make_box(ROOT / "headless", COLORS["commands"], 0.0, WIDTH)
    head.draw(axes, 0.0, head.height)
    top = -head.height - GAP - LINE
    axes.text(0.0, top + 0.03, f"{ADDON}, floor by floor: each imports only those below it", size=8.5, va="bottom")
    side_top = None
    for boxes in floor_boxes(rules):
        height = max(box.height for box in boxes)
        for box in boxes:
            box.draw(axes, top, height)
        if side_top is None and boxes[-1].left + boxes[-1].width < WIDTH - GAP:
            side_top = top
        top -= height + GAP
    if side_top is not None:
        side_lines = ("", f"It stands on the floors beside it and imports none of {', '.join(sorted(rules.hidden))}.")
        side_box = make_box(ROOT / "ml", COLORS["learning"], WIDTH - SIDE, SIDE, side_lines)
        side_box.draw(axes, side_top, side_top - top - GAP)
    for number, (name, meaning) in enumerate({"Blender": "imports bpy", "plain": "doesn't import bpy itself"}.items()):
        left = 1.6 * number
        axes.add_patch(FancyBboxPatch((left, top - 0.17), 0.2, 0.12, boxstyle="square,pad=0", facecolor=COLORS[name]))
        axes.text(left + 0.27, top - 0.11, meaning, size=8.5, va="center")
    return 0.25 - top


def main() -> None:
    """Write the picture docs/pictures/layout.png."""
    rules = read_rules()
    figure = new_figure(1.0, 1.0, layout=None)
    axes = figure.add_subplot()
    depth = draw(axes, rules)
    figure.set_size_inches(WIDTH + 2 * GAP, depth + 2 * GAP)
    axes.set_position((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(-GAP, WIDTH + GAP)
    axes.set_ylim(-depth - GAP, GAP)
    axes.axis("off")
    save_figure(figure, TARGET, dpi=110)
    print(TARGET.relative_to(ROOT))


if __name__ == "__main__":
    main()
