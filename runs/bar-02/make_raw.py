"""Write pulses.csv: a foam between polymer bars with a known answer, in separate pulses.

Bars of a polymer with a complex modulus of one Maxwell element carry the first mode. The foam is always in
equilibrium. It crushes at a plateau of 2 MPa; its stress is 2 MPa (1 - exp(-strain / 0.01)). Each column
contains one pulse: the incident, the reflected or the transmitted one. Each gauge has noise of 2 um/m.
`python runs/bar-02/make_raw.py` writes an identical file.
"""

from pathlib import Path

import numpy as np

from kolsky.bars.guides.propagation import propagation
from kolsky.bars.guides.waveguide import PronyModulus, ViscoelasticWaveguide
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar, Specimen

MODULUS = PronyModulus(5.0e9, (0.5e9,), (12e-6,))
BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=MODULUS.instantaneous, density=1190.0, poisson=0.35)
GUIDE = ViscoelasticWaveguide(BAR, MODULUS)
SPECIMEN = Specimen(diameter=15e-3, length=8e-3, density=200.0)
INTERVAL, SAMPLES, FLOW, GROWTH = 5e-7, 1400, 2e6, 0.01
WAVE, PADDED, UNLOADED = 900, 7200, 280e-6
"""Number of samples of a wave and of its padding, and time at which the foam separates from the bars [s]."""
BEFORE = 200e-6
"""Time in each column before its pulse arrives [s]."""
DISTANCE = {"incident": 1.0, "transmission": 0.5}
SEED = 19


def in_bar(values: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """A history times a complex factor of the angular frequency, shape [n]."""
    return np.fft.irfft(np.fft.rfft(values, PADDED) * factor, PADDED)[: values.size]


def carried(wave: np.ndarray, distance: float, begin: float, samples: int) -> np.ndarray:
    """A wave at a section farther along the bar, from the time `begin` on, shape [samples]. It starts at time
    0."""
    quiet = np.zeros(500)
    signal = Signal(-500 * INTERVAL, INTERVAL, np.concatenate([quiet, wave, quiet]), 0.0, "1")
    return propagation(signal, GUIDE, distance, band=60e3, start=begin, samples=samples).signal.value


def waves() -> tuple[np.ndarray, ...]:
    """Incident strain at its gauge and at the face, the other two strains at the face, shape [WAVE] each."""
    t = INTERVAL * np.arange(WAVE)
    omega = 2.0 * np.pi * np.fft.rfftfreq(PADDED, INTERVAL)
    rise, fall = np.clip(t / 60e-6, 0.0, 1.0), np.clip((300e-6 - t) / 60e-6, 0.0, 1.0)
    at_gauge = 1.2e-3 * np.sin(0.5 * np.pi * rise) ** 2 * np.sin(0.5 * np.pi * fall) ** 2
    near = DISTANCE["incident"]
    incident = carried(at_gauge, near, near / GUIDE.wave_speed, WAVE)
    stiffness, impedance = GUIDE.stiffness(omega), GUIDE.impedance(omega)
    force = in_bar(incident, stiffness)
    # velocity of approach: 2 (incident - transmitted force) / impedance; the bar depends on its past forces
    memory = in_bar(np.eye(1, WAVE)[0], 1.0 / impedance)
    transmitted, strain = np.zeros(WAVE), 0.0
    for k in range(1, WAVE):
        transmitted[k] = FLOW * (1.0 - np.exp(-strain / GROWTH)) * SPECIMEN.area
        apart = 2.0 * (force[k::-1] - transmitted[k::-1]) @ memory[: k + 1]
        strain += INTERVAL * max(apart, 0.0) / SPECIMEN.length if t[k] < UNLOADED else 0.0
        if t[k] >= UNLOADED:  # the foam separates at the end of the pulse
            transmitted[k] = min(transmitted[k], max(force[k], 0.0))
    back = [in_bar(one, 1.0 / stiffness) for one in (transmitted - force, transmitted)]
    return at_gauge, incident, *back


FILE = Path(__file__).with_name("pulses.csv")


def main(path: Path = FILE) -> None:
    """Write the file; by default next to this script."""
    at_gauge, _, reflected, transmitted = waves()
    near, far = DISTANCE["incident"], DISTANCE["transmission"]
    c = GUIDE.wave_speed
    columns = [
        carried(at_gauge, 0.0, -BEFORE, SAMPLES),
        carried(reflected, near, near / c - BEFORE, SAMPLES),
        carried(transmitted, far, far / c - BEFORE, SAMPLES),
    ]
    rng = np.random.default_rng(SEED)
    noisy = [1e6 * (one + 2e-6 * rng.standard_normal(SAMPLES)) for one in columns]
    time = INTERVAL * np.arange(SAMPLES)
    rows = [f"{1e6 * t:.1f},{a:.2f},{b:.2f},{d:.2f}" for t, a, b, d in zip(time, *noisy, strict=True)]
    head = "time (us),incident (um/m),reflected (um/m),transmitted (um/m)"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    print(f"2 d1 / c0 = {2e6 * near / c:.3f} us, (d1 + d2) / c0 = {1e6 * (near + far) / c:.3f} us")


if __name__ == "__main__":
    main()
