"""Warp functions of what relaxes."""
