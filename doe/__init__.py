"""Designs, surrogates, search: a box of named parameters and a function, no physics."""
