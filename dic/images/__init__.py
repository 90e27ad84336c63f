"""Picture files of every kind, read lazily; what is wrong with frames; how good speckles are."""

from dic.images.facts import declared
from dic.images.formats import open_pictures
from dic.images.health import FrameHealth, frame_health, saturated_mask
from dic.images.noise import GreyNoise, grey_noise
from dic.images.quality import SpeckleQuality, speckle_quality
from dic.images.series import PictureError, Pictures

__all__ = [
    "FrameHealth",
    "GreyNoise",
    "PictureError",
    "Pictures",
    "SpeckleQuality",
    "declared",
    "frame_health",
    "grey_noise",
    "open_pictures",
    "saturated_mask",
    "speckle_quality",
]
