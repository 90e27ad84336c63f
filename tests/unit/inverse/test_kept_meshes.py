"""Meshes of a shot are made once: what is computed from them lasts, and another specimen has another."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.shot.load import load_shot

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


def test_a_mesh_is_kept_for_its_specimen_and_its_numerics() -> None:
    forward = prepare_shot(load_shot(OPEN_01)).forward
    numerics = Numerics(mesh=(6, 8))
    mesh = forward.mesh(numerics)
    specimen = forward.shot.specimen
    assert replace(forward, paths=forward.paths[:1]).mesh(replace(numerics, safety=0.5)) is mesh
    assert (mesh.nodes[:, 0].max(), mesh.length) == (specimen.radius, specimen.length)
    assert forward.mesh(replace(numerics, mesh=(8, 6))).n_elements == 48
    graded = forward.mesh(replace(numerics, grading=1.0 + numerics.grading))
    assert not np.array_equal(graded.nodes, mesh.nodes)
    longer = replace(forward.shot, specimen=replace(specimen, length=1.01 * specimen.length))
    assert replace(forward, shot=longer).mesh(numerics).length == 1.01 * specimen.length
    wider = replace(forward.shot, specimen=replace(specimen, diameter=1.01 * specimen.diameter))
    assert replace(forward, shot=wider).mesh(numerics).nodes[:, 0].max() == 0.5 * 1.01 * specimen.diameter
