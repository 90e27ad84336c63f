"""Surfaces in the test frame: cylinder, outline, strains, noise floors."""
