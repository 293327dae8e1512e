"""Diagrams: the values beside their lines."""

import numpy as np
import pytest
from PIL import Image, ImageDraw

from synthroads_addon.cloud.tools import diagram


@pytest.mark.parametrize(("low", "high", "step"), [(-0.3, 0.3, 0.1), (-0.02, 0.02, 0.01), (-7.0, 9.0, 0.7)])
def test_levels_are_multiples_of_their_step_and_0_is_0(
    low: float, high: float, step: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts: list[str] = []
    monkeypatch.setattr(diagram, "draw_text", lambda draw, place, text, *_, **__: texts.append(text))
    frame = diagram.PlotFrame(
        ImageDraw.Draw(Image.new("RGB", (90, 90))), (9.0, 9.0, 80.0, 80.0), (0.0, low), (1.0, high)
    )
    diagram.draw_levels(frame, step)
    numbers = np.array(texts, float)
    assert "0" in texts
    assert np.allclose(numbers / step, np.round(numbers / step), atol=1e-2)
    assert numbers.min() == pytest.approx(low, abs=1.1 * step)
    assert numbers.max() == pytest.approx(high, abs=1.1 * step)
