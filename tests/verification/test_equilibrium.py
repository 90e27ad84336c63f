"""Equilibrium elements; figures and tolerances as on the page (`equilibrium.py`)."""

import equilibrium
import pytest
from equilibrium import inf_sup
from order import assert_order

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("kind", list(equilibrium.ORDERS))
def test_order_of_the_thick_cylinder(kind: str) -> None:
    errors = equilibrium.case().cylinder[kind]
    sizes = [1.0 / n for n in equilibrium.ACROSS]
    assert_order(sizes, errors, equilibrium.ORDERS[kind], equilibrium.ORDER_HELD)


def test_cooks_membrane() -> None:
    membrane = equilibrium.case().membrane
    errors = equilibrium.tip_errors(equilibrium.case())
    assert max(errors.values()) < equilibrium.TIP_HELD, errors
    assert membrane["quad4", "displacement"][-1] < 0.5 * membrane["quad4", "mixed"][-1]  # it locks


def test_inf_sup_constants() -> None:
    result = equilibrium.case()
    for kind in equilibrium.STABLE:
        values = result.constants[kind]
        assert values[-1] > (1.0 - equilibrium.FALL) * values[0] > 0.0
    assert result.constants["quad4"][-1] < 1e-6  # the chessboard
    assert result.solid_constants["hex8"] < 1e-6 < result.solid_constants["hex27"]
    assert inf_sup("hex27", 2) == pytest.approx(result.solid_constants["hex27"], rel=equilibrium.FALL)


def test_forces_of_another_program() -> None:
    assert equilibrium.case().peer < equilibrium.PEER_HELD
