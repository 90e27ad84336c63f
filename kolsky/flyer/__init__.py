"""The flyer: its path, smooth from rest; its flight in three dimensions; the classical look at its test."""

from kolsky.flyer.fit import fit_flyer
from kolsky.flyer.path import FlyerPath

__all__ = ["FlyerPath", "fit_flyer"]
