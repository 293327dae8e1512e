"""Effects on the samples of a training: cheap, on the fly, each drawn from the sample's own stream.

Each is a function in one of the files here, registered by `registry.effect`; `CropEffects` and `SequenceEffects` are
the options of all that act on crops of tiles, and on sequences of slices.
"""

from typing import TYPE_CHECKING

from ...registry import effect_options
from . import crops, slices

if TYPE_CHECKING:
    from .crops import CropEffects as CropEffects
    from .slices import SequenceEffects as SequenceEffects
else:
    CropEffects = effect_options("segmentation", crops.CropEffects)
    SequenceEffects = effect_options("centerline", slices.SequenceEffects)
