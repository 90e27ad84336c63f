"""Picture files of every kind, read lazily: one format a file."""

from dic.images.declared import declared
from dic.images.formats import open_pictures
from dic.images.series import PictureError, Pictures

__all__ = ["PictureError", "Pictures", "declared", "open_pictures"]
