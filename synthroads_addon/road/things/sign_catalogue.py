"""The catalogue of traffic signs: what stands on which sign, and in which colours.

It is `presets/signs.json` and the signs that guidelines add to it. A code may begin with a country and a point, such as
GB.512-L; one without is of the German catalogue (VzKat).
"""

from functools import cache
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from ...base.files import PRESETS
from ...base.schema import Model, quantity, read_json
from ..guidelines import GUIDELINES
from ..objects import Color
from .sign_outline import FaceShape

Pictogram = Literal[
    "none",
    "number",
    "end",
    "arrow",
    "exit_arrow",
    "curve_left",
    "curve_right",
    "double_curve_left",
    "double_curve_right",
    "narrow_left",
    "narrow_right",
    "works",
    "no_overtaking",
    "bars_1",
    "bars_2",
    "bars_3",
    "down_arrow",
    "chevron_left",
    "chevron_right",
    "town_end",
    "crossing",
    "priority_next",
    "priority_road",
    "no_limit",
    "crossed",
    "pass_left",
    "pass_right",
    "bar",
]

KILOMETRES_PER_HOUR = {"km/h": 1.0, "mph": 1.609344}
"""Kilometres per hour of the units of speed limits: an international mile has 1,609.344 m."""


class SignType(Model):
    """One sign of the catalogue (VzKat), at the size that motorways have (size 3), or that it has elsewhere."""

    description: str = Field(description="What it tells, for people.")
    class_name: str = Field("road_sign", alias="class", description="Semantic class of its faces.")
    shape: FaceShape = Field(description="Outline of its face.")
    width: float = quantity(gt=0, le=12, unit="m", description="Width of the face.")
    height: float = quantity(gt=0, le=8, unit="m", description="Height of the face.")
    lower_edge: float = quantity(2.0, ge=0.3, le=8, unit="m", description="Lower edge of the face above the surface.")
    posts: int = quantity(1, ge=1, le=4, unit="1", description="Number of posts.")
    post_diameter: float = quantity(0.076, ge=0.03, le=0.4, unit="m", description="Diameter of a post.")
    ground: str = Field(description="Colour of the face, by its name in the file.")
    border: str = Field(description="Colour of its border.")
    writing: str = Field(description="Colour of writing and pictogram.")
    pictogram: Pictogram = Field(description="What is drawn on it; a number is its first line of text.")
    text: tuple[str, ...] = Field(
        (), max_length=6, description="Lines of writing; {exit}, {number}, {near}, {middle} and {far} are filled in."
    )
    country: str = Field("DE", pattern="^[A-Z]{2}$", description="Country whose sign it is.")
    speed: float | None = quantity(
        None, gt=0, le=300, unit="1", description="Speed limit that it sets, in its own unit; none if not given."
    )
    speed_unit: Literal["km/h", "mph"] = Field("km/h", description="Unit of the speed limit.")

    motorway: bool = Field(True, description="Whether it may stand beside motorways.")
    anywhere: bool = Field(True, description="Whether it may stand anywhere, as where signs stand at random.")

    @property
    def speed_kmh(self) -> float | None:
        """Return the speed limit that it sets, km/h; None if it sets none."""
        return None if self.speed is None else self.speed * KILOMETRES_PER_HOUR[self.speed_unit]

    def fields(self) -> dict[str, Any]:
        """Return the fields of a `TrafficSign` of this type, all but its code, text and place."""
        return {
            "shape": self.shape,
            "width": self.width,
            "height": self.height,
            "lower_edge": self.lower_edge,
            "posts": self.posts,
            "post_diameter": self.post_diameter,
        }


class SignCatalogue(Model):
    """The catalogue of traffic signs, as its JSON file holds it."""

    colors: dict[str, Color] = Field(description="Colours by name.")
    signs: dict[str, SignType] = Field(description="Signs by their code.")
    destinations: tuple[str, ...] = Field(min_length=4, description="Names of places for destination boards.")

    @model_validator(mode="after")
    def _colors_known(self) -> Self:
        """Return the catalogue unchanged; ValueError if a sign names a colour that isn't among the catalogue's."""
        for code, sign in self.signs.items():
            for name in (sign.ground, sign.border, sign.writing):
                if name not in self.colors:
                    raise ValueError(f"signs.{code}: colour '{name}' must be one of {', '.join(self.colors)}")
        return self


@cache
def sign_catalogue() -> SignCatalogue:
    """Return the catalogue of traffic signs, read once: the shipped one, and what the guidelines add to it."""
    path = PRESETS / "signs.json"
    data = read_json(path)
    for guideline in GUIDELINES.values():
        added_signs = {code: {**sign, "country": guideline.country} for code, sign in guideline.signs.items()}
        data = {**data, "signs": {**data["signs"], **added_signs}}
    return SignCatalogue.from_dict(data, source=f"{path}, or the signs of a guideline")


def signs_of_country(country: str, *, rural: bool) -> list[str]:
    """Return the codes of a country's signs that may stand on country roads or on motorways, in their order."""
    signs = sign_catalogue().signs.items()
    return [code for code, sign in signs if sign.country == country and (rural or sign.motorway)]


def speed_limit_sign(country: str, speed: float) -> str | None:
    """Return the code of a country's sign for a speed limit in km/h, or None if the catalogue has none."""
    signs = sign_catalogue().signs
    codes = [code for code in signs_of_country(country, rural=True) if signs[code].speed_unit == "km/h"]
    return next((code for code in codes if signs[code].speed == speed), None)


def fastest_limit_sign(country: str, speed: float) -> str | None:
    """Return the code of a country's sign for the fastest limit up to a speed in km/h, or None if there is none."""
    limits = {code: sign_catalogue().signs[code].speed_kmh for code in signs_of_country(country, rural=True)}
    allowed = {code: limit for code, limit in limits.items() if limit is not None and limit <= speed}
    return max(allowed, key=allowed.__getitem__, default=None)


def sign_type(code: str) -> SignType | None:
    """Return the entry of a code in the catalogue, or None if there is none."""
    return sign_catalogue().signs.get(code)
