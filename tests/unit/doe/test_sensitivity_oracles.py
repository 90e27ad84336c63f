"""Sobol' indices beside two other programs: those of SciPy and of SALib, on the same points."""

import numpy as np
import pytest
from scipy import stats

from doe import Box
from doe.sensitivity import SaltelliSample, sobol_indices

BOX = Box(("a", "b", "c"), (-np.pi,) * 3, (np.pi,) * 3)
N, SEED = 256, 7


def ishigami(x: np.ndarray) -> np.ndarray:
    """Ishigami and Homma's function, two outputs: one of them in other units."""
    y = np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    return np.column_stack([y, 1e3 * y + 5.0])


def test_scipys_estimator_on_the_same_points() -> None:
    found = sobol_indices(BOX, ishigami, outputs=("y", "z"), n=N, rng=SEED)
    at_A, at_B, at_AB = SaltelliSample.draw(3, N, SEED).ask(ishigami, BOX)
    oracle = stats.sobol_indices(func={"f_A": at_A.T, "f_B": at_B.T, "f_AB": np.swapaxes(at_AB, 1, 2)}, n=N)
    # The same sums in another order. SciPy has shape [output, parameter].
    np.testing.assert_allclose(found.first, oracle.first_order, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(found.total, oracle.total_order, rtol=0.0, atol=1e-10)


def test_salibs_estimator_on_the_same_points() -> None:
    sobol = pytest.importorskip("SALib.analyze.sobol", reason="needs SALib")
    found = sobol_indices(BOX, ishigami, outputs=("y", "z"), n=N, rng=SEED)
    at_A, at_B, at_AB = SaltelliSample.draw(3, N, SEED).ask(ishigami, BOX)
    # SALib's layout, point by point: A, AB_1 .. AB_d, B.
    Y = np.stack([at_A[:, 0], *at_AB[..., 0], at_B[:, 0]], axis=1).ravel()
    problem = {"num_vars": 3, "names": list("abc"), "bounds": [[-np.pi, np.pi]] * 3}
    oracle = sobol.analyze(problem, Y, calc_second_order=False, num_resamples=10, seed=1)
    # SALib centres by the mean of all evaluations, here by that of A and B: O(1/n) of the first order.
    np.testing.assert_allclose(found.first[0], oracle["S1"], atol=4.0 / N)
    np.testing.assert_allclose(found.total[0], oracle["ST"], atol=4.0 / N)
