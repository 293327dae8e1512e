"""The kernel that the documentation shows compiles, is found, and does what NumPy does."""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.random_streams import stream
from synthroads_addon.scanning.kernels.library import FOLDER, load_kernel
from tests.helpers.page_modules import block_of_page, module_of_page
from tools import build_kernels as builder

pytestmark = pytest.mark.first_python

PAGE = "extend/kernel.md"


def test_the_kernel_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "lengths.c").write_text(block_of_page(PAGE, "c"), encoding="utf-8")
    shutil.copy(FOLDER / "kernel.h", tmp_path)
    monkeypatch.setattr(builder, "KERNELS", tmp_path)
    assert [path.stem for path in builder.build_kernels(builder.this_platform(), tmp_path)]
    module = module_of_page(PAGE, "synthroads_addon/scanning/kernels/lengths.py", monkeypatch)
    assert str(module.usable_lengths()).startswith("lengths-")
    assert str(module.usable_lengths()).endswith("isn't installed")
    monkeypatch.setattr(module, "load_kernel", partial(load_kernel, folder=tmp_path))
    module.usable_lengths.cache_clear()
    vectors = stream(1, "vectors").normal(0.0, 1e3, (3, 1001))
    vectors[:, :4] = np.nan, np.inf, 1e308, 0.0
    with np.errstate(over="ignore"):
        expected = np.sqrt(vectors[0] * vectors[0] + vectors[1] * vectors[1] + vectors[2] * vectors[2])
    np.testing.assert_array_equal(module.usable_lengths().lengths(vectors), expected)
    with pytest.raises(ValueError, match=r"vectors \(2, 5\): \(3, N\)"):
        module.usable_lengths().lengths(np.zeros((2, 5)))
