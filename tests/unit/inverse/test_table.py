"""The table of runs: each point once for the paper's cost, and NaN where a run did not complete."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from doe import Box
from explicit import Ending, Outcome
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.run_table import RunTable, Terms
from kolsky.inverse.settings import Numerics
from kolsky.shot.load import load_shot


def terms(phi: float) -> Terms:
    return Terms(1e-3 * phi, 10.0 * phi, phi, 0.0, 0.0, 0.0, 1.0, 2.0, 3, 4, 0)


def table() -> RunTable:
    made = RunTable(("stiffness_factor",))
    rows = (
        ("design", 0.75, "COMPLETED", 5.0),
        ("design", 1.0, "INVERTED", None),
        ("design", 1.25, "COMPLETED", 3.0),
        ("refinement", 1.25, "COMPLETED", 3.0),  # the same point again, the same run
        ("refinement", 1.25 + 1e-14, "COMPLETED", 3.0),  # and but for round-off
        ("refinement", 1.1, "COMPLETED", 1.0),
        ("check", 1.12, "COMPLETED", 0.5),  # another mesh
    )
    for stage, point, outcome, phi in rows:
        made.points.append(np.array([point]))
        made.stages.append(stage)
        made.endings.append(
            Ending(Outcome.COMPLETED, 1e-3)
            if outcome == "COMPLETED"
            else Ending(Outcome[outcome], 4e-4, 17, (4.6e-3, 0.2e-3))
        )
        made.terms.append(None if phi is None else terms(phi))
    return made


def test_paper_cost_has_each_completed_point_of_the_surrogates_mesh_once() -> None:
    points, cost = table().paper_cost()
    np.testing.assert_allclose(points[:, 0], [0.75, 1.1, 1.25], rtol=1e-12)
    np.testing.assert_array_equal(cost, [5.0, 1.0, 3.0])


def test_a_lost_run_keeps_its_place_with_nan_misfits() -> None:
    built = table().build(Box.of({"stiffness_factor": (0.5, 1.5)}))
    assert len(built.outcomes) == len(built.points) == 7
    assert np.isnan(built.phi_force[1])
    assert np.isnan(built.chi2_shape[1])
    assert built.outcomes[1] == "INVERTED"
    assert built.lost == (1,)
    assert built.ending(1).where == "at 400.0 us in element 17 (R = 4.60 mm, Y = 0.20 mm)"
    assert built.ending(0).outcome.ok
    np.testing.assert_array_equal(built.phi_force[[0, 2, 6]], [50.0, 30.0, 5.0])
    assert (built.lower[0], built.upper[0]) == (0.5, 1.5)


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
