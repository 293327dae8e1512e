"""`ColourScenario`: where the points' colours and material layers come from, and how finely they are rendered."""

from typing import Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from ..base.schema import ClosedModel, notes, quantity
from ..scanning.colour.colour import ColourMode, ColourSettings, ColourSource, Engine, Lighting

USUAL_RANGE = 60.0
"""Range that the fidelities' spacings and pixels are meant for, m."""
_LEAST_SCALE = 0.5


def image_scale(typical_range: float) -> float:
    """Return the factor on images' spacing and pixels for a range (m): 1 at `USUAL_RANGE`, 0.5 at least."""
    return max(typical_range / USUAL_RANGE, _LEAST_SCALE)


class ColourScenario(ClosedModel):
    """Colours and material layers of the points. What isn't given is the fidelity's own value."""

    source: ColourSource = Field(
        "auto",
        json_schema_extra=notes(
            labels={
                "auto": "Automatic",
                "nodes": "Materials at the Returns",
                "images": "Images Along the Path",
                "returns": "A Pixel per Return",
                "material": "Material's Mean",
            }
        ),
        description="Each material's nodes at the very returns, images along the path, a pixel per return (Blender 5.0 "
        "and newer), or each material's mean; auto takes the nodes, and for whole light paths a pixel per return where "
        "Blender has it.",
    )
    rgb: bool = Field(
        True,
        title="Coloured Points",
        description="Whether the points are coloured; without, RGB is 0 and needs no light.",
    )
    engine: Engine = Field(
        "cycles",
        description="Renderer of the images.",
        json_schema_extra=notes(
            only_with={"source": ("auto", "nodes", "images", "returns")}, labels={"eevee": "EEVEE"}
        ),
    )
    mode: ColourMode = Field(
        "lit",
        title="RGB Shows",
        description="RGB under sun and sky, of the base colour, or of the layers: roughness, metallic, specular "
        "as red, green, blue.",
        json_schema_extra=notes(
            only_with={"rgb": (True,)},
            labels={"lit": "Sun and Sky", "unlit": "Base Colour", "false_colour": "Material Layers"},
        ),
    )
    lighting: Lighting = Field(
        "direct",
        description="Sun with shadows and an open sky, without noise; or whole light paths, which need more samples.",
        json_schema_extra=notes(
            only_with={"source": ("auto", "nodes", "images", "returns")}, labels={"path": "Whole Light Paths"}
        ),
    )
    image_spacing: float | None = quantity(
        None,
        "m",
        "Distance between two images along the path.",
        (0.5, 1000),
        inherits="images.image_spacing",
        only_with={"source": ("auto", "images")},
    )
    ground_sampling_distance: float | None = quantity(
        None,
        "m",
        "Width of a pixel on the ground, or at the platform's usual range.",
        (0.002, 10),
        inherits="images.ground_sampling_distance",
        only_with={"source": ("auto", "images")},
    )
    samples: int | None = quantity(
        None,
        "1",
        "Samples per pixel of the lit colours.",
        (1, 4096),
        inherits="images.samples",
        only_with={"source": ("auto", "images", "returns"), "lighting": ("path",)},
    )
    max_resolution: int = quantity(
        4096, "px", "Largest side of an image.", (16, 16384), only_with={"source": ("auto", "images")}
    )
    intensity_from_layers: Literal["auto", "always", "never"] = Field(
        "auto",
        description="Intensities from each point's own layers, in place of its material's means; auto: where these are "
        "worked out by the materials' nodes, and no table of materials says how the brightness varies.",
        json_schema_extra=notes(
            only_with={"source": ("auto", "nodes", "images", "returns")}, labels={"auto": "If Nodes Have Any"}
        ),
    )

    @field_validator("intensity_from_layers", mode="before")
    @classmethod
    def _yes_or_no(cls, value: Any) -> Any:
        """Return "always" or "never" for true or false; anything else as it is."""
        return {True: "always", False: "never"}[value] if isinstance(value, bool) else value

    @model_validator(mode="after")
    def _check_samples(self) -> Self:
        """Refuse samples with direct lighting."""
        if self.lighting == "direct" and (self.samples or 1) > 1:
            raise ValueError("samples can't be given for direct lighting, which has no noise")
        return self

    def settings(self, fidelity: str, typical_range: float = USUAL_RANGE) -> ColourSettings:
        """Return the colour settings of a fidelity, with the scenario's own values in place of the preset's.

        Args:
            fidelity: draft, standard or high.
            typical_range: the platform's usual range, m: images from farther away are farther apart and coarser.
        """
        preset, scale = COLOUR_FIDELITIES[fidelity], image_scale(typical_range)
        preset_values: dict[str, Any] = {
            "image_spacing": preset.image_spacing * scale,
            "ground_sampling_distance": preset.ground_sampling_distance * scale,
            "samples": 1 if self.lighting == "direct" else preset.samples,
        }
        names = (*preset_values, "source", "engine", "mode", "lighting", "max_resolution")
        own_values = {name: value for name in names if (value := getattr(self, name)) is not None}
        return ColourSettings(**(preset_values | own_values))


COLOUR_FIDELITIES = {
    "draft": ColourSettings(image_spacing=40.0, ground_sampling_distance=0.25, samples=4),
    "standard": ColourSettings(image_spacing=30.0, ground_sampling_distance=0.15, samples=16),
    "high": ColourSettings(image_spacing=15.0, ground_sampling_distance=0.06, samples=64),
}
