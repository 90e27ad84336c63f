"""Measurements of speed; tests do not assert them."""
