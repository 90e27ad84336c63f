"""Bars as wave guides: dispersion, attenuation, propagation, separation of waves."""
