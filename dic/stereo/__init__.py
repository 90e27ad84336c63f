"""Two cameras: which point is which, and where it is in space."""
