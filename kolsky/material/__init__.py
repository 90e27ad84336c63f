"""Quasi-static tests: the material behaviour that is compared with an impact test."""
