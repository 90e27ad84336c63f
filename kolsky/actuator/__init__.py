"""Pressurised soft actuators: their geometry, bending, markers, and the pressure for a wanted bend."""
