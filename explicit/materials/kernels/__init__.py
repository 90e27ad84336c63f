"""Warp functions that laws share."""
