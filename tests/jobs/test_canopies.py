"""Closed stands of trees, scanned from the air, beside what is published of real ones (docs/landscape.md)."""

from __future__ import annotations

import pytest

from studies.surfaces.plants import measure_canopy

SHARE = 0.2
"""By how much figures may differ from the published ones, as a share of these."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("species", "season", "to_ground", "returns"),
    [("maple", "summer", 0.22, 1.5), ("maple", "winter", 0.65, None), ("spruce", "summer", 0.30, None)],
)
def test_canopies_return_what_real_ones_do(species: str, season: str, to_ground: float, returns: float | None) -> None:
    figures = measure_canopy(species, season, seed=5)
    print(f"{species}, {season}: {figures}")
    assert figures.pulses > 10_000
    assert figures.to_ground == pytest.approx(to_ground, rel=SHARE)
    if returns is not None:
        assert figures.returns_per_pulse == pytest.approx(returns, rel=SHARE)
    assert figures.return_shares.sum() == pytest.approx(1.0)
