"""Bridges compared with sums of resistances by hand, and shunts compared with a shunted bridge."""

from dataclasses import replace

import numpy as np
import pytest

from kolsky.bars.signals.bridge import KINDS, Bridge, Linear, Shunt, check_shunt, with_shunt

NU = 0.29


def bridge(kind="quarter", **changes):
    poisson = NU if "Poisson" in kind else None
    made = Bridge(kind=kind, gauge_factor=2.1, excitation=8.0, gain=200.0, poisson=poisson)
    return replace(made, **changes)


def divider(resistances, excitation):
    """Output of a bridge from the currents in its two branches: an independent way to Eq. (U.1)."""
    R1, R2, R3, R4 = resistances
    left, right = excitation / (R1 + R2), excitation / (R4 + R3)
    return left * R1 - right * R4


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lead", [0.0, 1.7])
def test_volts_are_those_of_the_resistances(kind, lead):
    made = bridge(kind, lead_resistance=lead)
    for strain in (-0.02, -1e-3, 1e-6, 0.03):
        x = 2.1 * np.array(made.arms) * strain
        volts = 200.0 * divider(120.0 * (1.0 + x) + lead, 8.0)
        assert made.volts(strain) == pytest.approx(volts, rel=1e-9)  # 1 + x loses digits at 1e-6
        assert made.strain(volts) == pytest.approx(strain, rel=1e-9)


def test_published_formulas():
    # Vishay Tech Note 507-1 and LANL's reduction: strain from e = V / (gain Vexc).
    V = np.array([-2.0, -0.4, 0.3, 2.0])
    e = V / 1600.0
    np.testing.assert_allclose(bridge("quarter").strain(V), 4 * e / (2.1 * (1 - 2 * e)), rtol=1e-12)
    np.testing.assert_allclose(bridge("half, opposed").strain(V), 2 * e / (2.1 * (1 - e)), rtol=1e-12)
    np.testing.assert_allclose(bridge("half, opposed").linear_strain(V), 2 * V / (2.1 * 200 * 8), rtol=1e-12)
    half = 4 * e / (2.1 * ((1 + NU) - 2 * e * (1 - NU)))
    np.testing.assert_allclose(bridge("half, Poisson").strain(V), half, rtol=1e-12)
    full = 2 * e / (2.1 * ((1 + NU) - e * (1 - NU)))
    np.testing.assert_allclose(bridge("full, Poisson").strain(V), full, rtol=1e-12)


def test_slope_at_zero_is_the_linear_factor():
    for kind in KINDS:
        made = bridge(kind, lead_resistance=3.0)
        # O(GF strain) = 2e-8 off at 1e-8.
        assert made.strain_per_volt == pytest.approx(1e-8 / made.volts(1e-8), rel=1e-7)


def test_leads_desensitise():
    # Vishay Tech Note 514: by R / (R + R_lead).
    assert bridge(lead_resistance=6.0).strain_per_volt == pytest.approx(
        bridge().strain_per_volt * 126 / 120, rel=1e-14
    )


def test_an_impossible_output_is_refused():
    with pytest.raises(ValueError, match=r"no strain gives 900 V with a bridge 'quarter', gain 200"):
        bridge().strain(np.array([1.0, 900.0]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kind": "quart"}, r"kind must be one of 'quarter', .* got 'quart'"),
        ({"gauge_factor": 0.0}, r"gauge_factor must be in \(0, inf\), got 0"),
        ({"gain": np.nan}, r"gain must be in \(0, inf\), got nan"),
        ({"lead_resistance": -1.0}, r"lead_resistance must be in \[0, inf\) ohm, got -1"),
        ({"poisson": 0.3}, r"has no gauge across, so poisson has no effect"),
        ({"kind": "full, Poisson", "poisson": None}, r"needs poisson in \[0, 0.5\), got None"),
    ],
)
def test_impossible_bridges_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        bridge(**changes)


def test_quantities_round_trip():
    made = bridge("full, Poisson")
    listed = made.quantities("incident gauge", {"gauge_factor": 0.01}, bar="incident bar")
    assert [(q.name, q.sigma) for q in listed] == [
        ("incident gauge, gauge factor", 0.01),
        ("incident gauge, excitation", 0.0),
        ("incident gauge, gain", 0.0),
        ("incident bar, Poisson's ratio", 0.0),
    ]
    other = made.with_values("incident gauge", {"incident gauge, gain": 201.0, "x": 1.0}, bar="incident bar")
    assert other == replace(made, gain=201.0)
    nu = made.with_values("incident gauge", {"incident bar, Poisson's ratio": 0.3}, bar="incident bar")
    assert nu.poisson == 0.3
    with pytest.raises(ValueError, match="'lead_resistance' has no effect on a bridge 'full, Poisson'"):
        made.quantities("incident gauge", {"lead_resistance": 0.1})
    with pytest.raises(ValueError, match=r"standard uncertainty of gain must be in \[0, inf\), got -1"):
        made.quantities("incident gauge", {"gain": -1.0})


def test_a_stated_factor():
    made = Linear(5.01e-4)
    np.testing.assert_allclose(made.strain([2.0, -1.0]), [1.002e-3, -5.01e-4])
    (q,) = made.quantities("g", {"factor": 1e-6})
    assert (q.name, q.value, q.sigma, q.unit) == ("g, strain per volt", 5.01e-4, 1e-6, "1/V")
    assert made.with_values("g", {q.name: 5e-4}).factor == 5e-4
    with pytest.raises(ValueError, match=r"calibration factor must be in \(0, inf\), got -0\.0005"):
        Linear(-5e-4)


@pytest.mark.parametrize(("arm", "sign"), [(1, -1), (2, 1), (3, -1), (4, 1)])
@pytest.mark.parametrize("at_gauge", [False, True])
def test_a_shunt_gives_back_the_gain(arm, sign, at_gauge):
    made = bridge("full, Poisson", lead_resistance=2.0)
    arms = np.full(4, 122.0)
    if at_gauge:
        arms[arm - 1] = 2.0 + 120.0 * 60e3 / (120.0 + 60e3)
    else:
        arms[arm - 1] = 122.0 * 60e3 / (122.0 + 60e3)
    step = 197.0 * divider(arms, 8.0)
    assert np.sign(step) == sign  # a resistance parallel to an axial gauge looks like compression
    found = check_shunt(made, Shunt(60e3, step, arm=arm, at_gauge=at_gauge))
    assert found.gain == pytest.approx(197.0, rel=1e-10)
    assert found.ratio == pytest.approx(0.985, rel=1e-10)
    assert found.compression_sign == -1  # as in `Bridge.volts`, tension is positive
    reversed_ = check_shunt(made, Shunt(60e3, -step, arm=arm, at_gauge=at_gauge))
    assert reversed_.compression_sign == 1
    assert reversed_.gain == found.gain


def test_a_shunt_stands_for_a_known_strain():
    # Vishay Tech Note 514, Eq. 3: 120 ohm, GF 2, 59 880 ohm shunts stand for 1000 microstrain of compression.
    made = bridge(gauge_factor=2.0)
    step = made.volts(-1e-3)
    found = check_shunt(made, Shunt(59880.0, float(step)))
    assert found.compression_sign == -1
    assert found.gain == pytest.approx(200.0, rel=1e-9)


def test_uncertainty_of_the_gain():
    made = bridge(gauge_factor=2.0)
    step = float(made.volts(-1e-3))
    both = Shunt(59880.0, step, resistance_sigma=59.88, step_sigma=2e-3 * abs(step))
    # The output goes as R / (R + Rs), so its relative sensitivity to Rs is nearly 1: 0.1 % and 0.2 % add.
    assert check_shunt(made, both).gain_sigma == pytest.approx(np.hypot(0.1, 0.2) * 2.0, rel=4e-3)


def test_a_shunt_that_contradicts_is_refused():
    made = bridge()
    calibrated, found = with_shunt(made, Shunt(59880.0, -0.81))
    assert calibrated.gain == found.gain != made.gain
    with pytest.raises(ValueError, match=r"a ratio of 0\.4\d+, allowed is 1 within 0.02"):
        with_shunt(made, Shunt(59880.0, -0.4))
    with pytest.raises(ValueError, match="arm 2 of a bridge 'quarter' holds no gauge"):
        check_shunt(made, Shunt(59880.0, -0.8, arm=2, at_gauge=True))
    for bad in ({"resistance": 0.0}, {"step": 0.0}, {"arm": 5}, {"step_sigma": -1.0}):
        with pytest.raises(ValueError, match="shunt"):
            replace(Shunt(59880.0, -0.8), **bad)
