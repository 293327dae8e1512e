"""Figures of Matplotlib's, drawn without a window: of commands and of the documentation.

What the extension draws is drawn by Pillow, `synthroads_addon.cloud.tools.diagram`: there is no Matplotlib in it.
"""

from pathlib import Path
from typing import IO, Any, Literal


def new_figure(width: float, height: float, layout: Literal["constrained"] | None = "constrained") -> Any:
    """Return an empty Matplotlib figure, which no window shows and nothing keeps.

    Args:
        width: inches.
        height: inches.
        layout: Matplotlib's engine that arranges its axes; None leaves that to whoever draws.
    """
    from matplotlib.figure import Figure  # takes half a second, which only pictures need

    return Figure(figsize=(width, height), layout=layout)


def save_figure(figure: Any, file: Path | IO[bytes], dpi: float) -> None:
    """Write a figure of `new_figure`, without Matplotlib's version in it, so that the same picture has the same bytes.

    Args:
        figure: is drawn.
        file: its ending says the format; an open one gets a PNG.
        dpi: pixels per inch.
    """
    figure.savefig(file, dpi=dpi, metadata={"Software": None})
