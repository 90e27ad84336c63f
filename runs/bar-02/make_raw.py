"""Write pulses.csv: a foam between polymer bars, its pulses cut apart, of which the answer is known.

Bars of a polymer with a complex modulus of one Maxwell element carry the first mode. The foam crushes at a
plateau of 2 MPa, as 2 MPa (1 - exp(-strain / 0.01)), in equilibrium throughout. Each column begins with its
own pulse: the incident one, the reflected one and the transmitted one. Noise of 2 um/m at each gauge.
`python runs/bar-02/make_raw.py` writes the file again, to the last digit.
"""

from pathlib import Path

import numpy as np

from kolsky.bars.guides.propagation import propagate
from kolsky.bars.guides.waveguide import PronyModulus, ViscoelasticWaveguide
from kolsky.bars.records import Signal
from kolsky.base.apparatus import Bar, Specimen

MODULUS = PronyModulus(5.0e9, (0.5e9,), (12e-6,))
BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=MODULUS.instantaneous, density=1190.0, poisson=0.35)
GUIDE = ViscoelasticWaveguide(BAR, MODULUS)
SPECIMEN = Specimen(diameter=15e-3, length=8e-3, density=200.0)
INTERVAL, SAMPLES, FLOW, GROWTH = 5e-7, 1400, 2e6, 0.01
BEFORE = 200e-6
"""Time of each column before its pulse arrives [s]."""
DISTANCE = {"incident": 1.0, "transmission": 0.5}
SEED = 19


def in_bar(values: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """A history times a complex factor of the angular frequency, shape [n]."""
    return np.fft.irfft(np.fft.rfft(values, 8 * values.size) * factor, 8 * values.size)[: values.size]


def waves() -> tuple[np.ndarray, ...]:
    """Times from the arrival, and incident, reflected and transmitted strain at the specimen, shape [n]."""
    n = 900
    t = INTERVAL * np.arange(n)
    omega = 2.0 * np.pi * np.fft.rfftfreq(8 * n, INTERVAL)
    rise, fall = np.clip(t / 60e-6, 0.0, 1.0), np.clip((300e-6 - t) / 60e-6, 0.0, 1.0)
    force = 4.0e3 * np.sin(0.5 * np.pi * rise) ** 2 * np.sin(0.5 * np.pi * fall) ** 2
    impedance = GUIDE.impedance(omega)
    # twice the incident wave's velocity less that of the transmitted one, wave by wave of the bar's memory
    transmitted = np.zeros(n)
    for _ in range(60):
        velocity = in_bar(2.0 * (force - transmitted), 1.0 / impedance)
        strain = np.maximum(np.cumsum(np.maximum(velocity, 0.0)) * INTERVAL / SPECIMEN.length, 0.0)
        stress = FLOW * (1.0 - np.exp(-strain / GROWTH))
        found = np.where(force > 0.0, np.minimum(stress * SPECIMEN.area, force), 0.0)
        if np.abs(found - transmitted).max() < 1e-6:
            break
        transmitted = 0.5 * (transmitted + found)
    compliance = 1.0 / GUIDE.stiffness(omega)
    return t, *(in_bar(one, compliance) for one in (force, transmitted - force, transmitted))


def at_gauge(wave: np.ndarray, distance: float, begin: float) -> np.ndarray:
    """A wave at the face as a gauge sees it that much later, or before where negative, shape [SAMPLES]."""
    quiet = np.zeros(500)
    signal = Signal(-500 * INTERVAL, INTERVAL, np.concatenate([quiet, wave, quiet]), 0.0, "1")
    return propagate(signal, GUIDE, distance, band=60e3, start=begin, samples=SAMPLES).value


FILE = Path(__file__).with_name("pulses.csv")


def main(path: Path = FILE) -> None:
    """Write the file, beside this script unless said otherwise."""
    _, incident, reflected, transmitted = waves()
    near, far = DISTANCE["incident"], DISTANCE["transmission"]
    c = GUIDE.wave_speed
    columns = [
        at_gauge(incident, -near, -near / c - BEFORE),
        at_gauge(reflected, near, near / c - BEFORE),
        at_gauge(transmitted, far, far / c - BEFORE),
    ]
    rng = np.random.default_rng(SEED)
    noisy = [1e6 * (one + 2e-6 * rng.standard_normal(SAMPLES)) for one in columns]
    time = INTERVAL * np.arange(SAMPLES)
    rows = [
        f"{1e6 * t:.1f},{a:.2f},{b:.2f},{d:.2f}" for t, a, b, d in zip(time, *noisy, strict=True)
    ]
    head = "time (us),incident (um/m),reflected (um/m),transmitted (um/m)"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    print(f"2 d1 / c0 = {2e6 * near / c:.3f} us, (d1 + d2) / c0 = {1e6 * (near + far) / c:.3f} us")


if __name__ == "__main__":
    main()
