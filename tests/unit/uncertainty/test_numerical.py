"""The numerics' part of an answer in closed form."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.inverse.forward import Numerics
from kolsky.uncertainty.numerical import MeshChange, mesh_change, numerical_parts

TRUTH = np.array([1.1, 3.0])
JACOBIAN = np.array([[2.0, 0.0], [0.0, 1.0], [1.0, -1.0]])
GAIN = np.linalg.pinv(JACOBIAN)


def planted(ratio: float, order: float, element: Any = None) -> tuple[MeshChange, np.ndarray, np.ndarray]:
    """A linear model whose data on a mesh of size h are J x + e h^order; the optimum on the finer mesh, of
    size 1, and the exact one."""
    error = np.array([0.03, -0.05, 0.02])
    data = JACOBIAN @ TRUTH
    fine, coarse = (data + error * h**order for h in (1.0, ratio))
    on_fine = TRUTH - GAIN @ (fine - data)  # the parameters make up for what the prediction has too much
    return MeshChange(coarse - fine, element, ratio), on_fine, TRUTH


def test_an_error_of_the_fitted_order_is_corrected_whole() -> None:
    change, on_fine, truth = planted(64 / 24, 2.5)
    np.testing.assert_allclose(on_fine + change.correction(GAIN), truth, rtol=1e-13)  # round-off
    assert np.abs(on_fine - truth).min() > 1e-3  # there was something to correct


@pytest.mark.parametrize("order", [2.0, 3.0])
def test_an_error_of_another_order_is_within_twice_what_is_said(order: float) -> None:
    # (q^p - 1) / (q^2.5 - 1) of the error is corrected: 6.11 and 17.96 of 10.61 for a ratio of 8 / 3.
    change, on_fine, truth = planted(8 / 3, order)
    left = on_fine + change.correction(GAIN) - truth
    share = ((8 / 3) ** order - 1.0) / ((8 / 3) ** 2.5 - 1.0)
    np.testing.assert_allclose(left, (1.0 - share) * (on_fine - truth), rtol=1e-12)
    assert (np.abs(left) < 2.0 * change.sigma(GAIN)).all()


def test_the_shift_is_the_refined_mesh_less_the_coarser_one() -> None:
    change, on_fine, truth = planted(2.0, 2.5)
    error = on_fine - truth  # 2^2.5 of it on the coarser mesh
    np.testing.assert_allclose(change.shift(GAIN), error - 2.0**2.5 * error, rtol=1e-12)


def test_what_is_left_is_half_the_correction_and_the_distance_of_the_elements() -> None:
    gain = np.array([[1.0, 0.0], [0.0, 1.0]])
    coarser, element = np.array([0.0106, 0.0]), np.array([0.0, -0.0480])
    change = MeshChange(coarser, element, 8 / 3)
    # (8/3)^2.5 - 1 = 10.612; (8/3)^1.5 = 4.3546 for the gap on the refined mesh, over the root of 3.
    np.testing.assert_allclose(change.correction(gain), [0.0106 / 10.6123, 0.0], rtol=1e-4)
    np.testing.assert_allclose(
        change.sigma(gain), [0.5 * 0.0106 / 10.6123, 0.048 / 4.3546 / 1.73205], rtol=1e-4
    )
    both = MeshChange(coarser, np.array([0.0480, 0.0]), 8 / 3)
    expected = np.hypot(0.5 * 0.0106 / 10.6123, 0.048 / 4.3546 / 1.73205)
    assert both.sigma(gain)[0] == pytest.approx(expected, rel=1e-4)
    # Without the other element the whole correction counts.
    assert MeshChange(coarser, None, 8 / 3).sigma(gain)[0] == pytest.approx(0.0106 / 10.6123, rel=1e-4)


def test_a_mesh_no_finer_than_the_other_is_refused() -> None:
    with pytest.raises(ValueError, match=r"1 times the elements.*more than 1"):
        MeshChange(np.zeros(2), None, 1.0)


def test_roughness_is_a_part_of_its_own() -> None:
    rough, change = np.array([0.2]), MeshChange(np.array([0.0]), None, 2.0)
    found = numerical_parts(change, np.eye(1), roughness=rough)
    assert list(found) == ["mesh", "roughness"]
    assert found["roughness"] is rough
    assert found["mesh"] == 0.0
    assert list(numerical_parts(change, np.eye(1))) == ["mesh"]


def staged(lost: str = "", **offset: float) -> tuple[Any, Any]:
    """Simulations whose data vectors on the surrogate's mesh are known, and an answer."""
    vectors = {"one_point": np.array([7.0, np.nan]), "fbar": np.array([8.5, 2.0])}

    def evaluate(stage: str, points: np.ndarray, numerics: Numerics) -> tuple[Any, Any]:
        assert numerics.mesh == (24, 32)
        return None, None if numerics.element == lost else vectors[numerics.element][None]

    stages = SimpleNamespace(
        settings=SimpleNamespace(numerics=Numerics(), refined_mesh=(64, 86)),
        evaluate=evaluate,
        offsets={(24, 32): np.array(list(offset.values()))} if offset else {},
    )
    fine = SimpleNamespace(
        x=np.array([1.0]),
        jacobian=np.array([[3.0], [0.5]]),
        model=lambda x: np.array([[6.0, 2.0]]),
        objective=SimpleNamespace(vectors=lambda prediction: prediction),
    )
    return stages, fine


def test_changes_are_taken_at_the_answer() -> None:
    found = mesh_change(*staged())
    np.testing.assert_array_equal(found.coarser, [1.0, 0.0])  # a point that is not reached adds nothing
    np.testing.assert_array_equal(found.element, [1.5, 0.0])
    assert found.ratio == pytest.approx(64 / 24)
    assert mesh_change(*staged(lost="fbar")).element is None
    # A mesh that is run 0.2 higher, in step with the data: 0.2 of the slopes (3, 0.5) is taken back.
    np.testing.assert_allclose(mesh_change(*staged(m=0.2)).coarser, [0.4, -0.1], rtol=0, atol=1e-15)
    with pytest.raises(ValueError, match="24 x 32 elements did not complete"):
        mesh_change(*staged(lost="one_point"))
