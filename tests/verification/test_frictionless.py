"""Frictionless static compression against the closed form, by slow undamped loading."""

import csv
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from order import assert_order, fitted_order
from scene import DENSITY, LENGTH, RADIUS, FloatArray, invert, quintic, shear_modulus, smooth_stroke

from explicit import Model, Samples, Sampling, cylinder, run
from explicit.materials import MarlowLaw, MaterialLaw, marlow_from_curve, neo_hookean

REFERENCE = Path(__file__).resolve().parent.parent / "reference" / "C_frictionless_analytic.csv"
LAWS = ("nh", "yeoh")
POISSON = (0.49, 0.495, 0.4999)
COMPRESSION = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])  # nominal compressions that are compared [-]
STROKE = 0.75
"""Compression at which the loading would end: 60 % is passed at speed, before the instability has grown."""
LOADING = 0.04
"""Duration of the loading that is compared with the closed form [s]; a wave needs 0.7 ms for the length."""
DURATIONS = (0.02, 0.04, 0.08, 0.16)  # durations of the study of the dynamic residual [s]
STABLE = COMPRESSION < 0.55
"""Compressions below Biot's: from a stretch of 0.444 on a free surface of a neo-Hookean solid wrinkles."""
WRINKLED = 20e-6  # spread of the radius that says the homogeneous state is left [m]
FORCE_TOLERANCE = 3e-3
"""Allowed relative force error [-]: the inertia of this loading, 0.2 % at 10 %, falls as duration^-2."""
RADIUS_TOLERANCE = {"stable": 0.1e-6, "past": 10e-6}
"""Allowed error of the mean radius [m]: inertia, and past 55 % the growing wrinkles (spread 0.1 mm)."""


Result = SimpleNamespace


def yeoh_like(mu: float) -> MarlowLaw:
    """The reference's second law, W = C1 x + C2 x^2 + C3 x^3 with C2 = 0.1 C1, C3 = 0.02 C1, as a curve."""
    stretch = np.linspace(0.25, 0.99, 300)
    x = stretch**2 + 2.0 / stretch - 3.0
    factor = 1.0 + 0.2 * x + 0.06 * x**2
    return marlow_from_curve(stretch, mu * factor * (stretch - stretch**-2), n_knots=1001)


def reference() -> FloatArray:
    """Force [N] and radius [m] of the closed form, shape [n_laws, n_poisson, 6, 2]."""
    with REFERENCE.open(encoding="utf-8") as lines:
        rows = {
            (law, float(nu), float(e)): (float(force), float(radius))
            for law, nu, e, force, radius, _ in csv.reader(line for line in lines if line[0] != "#")
        }
    return np.array([[[rows[law, nu, e] for e in COMPRESSION] for nu in POISSON] for law in LAWS])


def slow_compression(
    duration: float,
    laws: Sequence[MaterialLaw],
    poisson: list[float],
    compression: FloatArray = COMPRESSION,
    *,
    element: str = "one_point",
) -> tuple[FloatArray, ...]:
    """Mean face force [N], mean radius and its spread [m], each of shape [n_samples, n_compressions]."""
    times = np.array([duration * invert(quintic, e / STROKE) for e in compression])
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=8, n_axial=12),
        DENSITY,
        tuple(laws),
        (smooth_stroke(STROKE * LENGTH, duration, end=duration, n_knots=20001),),
        faces="frictionless",
        side="frictionless",
        element=element,
    )
    samples = Samples.of(poisson=np.array(poisson), material=np.arange(len(laws)))
    response = run(model, samples, Sampling(times, times))
    force = 0.5 * (response.force_flyer + response.force_transmission)
    return force, response.surface_r.mean(axis=-1), np.ptp(response.surface_r, axis=-1)


@cache
def case() -> Result:
    """Both laws at three Poisson ratios, and the dynamic residual for four loading times."""
    exact = reference()
    laws = [make(shear_modulus(nu)) for make in (neo_hookean, yeoh_like) for nu in POISSON]
    force, radius, spread = (
        value.reshape(2, 3, 6) for value in slow_compression(LOADING, laws, list(POISSON) * 2)
    )
    slow = []
    for duration in DURATIONS:
        found, _, _ = slow_compression(duration, [neo_hookean(shear_modulus(0.495))], [0.495])
        slow.append(np.abs(found[0] / exact[0, 1, :, 0] - 1.0)[STABLE].max())
    fine = np.linspace(0.4, 0.6, 81)
    _, _, bulge = slow_compression(0.2, [neo_hookean(shear_modulus(0.495))], [0.495], fine)
    return Result(
        # compression at which very slow loading leaves the homogeneous state [-]
        onset=float(fine[np.argmax(bulge[0] > WRINKLED)]),
        # relative error of the mean of both face forces [-], shape [n_laws, n_poisson, 6]
        force=force / exact[..., 0] - 1.0,
        radius=radius - exact[..., 1],  # error of the mean side radius [m], shape [n_laws, n_poisson, 6]
        spread=spread,  # largest minus smallest side radius [m], shape [n_laws, n_poisson, 6]
        # |force error| up to 50 %, largest, by duration of loading [-], shape [n_durations]
        slow=np.array(slow),
        order=fitted_order(1.0 / np.array(DURATIONS), slow),  # fit of `slow` against 1 / duration
    )


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    rows = [
        [law, f"{nu}", *(f"{100 * e:+.3f}" for e in errors)]
        for law, by_nu in zip(LAWS, result.force, strict=True)
        for nu, errors in zip(POISSON, by_nu, strict=True)
    ]
    radii = [
        [law, f"{nu}", *(f"{1e6 * e:+.2f} ({1e6 * s:.1f})" for e, s in zip(errors, spread, strict=True))]
        for law, by_nu, spreads in zip(LAWS, result.radius, result.spread, strict=True)
        for nu, errors, spread in zip(POISSON, by_nu, spreads, strict=True)
    ]
    header = ["law", "nu", *(f"{e:.0%}" for e in COMPRESSION)]
    slow = [[f"{1e3 * t:g}", f"{100 * e:.4f}"] for t, e in zip(DURATIONS, result.slow, strict=True)]
    return locals()


def test_force_is_the_closed_form_to_60_percent() -> None:
    assert np.abs(case().force).max() < FORCE_TOLERANCE


def test_mean_radius_is_the_closed_form() -> None:
    error = np.abs(case().radius)
    stable = STABLE
    assert error[..., stable].max() < RADIUS_TOLERANCE["stable"]
    assert error[..., ~stable].max() < RADIUS_TOLERANCE["past"]


def test_deformation_stays_homogeneous_below_the_surface_instability() -> None:
    # 2 micrometres on a radius of 5 mm: the inertia of the loading, 0.2 % of the stress, bulges that much.
    assert case().spread[..., STABLE].max() < 2e-6


def test_dynamic_residual_falls_with_the_square_of_the_loading_time() -> None:
    # Inertial stress goes as acceleration, duration^-2; 0.1 leaves room for the next term of the series.
    assert_order(1.0 / np.array(DURATIONS), case().slow, 2.0, 0.1)


def test_slow_loading_leaves_the_homogeneous_state_at_biots_stretch() -> None:
    # Critical stretch 0.444 of an incompressible half-space (Biot 1963); 0.02 for nu = 0.495, the finite
    # length of the specimen and the time the wrinkles need to grow to 20 micrometres.
    assert abs(1.0 - case().onset - 0.444) < 0.02
