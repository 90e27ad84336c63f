"""Transmission bar by its characteristics; figures and tolerances as on the page (`bar.py`)."""

import bar
import pytest
from order import assert_order

from explicit import CharacteristicBar


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
