"""A shot: one test, its apparatus and its measurements, loaded from a folder and checked."""
