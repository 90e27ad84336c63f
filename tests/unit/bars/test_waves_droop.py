"""Droop: against the closed form of a first-order high-pass filter, and as part of a force."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kolsky.bars.audit import Switches
from kolsky.bars.budget import budget_table, propagate
from kolsky.bars.signals.transducers import compensate_droop, droop_sigma, force_history, force_signal
from kolsky.base.apparatus import Transducer
from kolsky.base.records import Recording

TAU = 2e-3
TIME = 1e-6 * np.arange(5000)
STEP = 500e-6
PIEZO = Transducer(sensitivity=0.01, compression_sign=-1, full_scale=5.0, time_constant=TAU)
BASELINE = (0.0, 400e-6)


def seen(force):
    """What a transducer shows of a force: exact for pieces of straight lines between the samples."""
    h, decay = TIME[1] - TIME[0], np.exp(-(TIME[1] - TIME[0]) / TAU)
    v = np.zeros(force.size)
    for k in range(1, force.size):  # v' = F' - v / tau with F' constant over the interval
        v[k] = decay * v[k - 1] + (force[k] - force[k - 1]) * TAU / h * (1.0 - decay)
    return v


def trapezoid(height=40.0):
    return height * np.interp(TIME, [STEP, STEP + 50e-6, 1.9e-3, 2.0e-3], [0.0, 1.0, 1.0, 0.0])


def test_a_constant_force_comes_back():
    decaying = np.where(TIME >= STEP, 40.0 * np.exp(-(TIME - STEP) / TAU), 0.0)
    found = compensate_droop(TIME, decaying, TAU, start=STEP)
    # Trapezoid rule on exp: (h / tau)^2 / 12 relative.
    np.testing.assert_allclose(found[TIME >= STEP], 40.0, rtol=3e-8)


def test_a_trapezoid_comes_back():
    force = trapezoid()
    assert np.abs(seen(force) - force).max() > 0.4 * force.max()  # droop is no detail here
    found = compensate_droop(TIME, seen(force), TAU, start=400e-6)
    np.testing.assert_allclose(found, force, atol=1e-6 * force.max())


def test_sigma_of_compensated_noise():
    rng = np.random.default_rng(1)
    draws = np.array(
        [compensate_droop(TIME, rng.standard_normal(TIME.size), 1e-4, start=400e-6) for _ in range(400)]
    )
    expected = droop_sigma(TIME, 1.0, 1e-4, start=400e-6)
    assert expected[-1] > 1.2  # the random walk shows
    assert (expected[TIME < 400e-6] == 1.0).all()
    picked = slice(300, None, 470)
    np.testing.assert_allclose(draws.std(axis=0)[picked], expected[picked], rtol=0.16)  # 3.5 %, four of them


def noisy(force, sigma=0.002, seed=2):
    volts = 0.02 - 0.01 * seen(force) + sigma * np.random.default_rng(seed).standard_normal(force.size)
    return Recording(
        time=TIME - 1e-3, value=volts, channel="CH3", unit="V", path=Path("s.csv"), sha256="0" * 64
    )


def force(**changes):
    options = {"name": "transmission force", "baseline": BASELINE, "clock_offset": 1e-3} | changes
    return force_signal(
        options.pop("recording", noisy(trapezoid())), options.pop("transducer", PIEZO), **options
    )


def test_force_with_audit_and_quantities():
    signal, corrections, quantities = force(uncertainty={"sensitivity": 1e-4, "time_constant": 1e-4})
    assert (signal.start, signal.unit) == (pytest.approx(0.0, abs=1e-15), "N")
    assert signal.sigma == pytest.approx(0.2, rel=0.15)  # 401 samples: 3.5 %, four of them
    # The zero, 0.2 / 20 N, is integrated over 4.6 ms / tau as well.
    assert np.abs(signal.value - trapezoid()).max() < 5.0 * 0.2 + 4.0 * 0.01 * 3.3
    (entry,) = corrections
    assert (entry.key, entry.applied, entry.unit) == ("droop", True, "N")
    assert entry.size == pytest.approx(np.abs(seen(trapezoid()) - trapezoid()).max(), rel=0.03)
    assert [(q.name, q.sigma) for q in quantities[:2]] == [
        ("transmission force, sensitivity", 1e-4),
        ("transmission force, time constant", 1e-4),
    ]
    off = force(switches=Switches({"droop": False}))
    assert not off.corrections[0].applied
    assert off.corrections[0].size == pytest.approx(entry.size)
    np.testing.assert_allclose(off.signal.value, seen(trapezoid()), atol=5.5 * 0.2)


def test_force_history_compensates_too():
    history = force_history(noisy(trapezoid()), PIEZO, baseline=BASELINE, clock_offset=1e-3)
    np.testing.assert_array_equal(history.force, force().signal.value)
    sigma = droop_sigma(TIME, history.sigma[0], TAU, start=BASELINE[1])
    np.testing.assert_allclose(history.sigma, sigma)
    with pytest.raises(ValueError, match=r"time_constant must be in \(0, inf\) s, got -1"):
        droop_sigma(TIME, 1.0, -1.0, start=0.0)


def test_budget_of_a_force():
    uncertainty = {"sensitivity": 1e-4, "time_constant": 1e-4}
    made = force(uncertainty=uncertainty)

    def model(values):
        return {"force": force(uncertainty=uncertainty, values=values).signal.value}

    budget = propagate(model, made.quantities, noise={"force": made.signal.sigma})
    droop = made.corrections[0]
    table = budget_table(budget, {"force": ("force", 1900, "N")})
    slope = {row.quantity.name: row.sensitivity.get("force") for row in table.contributions}
    # d(V + I / tau) / d tau = -I / tau^2: the correction over tau.
    expected = (force().signal.value - force(switches=Switches({"droop": False})).signal.value)[1900]
    assert expected == pytest.approx(droop.size, rel=0.2)
    assert slope["transmission force, time constant"] == pytest.approx(-expected / TAU, rel=4e-3)
    sensitivity = -made.signal.value[1900] / 0.01
    assert slope["transmission force, sensitivity"] == pytest.approx(sensitivity, rel=2e-4)


def test_uncertainties_without_effect_are_refused():
    still = replace(PIEZO, time_constant=np.inf)
    assert force(transducer=still).corrections == []
    with pytest.raises(
        ValueError, match="'time_constant' has no effect on the force; allowed: 'sensitivity'"
    ):
        force(transducer=still, uncertainty={"time_constant": 1e-4})
