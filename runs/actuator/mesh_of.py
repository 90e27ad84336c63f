"""The mesh of an actuator's SPEC for another program: corners of its tetrahedra, faces of the cavity, and
sets.

Usage: python runs/actuator/mesh_of.py SPEC MESH.npz
"""

import sys
from pathlib import Path

import numpy as np

from kolsky.bodies.actuator_reading import read_actuator


def main() -> None:
    """Write the arrays."""
    read = read_actuator(Path(sys.argv[1]))
    mesh = read.actuator.mesh
    if mesh.kind != "tet10":
        raise SystemExit('the mesh must be of 10-node tetrahedra: [geometry] element = "tet10"')
    member = np.zeros(len(mesh.points), dtype=bool)
    member[mesh.nodes(read.actuator.cavities[0])] = True
    corners, inside = [], []
    for face in mesh.element.faces:
        on = mesh.element.nodes_on(face)
        corners.append(mesh.cells[:, on[on < 4]])
        inside.append(member[mesh.cells[:, on]].all(axis=1))
    corners, inside = np.concatenate(corners), np.concatenate(inside)
    _, inverse, counts = np.unique(np.sort(corners, axis=1), axis=0, return_inverse=True, return_counts=True)
    pressed = inside & (counts[inverse.ravel()] == 1)
    mu, bulk = read.actuator.solid.parameters()
    np.savez(
        sys.argv[2],
        points=mesh.points,
        cells=mesh.cells[:, :4],
        cavity=mesh.points[corners[pressed]].mean(axis=1),
        tip=mesh.points[mesh.nodes("tip")[0]],
        line=mesh.points[mesh.nodes("line")],
        line_nodes=mesh.nodes("line"),
        half=np.array("mirror" in mesh.sets),
        material=np.array([mu, bulk, read.actuator.density]),
        pressures=read.pressures,
        names=np.array(list(read.gravities)),
        gravities=np.array(list(read.gravities.values())),
    )


if __name__ == "__main__":
    main()
