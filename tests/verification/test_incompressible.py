"""Nearly incompressible runs; figures and tolerances as on the page (`incompressible.py`)."""

from dataclasses import replace

import incompressible as topic
import numpy as np
import pytest
from order import assert_order
from which_element import size

from explicit import Outcome, run_nearly_incompressible

STUDY, NU = topic.STUDY, topic.TARGETS[0]


def hold(one: topic.Correction) -> None:
    """What is asked of every corrected run."""
    assert one.force[1] < topic.FORCE_TOLERANCE * topic.peak()
    assert one.radius[1] < topic.RADIUS_TOLERANCE
    assert one.force[1] < 0.2 * one.force[0]  # or it were not worth its price
    assert one.radius[1] < 0.4 * one.radius[0]
    assert one.force[1] < topic.ESTIMATE * one.force[2]
    assert one.radius[1] < topic.ESTIMATE * one.radius[2]


def test_coarse_mesh() -> None:
    one = topic.correction(STUDY, NU)
    hold(one)
    assert one.cost < topic.COST
    assert one.cost < one.direct_cost


def test_the_ledger_still_balances() -> None:
    energy = topic.corrected(STUDY, topic.CASES[STUDY], NU).response.energy
    assert energy.imbalance().max() < 1e-3  # as of the page on energy


def test_a_run_that_fails_says_so() -> None:
    found = topic.limited(700)
    response = found.response
    assert response.outcomes == (Outcome.STEP_LIMIT,)
    reached = response.force_times <= response.end_times[0]
    assert 0 < reached.sum() < len(reached)
    assert np.isfinite(response.force_flyer[0, reached][:-1]).all()
    assert np.isnan(response.force_flyer[0, ~reached][1:]).all()
    assert np.isnan(response.surface_r[0, -1]).all()
    assert topic.limited(10**6).response.outcomes == (Outcome.COMPLETED,)


def test_cost_counts_every_run() -> None:
    found = topic.corrected(STUDY, topic.CASES[STUDY], NU)
    direct = topic.direct(STUDY, 0.495).steps[0] * STUDY[0] * STUDY[1]
    coarse = sum(
        mesh[0] * mesh[1] * topic.direct(mesh, nu).steps[0]
        for mesh in topic.CASES[STUDY]
        for nu in (0.495, NU)
    )
    assert found.compressible_element_steps[0] == direct
    assert found.element_steps[0] == direct + coarse


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"samples": topic.samples(0.49)}, "poisson must be above compressible = 0.495, got 0.49"),
        ({"sampling": "all"}, "all_nodes is not available"),
        ({"coarse": ((8, 11), (12, 16))}, r"fewer elements than the one before, got \[352, 88, 192\]"),
    ],
)
def test_what_cannot_be_done_is_refused(change: dict[str, object], message: str) -> None:
    forward = topic.runs.shot().forward
    model = forward.model(topic.Numerics(mesh=STUDY))
    coarse = change.get("coarse", ((12, 16), (8, 11)))
    meshes = [forward.mesh(topic.Numerics(mesh=mesh)) for mesh in coarse]  # type: ignore[attr-defined]
    sampling = replace(forward.sampling, all_nodes="sampling" in change)
    with pytest.raises(ValueError, match=message):
        run_nearly_incompressible(
            model,
            (meshes[0], meshes[1]),
            change.get("samples", topic.samples(NU)),  # type: ignore[arg-type]
            sampling,
        )


def test_meshes_of_two_specimens_are_refused() -> None:
    forward = topic.runs.shot().forward
    wide = topic.cylinder(5e-3, 6.5e-3, n_radial=8, n_axial=11)
    mesh = forward.mesh(topic.Numerics(mesh=(12, 16)))
    with pytest.raises(ValueError, match="meshes must be of one specimen, got radius"):
        run_nearly_incompressible(
            forward.model(topic.Numerics(mesh=STUDY)), (mesh, wide), topic.samples(NU), forward.sampling
        )


@pytest.mark.slow
def test_every_mesh_and_ratio() -> None:
    for (_, nu), one in topic.case().corrections.items():
        hold(one)
        if nu == NU:
            assert one.cost < topic.COST
        assert one.cost < 0.6 * one.direct_cost or one.cost < topic.COST


@pytest.mark.slow
def test_error_falls_with_the_mesh_of_the_correction() -> None:
    sizes = [size(mesh) for mesh in topic.LADDER]
    assert_order(sizes, topic.ladder_errors(NU), 2.0, 0.3, at_least=True)  # second order in space, or better


@pytest.mark.slow
def test_identified_stiffness_is_that_of_direct_runs() -> None:
    m = topic.case().factors
    assert m["corrected"] == pytest.approx(m["direct"], abs=topic.FACTOR_TOLERANCE)
    assert abs(m["compressible"] - m["direct"]) > 10 * topic.FACTOR_TOLERANCE  # so the correction matters
