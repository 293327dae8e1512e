"""Fixtures that tests of scanning share."""

import platform

import pytest

from synthroads_addon.scanning.kernels.points import CompiledPoints, usable_points


@pytest.fixture(params=["usual", "narrow"])
def loops(request: pytest.FixtureRequest) -> CompiledPoints:
    """Return the loops over points, and their versions for processors without wide instructions."""
    found = usable_points()
    assert isinstance(found, CompiledPoints), f"{found}: python tools/build_kernels.py"
    if request.param == "usual":
        return found
    if platform.machine().lower() not in ("x86_64", "amd64"):
        pytest.skip("only x86 has a version without wide instructions")
    return CompiledPoints("_narrow")
