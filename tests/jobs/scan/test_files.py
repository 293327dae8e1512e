"""Pictures of a scan are painted beside it: in the blocks' order, and what goes wrong there ends the job."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.jobs.scan.files import CloudFiles
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.scenes.scan_scenes import plane, scan_block, scan_of

pytestmark = pytest.mark.any_blender


BLOCKS = 4


def written_blocks(view: Any, folder: Path) -> list[PointBlock]:
    """Write blocks of a scan to a sink with this view of them; return them."""
    scan = scan_of(plane())
    results = [scan_block(scan, scan.path.strips[0], number) for number in range(BLOCKS)]
    scenario = Scenario.from_dict({"outputs": ["previews"]})
    files = CloudFiles(scenario, ScenarioInputs.read(scenario), folder, np.zeros(3), 60.0, view=view)
    with files.open():
        for result in results:
            files.write(result)
    return [result.points for result in results]


def test_blocks_are_painted_in_their_order_and_all_of_them(tmp_path: Path) -> None:
    painted: list[PointBlock] = []
    saved: list[int] = []
    view = SimpleNamespace(add=painted.append, save=lambda folder, epsg: saved.append(len(painted)))
    blocks = written_blocks(view, tmp_path)
    assert [id(one) for one in painted] == [id(one) for one in blocks]
    assert saved == [len(blocks)], "the pictures are saved when all is painted"


def test_what_goes_wrong_with_the_last_block_ends_the_job(tmp_path: Path) -> None:
    painted: list[PointBlock] = []

    def fail(block: PointBlock) -> None:
        painted.append(block)
        if len(painted) == BLOCKS:
            raise MemoryError("too many cells")

    with pytest.raises(MemoryError, match="too many cells"):
        written_blocks(SimpleNamespace(add=fail, save=lambda folder, epsg: None), tmp_path)
