"""Order of the space discretisation: an exact elastic wave, and smooth impacts between meshes."""

from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from order import assert_order, fitted_order
from scene import (
    DENSITY,
    LENGTH,
    RADIUS,
    YOUNG,
    FloatArray,
    gentle_start,
    gentle_stroke,
    ninth,
    rms,
    shear_modulus,
)

from explicit import Model, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import neo_hookean

MESHES = ((4, 6), (8, 12), (16, 24), (32, 48), (64, 96))
"""Elements across the radius and along the length; every mesh halves the one before."""
SIZES = np.array([LENGTH / n for _, n in MESHES])  # element size [m]
IMPACTS = {"frictionless, ν = 0.3": 1.9, "frictionless, ν = 0.495": 1.9, "bonded, ν = 0.495": 1.0}
"""Smallest order expected of an impact [-]: two where the solution is smooth; a bonded edge is a stress
singularity r^-0.4, which leaves an integral quantity little more than first order."""
QUANTITIES = ("impulse", "radius", "height")
ALLOWED = 0.15
"""Allowed distance of a fitted order below theory [-]: the series are not monotone to their last digits."""
SPEED, RISE, END = 1.0, 5e-4, 1.2e-3  # the impacts: speed [m/s], time of rise [s], end [s]; 14 % compression


Result = SimpleNamespace


def _wave(n_axial: int) -> tuple[float, float, float]:
    """Errors of displacement and force and the wave speed's, for a rod with ν = 0 and one end driven."""
    celerity = np.sqrt(YOUNG / DENSITY)
    passage = LENGTH / celerity
    stroke, duration = 1e-6 * LENGTH, 2.0 * passage  # linear: nothing of second order in 1e-6 is left
    times = np.linspace(0.5, 4.5, 161) * passage
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=2, n_axial=n_axial),
        DENSITY,
        (neo_hookean(0.5 * YOUNG),),
        (gentle_stroke(stroke, duration, end=6.0 * passage),),
    )
    # Half the stable step: at the whole one a one-dimensional mesh is exact, and there is nothing to fit.
    response = run(model, Samples.of(poisson=0.0), Sampling(times, times), stepping=Stepping(safety=0.5))

    def echoes(time: FloatArray) -> FloatArray:
        return np.asarray(sum(ninth((time - 2.0 * k * passage) / duration) for k in range(4)))

    height = np.linspace(0.0, LENGTH, n_axial + 1)
    ahead, behind = (LENGTH - height) / celerity, (LENGTH + height) / celerity
    exact = -stroke * (echoes(times[:, None] - ahead) - echoes(times[:, None] - behind))
    probe = 1e-5 * passage
    slope = (echoes(times - passage + probe) - echoes(times - passage - probe)) / (2.0 * probe)
    force = YOUNG * np.pi * RADIUS**2 * stroke * 2.0 * slope / celerity
    early = (times > passage) & (times < 1.9 * passage)  # the rise of the first pulse
    found = np.interp(0.5 * force.max(), response.force_transmission[0, early], times[early])
    expected = np.interp(0.5 * force.max(), force[early], times[early])
    return (
        rms(response.surface_y[0] - height - exact) / stroke,
        rms(response.force_transmission[0] - force) / rms(force),
        float((expected - found) / passage),
    )


def _impact(faces: str, poisson: float) -> dict[str, FloatArray]:
    """Differences between neighbouring meshes at the nodes of the coarsest."""
    times = np.linspace(0.1, 1.0, 19) * END
    found = []
    for n_radial, n_axial in MESHES:
        model = Model(
            cylinder(RADIUS, LENGTH, n_radial=n_radial, n_axial=n_axial),
            DENSITY,
            (neo_hookean(shear_modulus(poisson)),),
            (gentle_start(SPEED, RISE, end=2.0 * END),),
            faces=faces,
            side=faces,
        )
        response = run(model, Samples.of(poisson=poisson), Sampling(times, times))
        common = slice(None, None, n_axial // MESHES[0][1])
        r, y = response.surface_r[0][:, common], response.surface_y[0][:, common]
        found.append((response.impulse_transmission[0], r - RADIUS, y - np.linspace(0.0, LENGTH, y.shape[1])))
    largest = [np.abs(value).max() for value in found[-1]]
    return {
        name: np.array([rms(a[k] - b[k]) / largest[k] for a, b in pairwise(found)])
        for k, name in enumerate(QUANTITIES)
    }


@cache
def exact_wave() -> FloatArray:
    """Errors of displacement, force and speed of the wave, shape [n_meshes, 3]."""
    return np.array([_wave(n) for _, n in MESHES])


@cache
def case() -> Result:
    """One exact wave and three impacts on five meshes."""
    waves = exact_wave()
    impacts = {name: _impact(name.split(",")[0], float(name.rsplit(" ", 1)[1])) for name in IMPACTS}
    return Result(
        # Root-mean-square error of the axial displacement over the stroke [-], shape [n_meshes].
        wave_position=waves[:, 0],
        # Root-mean-square error of the force over its root mean square [-], shape [n_meshes].
        wave_force=waves[:, 1],
        wave_orders=(fitted_order(SIZES, waves[:, 0]), fitted_order(SIZES, waves[:, 1])),  # fits of the two
        # relative error of the wave speed, from the arrival at the far end, finest mesh [-]
        speed_error=float(waves[-1, 2]),
        # Root-mean-square difference to the next finer mesh, over the largest change, by impact and quantity.
        impacts=impacts,
        # their fits
        orders={
            name: {q: fitted_order(SIZES[:-1], values) for q, values in series.items()}
            for name, series in impacts.items()
        },
    )


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    waves = [
        [f"{1e3 * h:.3f}", f"{a:.1e}", f"{b:.1e}"]
        for h, a, b in zip(SIZES, result.wave_position, result.wave_force, strict=True)
    ]
    impacts = [
        [name, q, *(f"{v:.1e}" for v in series[q]), f"{fit.order:.2f} +- {fit.standard_error:.2f}"]
        for name, series in result.impacts.items()
        for q, fit in result.orders[name].items()
    ]
    names = [f"{a} × {b}" for a, b in MESHES[:-1]]
    position, force = result.wave_orders
    orders = [fit.order for fits in result.orders.values() for fit in fits.values()]
    wave = ", ".join(f"{fit.order:.2f}" for fit in result.wave_orders)
    return locals()


def test_exact_wave_converges_with_second_order_to_the_rods() -> None:
    for error in exact_wave().T[:2]:
        assert_order(SIZES, error, 2.0, ALLOWED)
    # Dispersion of second order, 1e-4 at 96 elements a length, and times sampled every 0.025 passages.
    assert abs(exact_wave()[-1, 2]) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("impact", list(IMPACTS))
def test_impact_converges_in_space(impact: str, quantity: str) -> None:
    differences = case().impacts[impact][quantity]
    assert_order(SIZES[:-1], differences, IMPACTS[impact], ALLOWED, at_least=True)
