"""Motions: inertia by two implicit schemes, and relaxation of the stress."""
