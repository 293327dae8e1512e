"""The shipped model is chosen by what can be measured on a cloud, and the choice says why."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ml.cards import Domain, Figure, ModelCard, model_names, read_card
from ml.choice import CLEARLY, CloudTraits, cloud_traits, domain_distance, nearest_model, with_agreements
from synthroads_addon.base.errors import InputError
from tests.helpers.clouds.road_clouds import block_of, write


def card(
    name: str, density: tuple[float, float], *platforms: Any, needs: tuple[Any, ...] = (), ground_only: bool = False
) -> ModelCard:
    """Return the card of a model that was trained on some clouds."""
    return ModelCard(
        name=name,
        title=name,
        task="segmentation",
        domain=Domain(density=density, platforms=platforms, needs=needs, ground_only=ground_only),
        recipe=("make weights",),
        commit="0123456",
        seed=1,
        scenes=1,
        epochs=1,
        minutes=1.0,
        parameters=1,
        figures=(Figure(name="any", value=1.0, unit="m", inside=True),),
        limits=("Everywhere.",),
    )


AIR, CAR = card("air", (8.0, 40.0), "airborne"), card("car", (50.0, 5000.0), "mobile", "tripod", needs=("intensity",))
INTENSE = frozenset(["intensity"])


@pytest.mark.parametrize(
    ("density", "platform", "chosen", "doubtful"),
    [
        (18.0, "airborne", "air", False),
        (60.0, "airborne", "air", False),
        (300.0, "mobile", "car", False),
        (2.0, "airborne", "air", True),
        (300.0, "uav", "car", True),
    ],
)
def test_the_nearest_model_is_chosen(density: float, platform: Any, chosen: str, doubtful: bool) -> None:
    choice = nearest_model([AIR, CAR], CloudTraits(density, 3.0, platform, INTENSE))
    assert choice.card.name == chosen
    assert choice.doubtful == doubtful
    assert chosen in choice.why()
    assert ("unlike" in choice.why()) == doubtful


def test_a_model_of_ground_alone_is_for_clouds_in_which_nothing_stands() -> None:
    strips = card("strips", (8.0, 40.0), "airborne", ground_only=True)
    bare, whole = (CloudTraits(18.0, 3.0, "airborne", INTENSE, ground_only) for ground_only in (True, False))
    for cards in ([AIR, strips], [strips, AIR]):
        assert nearest_model(cards, bare).card.name == "strips"
        assert nearest_model(cards, whole).card.name == "air"
    assert nearest_model([AIR], bare).distance == 0.0
    assert domain_distance(strips, whole) == inf
    # Dense bare ground that no model knows the like of may still be the other model's.
    assert nearest_model([strips, CAR], CloudTraits(300.0, 3.0, "mobile", INTENSE, ground_only=True)).card.name == "car"
    assert ", ground only" in nearest_model([strips], bare).why()


@pytest.mark.parametrize(
    ("count", "height", "ground_only"), [(24_000, 0.3, True), (24_000, 2.0, False), (3200, 0.3, False)]
)
def test_posts_and_plants_tell_that_something_stands_in_a_cloud(
    tmp_path: Path, count: int, height: float, ground_only: bool
) -> None:
    """The ground lies on a slope, and a hundredth of the square metres has something on it; thin clouds don't tell."""
    rng = np.random.default_rng(1)
    places = rng.uniform(0.0, 40.0, (count, 2))
    stands = (places % 10.0 < 1.0).all(axis=1)
    xyz = np.column_stack([places, 0.3 * places[:, 0] + np.where(stands, rng.uniform(0.0, height, count), 0.0)])
    traits = cloud_traits(write(tmp_path / "a.laz", block_of(xyz, rng.uniform(0.1, 0.9, count), np.zeros(count))))
    assert traits.ground_only == ground_only
    assert traits.platform == "airborne"


@pytest.mark.parametrize(
    ("density", "platform", "name"),
    [
        (18.0, "airborne", "segmentation-overhead"),
        (300.0, "uav", "segmentation-overhead"),
        (8.0, "sweep", "segmentation-sweeps"),
        (50.0, "mobile", "segmentation-terrestrial"),
        (275.0, "mobile", "segmentation-terrestrial"),
        (3000.0, "tripod", "segmentation-terrestrial"),
    ],
)
def test_each_kind_of_survey_has_a_shipped_model(density: float, platform: Any, name: str) -> None:
    cards = [read_card(model) for model in model_names("segmentation")]
    choice = nearest_model(cards, CloudTraits(density, 20.0, platform, INTENSE))
    assert choice.card.name == name
    assert not choice.doubtful
    assert choice.distance == 0.0


def test_strips_of_ground_have_a_shipped_model_of_their_own() -> None:
    cards = [read_card(model) for model in model_names("segmentation")]
    choice = nearest_model(cards, CloudTraits(18.0, 3.0, "airborne", INTENSE, ground_only=True))
    assert choice.card.name == "segmentation-strips"
    assert not choice.doubtful


def test_a_cloud_without_what_a_model_needs_is_not_for_it() -> None:
    plain = CloudTraits(300.0, 30.0, "mobile", frozenset())
    assert domain_distance(CAR, plain) == inf
    assert nearest_model([AIR, CAR], plain).card.name == "air"
    with pytest.raises(InputError, match="need clouds with intensity"):
        nearest_model([CAR], plain)


def test_traits_are_measured_on_the_cloud(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    even = np.column_stack([rng.uniform(0.0, 40.0, 16_000), rng.uniform(0.0, 20.0, 16_000), np.zeros(16_000)])
    traits = cloud_traits(write(tmp_path / "even.laz", block_of(even, rng.uniform(0.1, 0.9, 16_000), np.zeros(16_000))))
    assert traits.density == pytest.approx(20.0, abs=1.0)
    assert traits.platform == "airborne"
    assert traits.attributes == INTENSE
    angle, away = rng.uniform(0.0, 2.0 * np.pi, 16_000), 2.0 + rng.exponential(6.0, 16_000)
    swept = np.column_stack([away * np.cos(angle), away * np.sin(angle), np.zeros(16_000)])
    traits = cloud_traits(write(tmp_path / "sweep.laz", block_of(swept, np.full(16_000, 0.5), np.zeros(16_000))))
    assert traits.platform == "tripod"
    assert traits.attributes == frozenset()


@pytest.mark.parametrize(("hidden", "platform"), [(0.0, "uav"), (0.02, "uav"), (0.12, "mobile")])
def test_gaps_tell_a_dense_even_cloud_of_the_road_from_one_from_the_air(
    tmp_path: Path, hidden: float, platform: str
) -> None:
    """Drives that were thinned to a grid are as even as clouds from the air."""
    rng = np.random.default_rng(1)
    squares = np.stack(np.meshgrid(np.arange(160), np.arange(40)), axis=-1).reshape(-1, 2)
    squares = squares[rng.random(len(squares)) >= hidden]
    places = np.repeat(squares, 80, axis=0) + rng.uniform(0.0, 1.0, (80 * len(squares), 2))
    xyz = np.column_stack([places, np.zeros(len(places))])
    traits = cloud_traits(
        write(tmp_path / "even.laz", block_of(xyz, rng.uniform(0.1, 0.9, len(xyz)), np.zeros(len(xyz))))
    )
    assert traits.unevenness < 2.0
    assert traits.platform == platform


def test_a_model_that_clearly_agrees_more_with_itself_is_taken_and_said() -> None:
    choice = nearest_model([AIR, CAR], CloudTraits(300.0, 3.0, "uav", INTENSE))
    assert choice.card.name == "car"
    close = with_agreements(choice, [AIR, CAR], {"air": 0.70 + 0.9 * CLEARLY, "car": 0.70})
    assert close.card.name == "car"
    clear = with_agreements(choice, [AIR, CAR], {"air": 0.70 + 1.1 * CLEARLY, "car": 0.70})
    assert clear.card.name == "air"
    assert clear.distance == domain_distance(AIR, choice.traits)
    for tried in (close, clear):
        assert "air 0.7" in tried.why()
        assert "car 0.70" in tried.why()
        assert set(tried.to_dict()["agreements"]) == {"air", "car"}
    assert "agreements" not in choice.to_dict()
