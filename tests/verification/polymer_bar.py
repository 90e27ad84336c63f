"""Propagation coefficient and modulus of a polymer bar from the echoes of a pulse, against a Zener solid."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from bar_pulses import Pulse, carried, printed_equation
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scene import table

from kolsky.bars.guides.propagation import propagation
from kolsky.bars.guides.viscoelastic import (
    FittedModulus,
    Pass,
    PropagationCoefficient,
    fit_modulus,
    propagation_coefficient,
)
from kolsky.bars.guides.waveguide import PronyModulus, ViscoelasticWaveguide
from kolsky.bars.records import BarSignal, Signal
from kolsky.base.apparatus import Bar

FloatArray = NDArray[np.float64]

TITLE = "Polymer bars"
FIGURE_SIZE = (6.7, 5.2)
BAR = Bar(0.02, 2.0, 5e9, 1190.0, 0.35)
LONG_TERM, MODULUS, TIME = 5.0e9, 0.5e9, 12e-6
"""Zener's solid: modulus at rest and of the Maxwell element [Pa], relaxation time [s]."""
GUIDE = ViscoelasticWaveguide(BAR, PronyModulus(LONG_TERM, (MODULUS,), (TIME,)))
PULSE = Pulse(100e-6, duration=20e-6, rise=15e-6, ripple=0.0)
STEP, SAMPLES = 5e-7, 6000
NOISE = 1e-3
"""Standard deviation of a sample over the pulse [-]."""
POSITION = 1.0
"""From the free end [m]; echoes come from both ends."""
WAYS = (0.0, 2.0, 4.0)
WINDOW = (50e-6, 830e-6)
"""Of the first passage [s]; the later ones are as long."""
SPEED = 2160.0
"""By which later windows are shifted [m/s]."""
FITTED_TIMES = (1.2e-6, 12e-6, 120e-6)
SHOWN = (2e3, 5e3, 10e3, 20e3)
"""Frequencies of the table [Hz]."""
BACK = 2.0
"""Way that a pulse is sent back [m]."""
CLEAN_TOLERANCE = 2e-4
"""Allowed relative error without noise [-]: the pulse's tail that windows cut off."""
NOISY_TOLERANCE = 5e-3
"""Allowed relative error of the modulus from two passages with noise up to 10 kHz [-]."""
PULSE_TOLERANCE = 2e-3
"""Allowed error of a pulse that is sent back, over its peak [-]."""


@dataclass(frozen=True)
class Result:
    """What was identified, and what is true."""

    record: Signal
    """The gauge's record with noise."""
    clean: PropagationCoefficient
    """From two passages without noise."""
    noisy: dict[str, PropagationCoefficient]
    """With noise, by the number of passages."""
    fitted: FittedModulus
    """Series through the modulus from three passages."""
    clean_error: tuple[float, float]
    """Largest relative error of wavenumber and modulus without noise [-]."""
    noisy_error: dict[str, float]
    """Largest relative error of the modulus up to 10 kHz [-], by the number of passages."""
    fitted_error: float
    """The same of the fitted series up to 20 kHz [-]."""
    residual: float
    """Largest residual of the printed frequency equation at the bar's complex wavenumbers [-]."""
    back: float
    """Largest error of a pulse of 80 µs rise sent back over 2 m [-]."""
    band: float
    """Frequency at which going back ends [Hz]."""
    back_noise: float
    """Sigma of a sample after going back over before [-]."""


def zener(omega: FloatArray) -> NDArray[np.complex128]:
    """Modulus of the solid, closed form [Pa]."""
    turned = 1j * omega * TIME
    return np.asarray(LONG_TERM + MODULUS * turned / (1.0 + turned))


def _gauge(noise: float) -> BarSignal:
    time = STEP * np.arange(SAMPLES)
    omega = PULSE.frequencies(2.0 * time[-1])
    k = GUIDE.wavenumber(omega)
    value = sum(
        (-1.0) ** i * carried(PULSE, time, omega, np.exp(-1j * k * way)) for i, way in enumerate(WAYS)
    )
    value = value + noise * np.random.default_rng(4).standard_normal(SAMPLES)
    return BarSignal(Signal(0.0, STEP, value, noise, "1"), BAR, POSITION, "incident")


def _passes(n: int) -> list[Pass]:
    return [
        Pass((WINDOW[0] + way / SPEED, WINDOW[1] + way / SPEED), way, i) for i, way in enumerate(WAYS[:n])
    ]


def _error(found: PropagationCoefficient, highest: float) -> float:
    used = found.frequency <= highest
    true = zener(2.0 * np.pi * found.frequency)
    return float(np.abs(found.modulus() / true - 1.0)[used].max())


@cache
def case() -> Result:
    """Identification without and with noise, and the way back."""
    clean = propagation_coefficient(_gauge(0.0), _passes(2))
    noisy_gauge = _gauge(NOISE)
    noisy = {name: propagation_coefficient(noisy_gauge, _passes(n)) for name, n in (("two", 2), ("three", 3))}
    fitted = fit_modulus(noisy["three"], FITTED_TIMES)
    omega = 2.0 * np.pi * np.linspace(1e3, 50e3, 99)
    # Correspondence: omega a / c0 with the complex c0, in the equation as it is printed.
    reduced = 0.5 * BAR.diameter * omega * np.sqrt(BAR.density / zener(omega))
    k = 0.5 * BAR.diameter * GUIDE.wavenumber(omega)
    slope = (printed_equation(k * (1 + 1e-6), reduced, 0.35) - printed_equation(k, reduced, 0.35)) / 1e-6
    residual = np.abs(printed_equation(k, reduced, BAR.poisson) / slope)

    slow, time = Pulse(250e-6, duration=200e-6, rise=80e-6, ripple=0.0), 1e-6 * np.arange(4000)
    slow_omega = slow.frequencies(2.0 * time[-1])
    start = BACK / GUIDE.wave_speed
    there = carried(slow, time + start, slow_omega, np.exp(-1j * GUIDE.wavenumber(slow_omega) * BACK))
    back = propagation(Signal(start, 1e-6, there, NOISE, "1"), GUIDE, -BACK)
    used = 2.0 * np.pi * np.linspace(1e3, 20e3, 77)
    return Result(
        record=noisy_gauge.strain,
        clean=clean,
        noisy=noisy,
        fitted=fitted,
        clean_error=(
            float(np.abs(clean.wavenumber / GUIDE.wavenumber(2.0 * np.pi * clean.frequency) - 1.0).max()),
            _error(clean, np.inf),
        ),
        noisy_error={name: _error(found, 10e3) for name, found in noisy.items()},
        fitted_error=float(np.abs(fitted.modulus(used) / zener(used) - 1.0).max()),
        residual=float(residual.max()),
        back=float(np.abs(back.signal.value - carried(slow, time, slow_omega)).max()),
        band=back.band,
        back_noise=back.noise_gain,
    )


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    return (
        "complex modulus of a polymer bar from a pulse and its echo, Zener's closed form: without noise, and "
        "with noise of 1 ‰ up to 10 kHz; a pulse sent back over 2 m",
        f"{result.clean_error[1]:.0e}; {100 * result.noisy_error['two']:.2f} %; {100 * result.back:.2f} %",
        f"{CLEAN_TOLERANCE:.0e}; {100 * NOISY_TOLERANCE:g} %; {100 * PULSE_TOLERANCE:g} %",
    )


def draw(result: Result, figure: Figure) -> None:
    """Top: record of the gauge, a pulse and its echoes from free ends (shaded: windows). Below: phase
    velocity, attenuation, storage modulus and loss from two passages with noise of 0.1 % of the pulse (points
    with bands of k = 2), the series fitted to three passages, and the closed form."""
    grid = figure.add_gridspec(3, 2)
    record = figure.add_subplot(grid[0, :])
    panels = [figure.add_subplot(grid[1 + i, j]) for i in (0, 1) for j in (0, 1)]
    record.plot(1e3 * result.record.time, result.record.value, linewidth=0.7)
    for item in _passes(3):
        record.axvspan(1e3 * item.window[0], 1e3 * item.window[1], color="#56B4E9", alpha=0.15, linewidth=0)
    record.set(xlabel="time [ms]", ylabel="strain over pulse [-]", xlim=(0.0, 1e3 * STEP * SAMPLES))

    found = result.noisy["two"]
    omega = 2.0 * np.pi * found.frequency
    k, true = GUIDE.wavenumber(omega), zener(omega)
    modulus, relative = found.modulus(), found.sigma / np.abs(found.wavenumber)
    series = result.fitted.modulus(omega)
    curves = (
        ("phase velocity [m/s]", found.phase_velocity, found.phase_velocity * relative, omega / k.real, None),
        ("attenuation [1/m]", found.attenuation, found.sigma, -k.imag, None),
        (
            "storage modulus [GPa]",
            1e-9 * modulus.real,
            2e-9 * np.abs(modulus) * relative,
            1e-9 * true.real,
            1e-9 * series.real,
        ),
        (
            "loss modulus [GPa]",
            1e-9 * modulus.imag,
            2e-9 * np.abs(modulus) * relative,
            1e-9 * true.imag,
            1e-9 * series.imag,
        ),
    )
    for panel, (label, value, sigma, exact, line) in zip(panels, curves, strict=True):
        f = 1e-3 * found.frequency
        panel.fill_between(
            f, value - 2.0 * sigma, value + 2.0 * sigma, color="#56B4E9", alpha=0.3, linewidth=0
        )
        panel.plot(f[::16], value[::16], "o", markersize=2, label="two passages")
        if line is not None:
            panel.plot(f, line, "--", color="#D55E00", label="series, three passages")
        panel.plot(f, exact, "k-", linewidth=0.8, label="closed form")
        panel.set(ylabel=label, xlim=(0.0, 20.0))
        used = f < 20.0
        low, high = exact[used].min(), exact[used].max()
        panel.set_ylim(low - 0.5 * (high - low), high + 0.5 * (high - low))
        panel.legend(loc="lower right")
    for panel in panels[2:]:
        panel.set_xlabel("frequency [kHz]")
    for panel in panels[:2]:
        panel.tick_params(labelbottom=False)


def page(result: Result) -> str:
    """The page's text."""
    rows = []
    for f in SHOWN:
        cells = [f"{1e-3 * f:g}"]
        true = zener(np.array([2.0 * np.pi * f]))[0]
        cells += [f"{1e-9 * true.real:.3f}", f"{1e-9 * true.imag:.4f}"]
        for found in result.noisy.values():
            if found.frequency[-1] < f:
                cells.append("beyond its band")
                continue
            i = int(np.argmin(np.abs(found.frequency - f)))
            modulus = found.modulus()[i]
            sigma = 2.0 * abs(modulus) * found.sigma[i] / abs(found.wavenumber[i])
            cells.append(f"{1e-9 * modulus.real:.3f}, {1e-9 * modulus.imag:.4f} ± {1e-9 * sigma:.4f}")
        series = result.fitted.modulus(2.0 * np.pi * f)
        cells.append(f"{1e-9 * series.real:.3f}, {1e-9 * series.imag:.4f}")
        rows.append(cells)
    header = ["f [kHz]", "storage", "loss", "two passages", "three passages", "series"]
    return f"""# {TITLE}

**What is checked.** {{doc}}`../theory/bar_waves`: propagation coefficient and complex modulus of a bar from a
pulse and its echoes at one gauge, and pulses sent along such a bar.

**Independent source.** A standard linear (Zener) solid in closed form, {1e-9 * LONG_TERM:g} +
{1e-9 * MODULUS:g} GPa, {1e6 * TIME:g} µs; records by Fourier integrals. Geometric dispersion comes in by the
correspondence principle: at the bar's complex wavenumbers the frequency equation as it is printed holds
within {result.residual:.0e} of the wavenumber.

**Set-up.** Bar of Ø {1e3 * BAR.diameter:g} mm, {BAR.length:g} m, ν = {BAR.poisson:g},
{BAR.density:g} kg/m³, free ends, gauge in the middle; a pulse of {1e6 * PULSE.duration:g} µs with
{1e6 * PULSE.rise:g} µs of rise. Without noise, two passages give the wavenumber within
{result.clean_error[0]:.0e} and the modulus within {result.clean_error[1]:.0e} from
{1e-3 * result.clean.frequency[0]:.1f} to {1e-3 * result.clean.frequency[-1]:.0f} kHz. With noise of
{1e3 * NOISE:g} ‰ of the pulse [GPa], sigma k = 1:

{table(header, rows)}

More passages know low frequencies better and lose the high ones, which fade. The fitted series is within
{100 * result.fitted_error:.2f} % up to 20 kHz.

*Sent back.* A pulse of 80 µs rise is recovered over {BACK:g} m within {100 * result.back:.2f} % of its
peak. The band ends at {1e-3 * result.band:.0f} kHz, where noise is amplified tenfold; a sample's sigma
becomes {result.back_noise:.2f} of what it was.

**Tolerance.** Without noise {CLEAN_TOLERANCE:.0e}: the tail that windows cut off. With noise
{100 * NOISY_TOLERANCE:g} % of the modulus up to 10 kHz. Sent back, {100 * PULSE_TOLERANCE:g} % of the peak.
"""
