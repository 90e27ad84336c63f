"""Picture files of every kind, read lazily: one format a file."""

from dic.images.series import PictureError, Pictures

__all__ = ["PictureError", "Pictures"]
