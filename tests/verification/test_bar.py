"""Transmission bar by its characteristics; figures and tolerances as on the page (`bar.py`)."""

import bar
import numpy as np
import pytest
from order import assert_order
from scene import DENSITY, LENGTH, RADIUS, shear_modulus, speed_after_rise

from explicit import CharacteristicBar, Model, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import neo_hookean


@pytest.mark.parametrize("name", list(bar.BARS))
def test_force_on_the_bar_is_the_closed_form(name: str) -> None:
    result = bar.case()
    assert result.force[name][-1] < bar.FORCE_TOLERANCE
    assert result.rigid[name] > 10.0 * bar.FORCE_TOLERANCE  # a rigid support would not pass


@pytest.mark.parametrize("name", list(bar.BARS))
def test_platen_moves_as_the_impulse_and_its_echoes_say(name: str) -> None:
    error = bar.case().platen[name]
    assert error[-1] < bar.PLATEN_TOLERANCE
    # It answers the step before: first order. 0.3: with an echo the error of the interpolation scatters.
    assert_order([1.0 / n for n in bar.MESHES], error, 1.0, 0.3, at_least=True)


@pytest.mark.parametrize("name", list(bar.BARS))
def test_energy_into_the_bar_is_force_times_velocity(name: str) -> None:
    assert bar.case().work[name] < bar.WORK_TOLERANCE


def test_steel_bar_in_an_impact() -> None:
    result = bar.case()
    assert result.steel < bar.PLATEN_TOLERANCE
    assert 0.5e-6 < result.steel_travel < 5e-6  # I / Z of some 10 N for 1 ms on 6910 N s/m, with one echo


@pytest.mark.parametrize(
    ("impedance", "round_trip"), [(0.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (float("nan"), 1.0)]
)
def test_impossible_bars_are_refused(impedance: float, round_trip: float) -> None:
    with pytest.raises(ValueError, match="must be > 0"):
        CharacteristicBar(impedance=impedance, round_trip=round_trip)


@pytest.mark.parametrize("faces", ["bonded", "coulomb"])
def test_a_light_bar_does_not_overshoot(faces: str) -> None:
    """Impedance times step far below the mass on the platen: only a joint solution is stable there."""
    model = Model(
        mesh=cylinder(RADIUS, LENGTH, n_radial=8, n_axial=11),
        density=DENSITY,
        materials=(neo_hookean(shear_modulus(0.495)),),
        motions=(speed_after_rise(2.6, 50e-6, end=1.0e-3),),
        faces=faces,
        side=faces,
        support=CharacteristicBar(impedance=100.0, round_trip=617e-6),
    )
    times = np.linspace(1e-6, 0.9e-3, 50)

    def travel(step: float) -> float:
        stepping = Stepping(largest_step=step)
        response = run(
            model, Samples.of(poisson=0.495, friction=0.5), Sampling(times, times), stepping=stepping
        )
        assert response.completed.all()
        # 0.3 %: a face that chatters gets impulses, and the ledger books one half before and half after
        # its step; that does not accumulate. Bonded it is 0.002 %.
        assert response.energy.imbalance()[0] < 3e-3
        return float(response.surface_y[0, -1, 0])

    # The platen answers one step late, so its path is first order in the step: 4 % between the two steps.
    assert travel(2.5e-7) == pytest.approx(travel(1e-6), rel=0.04)
