"""Energy balance; figures and tolerances as on the page (`energy.py`)."""

import energy
import numpy as np
import pytest
from order import assert_order


@pytest.mark.parametrize("kind", ["deviatoric", "full"])
def test_work_is_the_sum_of_its_parts(kind: str) -> None:
    assert energy.case().ledgers[kind].imbalance().max() < energy.TOLERANCE


@pytest.mark.parametrize("kind", ["deviatoric", "full"])
def test_every_term_is_there(kind: str) -> None:
    ledger = energy.case().ledgers[kind]
    for name in energy.TERMS:
        values = getattr(ledger, name)[1:, -1]  # all but f = 0, which has no friction
        assert (values > 0.0).all(), name
    assert (ledger.friction[0] == 0.0).all()


@pytest.mark.parametrize("kind", ["deviatoric", "full"])
@pytest.mark.parametrize("name", ["damping", "friction"])
def test_a_dissipation_never_gives_energy_back(kind: str, name: str) -> None:
    # -1e-9 J is 1e-7 of the work: the half of a step that the ledger estimates.
    assert np.diff(getattr(energy.case().ledgers[kind], name), axis=1).min() > -1e-9


def test_work_is_that_of_the_recorded_impulses_and_motions() -> None:
    assert energy.case().work_error < 5e-4  # force known by its mean over 0.5 us; ledger at a step's start


def test_residual_falls_with_the_step() -> None:
    # Second order of the undamped scheme, first order of the lagged damping velocity: in between.
    assert_order(energy.STEPS, energy.case().refined, 1.0, 0.15, at_least=True)


def test_landing_loss_vanishes_with_the_mesh() -> None:
    share = list(energy.case().impact_share.values())
    # Mass of the surface nodes, so first order in the element; contact order differs from mesh to mesh.
    assert_order([4.0, 2.0, 1.0], share, 1.0, 0.25)
