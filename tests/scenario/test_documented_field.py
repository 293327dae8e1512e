"""The field that the documentation has its readers add."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.jobs.scan import sink
from synthroads_addon.scenario import cloud
from tests.helpers.page_modules import block_of_page
from tests.helpers.scenes.scan_scenes import middle_pulses, plane, scan_of

PAGE = "extend/field.md"


def defined(code: str, module: Any) -> dict[str, Any]:
    """Return the names that code defines where it stands in a module, whose imports it needs."""
    names = dict(vars(module)) | {"replace": replace}
    exec(compile(code, PAGE, "exec", dont_inherit=True), names)
    return names


def test_the_field_of_the_page_keeps_far_points_out_of_the_files() -> None:
    model = defined(f"class Cloud(ClosedModel):\n{block_of_page(PAGE, 'text')}", cloud)["Cloud"]
    effect = block_of_page(PAGE, "text", 1)
    write = defined(f"class Files:\n    def write(self, result):\n{effect}        return result\n", sink)["Files"].write
    result = middle_pulses(scan_of(plane()), 900)
    farthest = float(np.median(result.points.range))
    near = write(SimpleNamespace(scenario=SimpleNamespace(cloud=model(farthest=farthest))), result)
    assert 0 < len(near.points) < len(result.points)
    assert near.points.range.max() <= farthest
    assert write(SimpleNamespace(scenario=SimpleNamespace(cloud=model())), result) is result
    with pytest.raises(InputError, match="farthest is 0"):
        model.from_dict({"farthest": 0})
