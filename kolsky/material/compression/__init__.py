"""Equilibrium of a compressed cylinder between platens, with the derivatives of its force and bulge."""
