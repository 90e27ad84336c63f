"""Constitutive laws at a material point: `implicit.laws.solid` says what an element asks of one."""
