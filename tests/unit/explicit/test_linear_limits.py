"""The linear limit: its identities, Schumacher's Table I, and figures that were published."""

import pytest

from explicit.materials import LAWS
from explicit.materials.volumetric import LinearLimit, VolumetricLaw

EXACT = 1e-14
"""Round-off of a few operations."""


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49, 0.4999])
def test_every_way_in_is_the_way_out(poisson: float) -> None:
    limit = LinearLimit.from_poisson(25e3, poisson)
    # 1 - 2 nu, of which K is made, loses the digits that nu has near a half
    assert limit.poisson == pytest.approx(poisson, rel=1e-12, abs=1e-15)
    again = (
        LinearLimit.from_youngs_modulus(limit.youngs_modulus, limit.poisson),
        LinearLimit.from_factor_d1(25e3, limit.factor_d1),
        LinearLimit.from_divisor_d1(25e3, limit.divisor_d1),
    )
    for other in again:
        assert other.bulk == pytest.approx(limit.bulk, rel=1e-10)
        assert other.shear_modulus == pytest.approx(25e3, rel=1e-12)
    # the textbook's other identities
    E, K, mu = limit.youngs_modulus, limit.bulk, limit.shear_modulus
    assert pytest.approx(9.0 * K * mu / (3.0 * K + mu), rel=1e-12) == E
    assert limit.lame == pytest.approx(E * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), rel=1e-10)
    # the second derivative of D1 (J - 1)^2 at rest is K
    assert VolumetricLaw(K).energy(1.001) == pytest.approx(limit.factor_d1 * 1e-6, rel=1e-9)


def test_schumachers_table_of_parameters() -> None:
    # Table I: D1 of D1 (J - 1)^2 for given nu, and (mu, lambda) of the neo-Hookean law for given E and nu.
    nu, C10, C01 = 0.45, 12e3, 3e3
    mooney = LAWS["mooney_rivlin"].of([C10, C01, 500.0])
    limit = LinearLimit.from_poisson(mooney.shear_modulus, nu)
    assert limit.factor_d1 == pytest.approx(2 * (C01 + C10) * (1 + nu) / (3 * (1 - 2 * nu)), rel=EXACT)
    yeoh = LAWS["yeoh"].of([C10, 100.0, 5.0])
    limit = LinearLimit.from_poisson(yeoh.shear_modulus, nu)
    assert limit.factor_d1 == pytest.approx(2 * C10 * (1 + nu) / (3 * (1 - 2 * nu)), rel=EXACT)
    limit = LinearLimit.from_youngs_modulus(60e3, nu)
    assert limit.shear_modulus == pytest.approx(60e3 / (2 * (1 + nu)), rel=EXACT)
    assert limit.lame == pytest.approx(60e3 * nu / ((1 + nu) * (1 - 2 * nu)), rel=1e-13)


def test_an_incompressible_solid_has_three_shear_moduli() -> None:
    limit = LinearLimit.from_divisor_d1(25e3, 0.0)
    assert (limit.poisson, limit.youngs_modulus, limit.divisor_d1) == (0.5, 75e3, 0.0)


def test_an_impossible_limit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"poisson must be in \[0, 0.49999\], got 0.5"):
        LinearLimit.from_poisson(25e3, 0.5)
    with pytest.raises(ValueError, match="shear_modulus must be > 0 Pa and finite, got -1"):
        LinearLimit(-1.0, 1e6)
    with pytest.raises(ValueError, match="bulk must be > 0 Pa, got 0"):
        LinearLimit(1.0, 0.0)
    with pytest.raises(ValueError, match=r"D1 must be >= 0 1/Pa, got -0\.1"):
        LinearLimit.from_divisor_d1(25e3, -0.1)
