"""Quasi-static tests: the material behaviour with which an impact test is compared."""
