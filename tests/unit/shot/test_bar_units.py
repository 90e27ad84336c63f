"""Units and clocks of bar recordings as in public files: accepted, contradicted with a message, or
rejected."""

from dataclasses import replace

import numpy as np
import pytest
from barshots import INTERVAL, ONE, bar_shot, gauge, strains, write_toml

from kolsky.bars.reduction.varied_test import station_of
from kolsky.bars.signals.stations import LARGEST_STRAIN, check_elastic
from kolsky.base.apparatus import Bar
from kolsky.base.errors import InputError
from kolsky.shot.bars import load_waves

STRAIN = 'recorder = "scope"\nchannels = ["{name}"]\ncompression = "positive"\nstrain = true'


def folder_of(path, names, factor, *, gauges=gauge, recorder=ONE, time=None, strain=None):
    """A shot of a CSV whose two columns are the strains times a factor."""
    path.mkdir()
    t, first, second = strains() if strain is None else strain
    np.savetxt(
        path / "scope.csv",
        np.column_stack([t if time is None else time, factor * first, factor * second]),
        delimiter=",",
        header=",".join(["t (s)", *names]),
        comments="",
        fmt="%.9e",
        encoding="utf-8",
    )
    incident, transmission = map(gauges, names)
    write_toml(
        path, recorders=recorder, incident=incident, transmission=transmission, corrections="punching = false"
    )
    return path


def largest(given):
    """Largest strain of the incident bar, and the notes."""
    return float(station_of(given, "incident").signal.strain.value.max()), given.notes


def as_strain(name):
    return STRAIN.format(name=name)


@pytest.mark.parametrize(
    ("unit", "factor"), [("V", 1e3), ("mV", 1e6), ("Volts", 1e3), ("millivolts", 1e6), ("uV", 1e9)]
)
def test_volts_of_a_file_are_what_its_heading_says(tmp_path, unit, factor):
    """1.5e-3 of strain at 1e-3 a volt are 1.5 V; CH1 (mV) was read as volts, a thousand times too much."""
    given = load_waves(folder_of(tmp_path / "a", [f"inc ({unit})", f"tra ({unit})"], factor))
    assert largest(given) == (pytest.approx(1.5e-3, rel=0.005), ())


@pytest.mark.parametrize("unit", ["microstrain", "µε", "με", "ue", "µm/m", "ustrain", "uStrain"])
def test_microstrain_of_a_file_is_microstrain(tmp_path, unit):
    given = load_waves(folder_of(tmp_path / "a", [f"inc ({unit})", f"tra ({unit})"], 1e6, gauges=as_strain))
    assert largest(given) == (pytest.approx(1.5e-3, rel=0.005), ())


def test_a_file_without_units_is_refused_until_one_is_declared(tmp_path):
    folder = folder_of(tmp_path / "a", ["inc", "tra"], 1e6)
    with pytest.raises(InputError, match=r"does not state the unit of channel 'inc'") as error:
        load_waves(folder)
    assert 'unit = "V"' in error.value.cure
    folder = folder_of(tmp_path / "b", ["inc", "tra"], 1e6, recorder=ONE + 'unit = "mV"\n')
    assert largest(load_waves(folder)) == (pytest.approx(1.5e-3, rel=0.005), ())


def test_a_declared_unit_that_contradicts_the_file_is_said(tmp_path):
    folder = folder_of(tmp_path / "a", ["inc (mV)", "tra (mV)"], 1e3, recorder=ONE + 'unit = "V"\n')
    strain, notes = largest(load_waves(folder))
    assert strain == pytest.approx(1.5e-3, rel=0.005)
    assert len(notes) == 2
    assert "'inc (mV)' of scope.csv is in 'mV' by the file and in 'V' by recorders.scope.unit" in notes[0]
    agrees = folder_of(tmp_path / "b", ["inc (mV)", "tra (mV)"], 1e6, recorder=ONE + 'unit = "millivolts"\n')
    assert load_waves(agrees).notes == ()


def test_strain_where_volts_are_needed_is_refused(tmp_path):
    folder = folder_of(tmp_path / "a", ["inc (µε)", "tra (µε)"], 1e6)
    with pytest.raises(InputError, match=r"needs a signal in 'V', channel 'inc .*' is in '1'"):
        load_waves(folder)


def test_a_thousandfold_strain_is_refused_with_its_stress(tmp_path):
    """What a wrong unit makes of 1.5 V: 1500 V, a strain of 1.5."""
    folder = folder_of(tmp_path / "a", ["inc", "tra"], 1e6, recorder=ONE + 'unit = "V"\n')
    with pytest.raises(ValueError, match=r"the largest strain of the bar is 1\.5.*2 %.*Cure: check the unit"):
        station_of(load_waves(folder), "incident")


METAL = Bar(diameter=20e-3, length=2.0, youngs_modulus=200e9, density=8000.0)
POLYMER = replace(METAL, youngs_modulus=19e9)


@pytest.mark.parametrize(
    ("bar", "limit"),
    [
        (METAL, 0.02),
        (replace(METAL, youngs_modulus=20e9), 0.02),
        (POLYMER, 0.1),
        (replace(METAL, yield_strength=900e6), 0.0045),
        (replace(POLYMER, yield_strength=76e6), 0.004),
    ],
)
def test_a_bar_bears_its_elastic_limit_and_no_more(bar, limit):
    assert LARGEST_STRAIN == {"metal": 0.02, "polymer": 0.1}
    ones = np.ones(100)
    for sign in (1.0, -1.0):
        check_elastic(0.999 * sign * limit * ones, bar, 1e-6, "gauge")
        with pytest.raises(ValueError, match="it must be below"):
            check_elastic(1.001 * sign * limit * ones, bar, 1e-6, "gauge")
    spike = np.zeros(100)
    spike[50] = 3.9 * limit  # a wave crosses the bar in four samples
    check_elastic(spike, replace(bar, density=bar.youngs_modulus / 5000.0**2), 1e-6, "gauge")


def test_a_yield_strength_is_declared_in_the_shot(tmp_path):
    folder = bar_shot(tmp_path / "a")
    path = folder / "shot.toml"
    text = path.read_text().replace(
        'wave_speed = "5000 m/s"', 'wave_speed = "5000 m/s"\nyield_strength = "290 MPa"'
    )
    path.write_text(text)
    with pytest.raises(ValueError, match=r"of its yield strength of 290 MPa"):  # 1.5e-3 of 200 GPa are 300
        station_of(load_waves(folder), "incident")
    path.write_text(text.replace("290 MPa", "310 MPa"))
    station_of(load_waves(folder), "incident")


def jittered(share, seed=1):
    """Times whose steps vary evenly within a share, and the strains at those times."""
    t, *_ = strains()
    steps = INTERVAL * (1.0 + share * np.random.default_rng(seed).uniform(-1.0, 1.0, t.size - 1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def test_steps_that_vary_by_two_per_cent_are_interpolated_with_a_note(tmp_path):
    time = jittered(0.02)
    t, first, second = strains(noise=0.0)
    rng = np.random.default_rng(3)
    columns = (t, *(np.interp(time, t, s) + 1e-6 * rng.standard_normal(t.size) for s in (first, second)))
    folder = folder_of(tmp_path / "a", ["inc (V)", "tra (V)"], 1e3, time=time, strain=columns)
    given = load_waves(folder)
    assert len(given.notes) == 2
    assert "sampling steps of channel 'inc (V)' vary by up to 2 %" in given.notes[0]
    signal = station_of(given, "incident").signal.strain
    # Interpolated, not shifted: noise of 1e-6, its zero, and a corner of the ramp, 0.02 of a step of 7.5e-6.
    inside = signal.time < time[-1] - 1e-6
    np.testing.assert_allclose(signal.value[inside], np.interp(signal.time[inside], t, first), atol=7e-6)
    assert signal.interval == pytest.approx(time[-1] / (t.size - 1), rel=1e-9)


def test_larger_steps_are_gaps(tmp_path):
    with pytest.raises(InputError, match="where the others are"):
        load_waves(folder_of(tmp_path / "a", ["inc (V)", "tra (V)"], 1e3, time=jittered(0.08)))
