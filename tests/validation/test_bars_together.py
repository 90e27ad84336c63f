"""Bars in contact, from another laboratory: the transmitted pulse is the incident one, propagated along the
bars.

Data: github snkhaderi/IITH_split_hopkinson_bar_data_processing, a steel bar of 20 mm, gauges 0.589 m either
side of the interface.
"""

import numpy as np
import pytest

from kolsky.bars.guides.propagation import wave_speed
from kolsky.bars.records import BarSignal, Signal
from kolsky.bars.signals.baseline import measure_signal_zero
from kolsky.bars.signals.bridge import Bridge, Linear
from kolsky.bars.signals.stations import bar_signal
from kolsky.base.apparatus import Bar
from kolsky.readers.layout import Layout
from kolsky.readers.recordings import read_recordings

BAR = Bar(diameter=0.02, length=2.0, youngs_modulus=200e9, density=7850.0, poisson=0.29)
DISTANCE = 0.589
INTERVAL = 3.3e-7  # Delta_X of the header: the time column is rounded
QUIET = 150  # samples before the pulse
UNTIL_ECHO = (250e-6, 500e-6)  # from before the pulse to before its echo, at the transmission gauge [s]


@pytest.fixture(scope="module")
def stations(shared):
    volts = np.loadtxt(shared / "data" / "bars" / "iith" / "disp_check.dat", delimiter=",", skiprows=23)
    assert volts.shape == (2000, 3)
    found = []
    for column, side in ((1, "incident"), (2, "transmission")):
        quiet = volts[:QUIET, column]
        signal = Signal(0.0, INTERVAL, volts[:, column] - quiet.mean(), float(quiet.std()), "1", side)
        found.append(BarSignal(signal, BAR, DISTANCE, side))
    return found


@pytest.fixture(scope="module")
def together(stations):
    incident = stations[0].strain
    return wave_speed(
        *stations, incident_window=(incident.start, incident.end), transmitted_window=UNTIL_ECHO
    )


def test_dispersion_explains_what_a_shift_does_not(together):
    assert together.rms <= 0.015  # the target, with c0 and gain fitted and nothing else
    # As another program's first mode and shift find on this record: 1.42 %, 2.39 %; largest 5.9 %.
    assert together.rms == pytest.approx(0.0142, abs=5e-4)
    assert together.plain_rms == pytest.approx(0.0239, abs=5e-4)
    assert together.largest == pytest.approx(0.059, abs=1e-3)


def test_speed_and_gain_are_reported(together):
    assert together.wave_speed == pytest.approx(5340.2, abs=0.2)  # docs/theory/bars.md quotes it
    assert 1.0 < together.wave_speed_sigma < 4.0
    assert together.gain == pytest.approx(0.990, abs=1e-3)
    assert 0.002 < together.gain_sigma < 0.006
    # Poisson's ratio of steel: 0.01 of it are 1.2 m/s, and the residual is lowest next to 0.29.
    assert together.by_poisson == pytest.approx(125.0, abs=10.0)
    assert together.rms < min(together.rms_by_poisson)


def test_windows_hardly_move_the_speed(stations, together):
    other = wave_speed(*stations, incident_window=(20e-6, 250e-6), transmitted_window=(270e-6, 400e-6))
    assert abs(other.wave_speed - together.wave_speed) < other.wave_speed_sigma
    assert abs(other.gain - together.gain) < other.gain_sigma
    assert other.rms < 0.6 * other.plain_rms


STEEL = Bar(diameter=20e-3, length=2.1, youngs_modulus=210e9, density=7800.0)
TITANIUM = Bar(diameter=9.47e-3, length=1.5, youngs_modulus=109.297e9, density=4416.0, poisson=0.33)


def test_lanl_copper_by_its_own_formula(shared):
    path = shared / "data" / "bars" / "lanl_cu" / "20061201_1148HE_CuOFE_273K.raw"
    name = "Incident/Reflected Waveform"
    recording = read_recordings(path, [name])[name]
    bridge = Bridge("half, opposed", gauge_factor=2.061, excitation=8.0, gain=200.0)
    options = {"baseline": (-50e-6, -10e-6), "clock_offset": 0.0}
    sign = 1 if recording.value[np.abs(recording.value).argmax()] > 0.0 else -1
    found = bar_signal([recording], bridge, TITANIUM, 0.381, "incident", compression=[sign], **options)
    rest = recording.value[(recording.time >= -50e-6) & (recording.time <= -10e-6)].mean()
    # HopPyBar: strain = 2 V / (GF gain Vexc); ours divides by 1 - e, e = -V / (gain Vexc) in compression.
    V = sign * (recording.value - rest)
    theirs = 2.0 * V / (2.061 * 200.0 * 8.0)
    np.testing.assert_allclose(found.signal.strain.value, theirs / (1.0 + V / 1600.0), rtol=1e-9, atol=1e-15)
    (bent,) = [c for c in found.corrections if c.key == "bridge nonlinearity"]
    assert bent.size == pytest.approx(np.abs(theirs - theirs / (1.0 + V / 1600.0)).max(), rel=1e-6)
    assert 1e-6 < bent.size < 1e-5  # 5 microstrain of 2200: worth its line in the log
    # Scatter of the baseline as NumPy has it, two degrees of freedom for the line instead of one.
    quiet = theirs[(recording.time >= -50e-6) & (recording.time <= -10e-6)]
    assert found.signal.strain.sigma == pytest.approx(quiet.std(ddof=1), rel=5e-3)


# Steps of the recorder in microstrain, by the smallest differences of the volts in the files.
@pytest.mark.parametrize(
    ("file", "interval", "steps"),
    [
        ("sample_01_raw_voltage.csv", 80.006e-9, (16.78, 7.52)),
        ("sample_02_raw_voltage.xlsx", 80e-9, (12.53, 12.53)),
    ],
)
def test_epoxy_of_yao_steps_and_noise(shared, file, interval, steps):
    path = shared / "data" / "bars" / "yao_epoxy" / file
    channels = read_recordings(path, ["2", "3"], layout=Layout(interval=interval, unit="V"))
    for (side, position), recording, step in zip(
        (("incident", 1.018), ("transmission", 0.741)), channels.values(), steps, strict=True
    ):
        made = bar_signal(
            [recording], Linear(0.000501), STEEL, position, side, baseline=(-1.9e-4, -2e-5), clock_offset=0.0,
            compression=[-1],
        ).signal.strain  # fmt: skip
        rest = measure_signal_zero(made.time, made.value, (-1.9e-4, -2e-5), name=side)
        assert rest.step == pytest.approx(1e-6 * step, rel=2e-3)  # printed with three digits
        # An 8-bit recorder whose noise is below its step; the rounding alone is step / sqrt(12).
        assert rest.step / np.sqrt(12.0) < made.sigma < rest.step
