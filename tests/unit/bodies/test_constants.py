"""Constants of compressible laws against Table I of Schumacher and others (2020), by hand."""

import numpy as np
import pytest

from kolsky.bodies.specimen_constants import Constants, constants_of, solid_of


def test_bulk_modulus_is_that_of_table_one() -> None:
    # D1 = 2 (C01 + C10)(1 + nu) / (3 (1 - 2 nu)), and K = 2 D1.
    values = {"C10": 3000.0, "C01": 1000.0, "C11": 200.0, "poisson": 0.4}
    d1 = 2.0 * 4000.0 * 1.4 / (3.0 * 0.2)
    solid = solid_of("mooney_rivlin", values)
    assert solid.parameters() == pytest.approx([3000.0, 1000.0, 200.0, 2.0 * d1])
    yeoh = solid_of("yeoh_d", {"C10": 4000.0, "C20": 5.0, "C30": 6.0, "D2": 7.0, "D3": 8.0, "poisson": 0.4})
    assert yeoh.parameters() == pytest.approx([4000.0, 5.0, 6.0, d1, 7.0, 8.0])
    coupled = solid_of("neo_hookean_coupled", {"E": 2.8e4, "poisson": 0.4})
    assert coupled.parameters() == pytest.approx([1e4, 2.8e4 * 0.4 / (1.4 * 0.2)])


def test_chain_carries_slopes_to_what_is_fitted() -> None:
    constants = Constants(
        "mooney_rivlin",
        {"C10": 3000.0, "C01": 1000.0, "C11": 200.0, "poisson": 0.4},
        ("C01", "C11", "poisson"),
    )
    # K = 4 (C10 + C01)(1 + nu) / (3 (1 - 2 nu)): 28/3 a unit of C01; by nu 4 (C10 + C01) / (1 - 2 nu)^2.
    expected = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [28.0 / 3.0, 0.0, 4e5]]
    assert constants.chain(constants.start) == pytest.approx(np.array(expected), rel=1e-7, abs=1e-5)


def test_chain_on_the_bound_of_a_constant() -> None:
    values = {"C10": 3000.0, "C01": 0.0, "C11": 0.0, "poisson": 0.0}
    constants = Constants("mooney_rivlin", values, ("C01", "C11", "poisson"))
    assert constants.chain(constants.start)[-1] == pytest.approx([4.0 / 3.0, 0.0, 1.2e4], rel=1e-4)


def test_bounds_keep_energies_positive() -> None:
    low, high = Constants(
        "mooney_rivlin", {"C10": 1.0, "C01": 1.0, "C11": 0.0, "poisson": 0.45}, ("C10", "C11", "poisson")
    ).bounds
    assert low.tolist() == [0.0, 0.0, 0.0]
    assert high.tolist() == [np.inf, np.inf, 0.4999]


def test_refusals_name_the_constant() -> None:
    with pytest.raises(ValueError, match="needs C01"):
        Constants("mooney_rivlin", {"C10": 1.0, "C11": 0.0, "poisson": 0.4}, ())
    with pytest.raises(ValueError, match="has no constant D2"):
        Constants("neo_hookean", {"mu": 1.0, "D2": 1.0, "poisson": 0.4}, ())
    with pytest.raises(ValueError, match="law must be one of"):
        constants_of("ogden")


def test_changes_of_the_map_to_the_energy() -> None:
    # mu = E / (2 (1 + nu)), lambda = E nu / ((1 + nu) (1 - 2 nu)), differentiated twice by hand
    E, nu = 3e4, 0.3
    found = Constants("neo_hookean_coupled", {"E": E, "poisson": nu}, ("E", "poisson")).chain_changes([E, nu])
    a, b = 1.0 + nu, 1.0 - 2.0 * nu
    mu = [[0.0, -0.5 / a**2], [-0.5 / a**2, E / a**3]]
    by_nu = (1.0 + 2.0 * nu**2) / (a * b) ** 2
    twice = E * (4.0 * nu / (a * b) ** 2 + 2.0 * (1.0 + 2.0 * nu**2) * (1.0 + 4.0 * nu) / (a * b) ** 3)
    lam = [[0.0, by_nu], [by_nu, twice]]
    np.testing.assert_allclose(found, [mu, lam], rtol=1e-4, atol=1e-9)
