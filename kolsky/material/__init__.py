"""Quasi-static tests: what they say about the material that an impact test is compared with."""
