"""Quasi-static uniaxial tests: strain, toe, scatter, apparent modulus."""
