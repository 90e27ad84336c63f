"""Rigid-body motion of the flyer: displacement along the axis, poses, registration of an edge strip."""
