"""Laws in the solver: batches of materials, the stiffness factor, laws that are another's special case."""

import numpy as np
import pytest

from explicit import Model, PlatenMotion, Response, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import LAWS, AnyLaw, MarlowLaw, marlow_from_curve, neo_hookean
from explicit.materials.laws import Gent, MooneyRivlin, NeoHookean, Ogden2, Yeoh

RADIUS, LENGTH, DENSITY = 4.75e-3, 6.5e-3, 870.0
TIMES = np.linspace(1e-5, 6e-4, 60)
HISTORIES = ("force_flyer", "force_transmission", "surface_r", "surface_y", "steps")


def impact(laws: tuple, samples: Samples, *, element: str = "one_point", **options: object) -> Response:
    """A disc whose flyer gains 2.6 m/s in 50 microseconds and squeezes it by a fifth."""
    speed = 2.6
    motion = PlatenMotion.sampled(
        lambda t: speed * (t - 2.5e-5 * (1.0 - np.exp(-t / 2.5e-5))),
        lambda t: speed * (1.0 - np.exp(-t / 2.5e-5)),
        start=0.0,
        end=TIMES[-1],
    )
    volumetric = str(options.pop("volumetric", "quadratic"))
    mesh = cylinder(RADIUS, LENGTH, n_radial=4, n_axial=5)
    contact = {key: options.pop(key) for key in ("faces", "side") if key in options}
    model = Model(mesh, DENSITY, laws, (motion,), element=element, volumetric=volumetric, **contact)  # type: ignore[arg-type]
    stepping = Stepping(**options)  # type: ignore[arg-type]
    return run(model, samples, Sampling(TIMES, TIMES), stepping=stepping)


def apart(one: Response, other: Response) -> float:
    """Largest difference of the transmitted force over its largest value."""
    a, b = one.force_transmission, other.force_transmission
    return float(np.abs(a - b).max() / np.abs(a).max())


def test_a_batch_of_materials_is_each_alone() -> None:
    laws = tuple(Yeoh(10e3 + 1e3 * k, 500.0 * k, 50.0 * (9 - k)) for k in range(9))
    factors = 0.8 + 0.1 * np.arange(9)
    together = impact(laws, Samples.of(stiffness_factor=factors, material=np.arange(9), poisson=0.495))
    assert together.completed.all()
    for k in (0, 4, 8):  # of a pack of eight lanes, and of the incomplete one behind it
        alone = impact((laws[k],), Samples.of(stiffness_factor=factors[k], poisson=0.495))
        for name in HISTORIES:
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(together, name)[k], name)


def test_the_stiffness_factor_scales_the_law() -> None:
    law = Yeoh(12e3, 800.0, 90.0)
    scaled = impact((law,), Samples.of(stiffness_factor=1.7, poisson=0.495, damping=2e-5))
    stiffer = impact((law.scaled(1.7),), Samples.of(poisson=0.495, damping=2e-5))
    assert apart(scaled, stiffer) < 1e-9  # round-off over a thousand steps


def test_the_neo_hookean_law_is_marlows_of_its_curve() -> None:
    # One step for both, so that nothing but the law's own arithmetic differs.
    samples, step = Samples.of(poisson=0.495), {"largest_step": 2e-7}
    one = impact((NeoHookean(25e3),), samples, **step)
    other = impact((neo_hookean(25e3),), samples, **step)
    assert one.steps[0] == other.steps[0]
    assert apart(one, other) < 1e-9


def as_marlow(law: AnyLaw) -> MarlowLaw:
    """Marlow's law of the incompressible uniaxial compression of a law of I1_bar."""
    lam = np.linspace(0.25, 0.995, 400)
    slope, side, _ = law.principal(lam, lam**-0.5, lam**-0.5)
    return marlow_from_curve(lam, slope - side * lam**-1.5, n_knots=1001)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["yeoh", "arruda_boyce", "gent", "humphrey"])
def test_a_law_of_the_first_invariant_is_marlows_of_its_curve(name: str) -> None:
    law, samples, step = LAWS[name].example(), Samples.of(poisson=0.495), {"largest_step": 2e-7}
    one, other = (impact((item,), samples, **step) for item in (law, as_marlow(law)))
    # The table's limit at rest is a straight line through points up to 16 % strain: 1e-4 of the stress.
    assert apart(one, other) < 3e-4


@pytest.mark.slow
@pytest.mark.parametrize("element", ["one_point", "fbar"])
def test_mooney_and_rivlins_law_is_ogdens_with_two_exponents(element: str) -> None:
    samples, step = Samples.of(poisson=0.495), {"largest_step": 1e-7}
    one = impact((MooneyRivlin(10e3, 2.5e3),), samples, element=element, **step)
    other = impact((Ogden2(20e3, 2.0, 5e3, -2.0),), samples, element=element, **step)
    assert one.completed.all()
    assert apart(one, other) < 1e-8  # round-off, through logarithms and exponentials, over six thousand steps


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", [Ogden2(20e3, 1.8, 5e3, -2.5), MooneyRivlin(9e3, 3e3, 400.0)], ids=lambda x: x.NAME
)
def test_energy_is_kept(law: AnyLaw) -> None:
    samples = Samples.of(poisson=0.495)
    coarse, fine = (impact((law,), samples, safety=share) for share in (0.9, 0.225))
    marlow = impact((neo_hookean(law.shear_modulus),), samples, safety=0.225)
    assert coarse.completed.all()
    # What is missing is the error in time, of second order in the step, and as large as of Marlow's law.
    assert fine.energy.imbalance()[0] < 0.1 * coarse.energy.imbalance()[0]
    assert fine.energy.imbalance()[0] < 1.2 * marlow.energy.imbalance()[0]


@pytest.mark.slow
def test_single_precision_keeps_its_digits() -> None:
    samples, law, step = Samples.of(poisson=0.499), Ogden2(20e3, 1.8, 5e3, -2.5), {"largest_step": 1e-7}
    form = {"volumetric": "logarithmic"}
    double, single = (impact((law,), samples, precision=p, **form, **step) for p in ("fp64", "fp32"))
    # Six thousand steps of 6e-8 rounding each, with K = 1000 mu before J - 1; a percent were its digits lost.
    assert apart(double, single) < 1e-3


@pytest.mark.slow
def test_the_volumetric_forms_agree_where_volume_hardly_changes() -> None:
    samples, law, step = Samples.of(poisson=0.495), NeoHookean(25e3), {"largest_step": 2e-7}
    by_form = {
        form: impact((law,), samples, volumetric=form, **step)
        for form in ("quadratic", "logarithmic", "simo_taylor")
    }
    for form in ("logarithmic", "simo_taylor"):
        # The impact compresses by 5 %: pressures differ by that share, the outline by a thousandth of 5 mm.
        difference = np.abs(by_form["quadratic"].surface_r - by_form[form].surface_r).max()
        assert 1e-7 < difference < 1e-5
        # Forces that were not the energy's would show here: 1e-6 is the error of these steps.
        assert by_form[form].energy.imbalance()[0] < 1e-5


def test_past_locking_a_run_ends_and_says_so() -> None:
    law, samples = Gent(25e3, 0.05), Samples.of(poisson=0.495)
    response = impact((law,), samples)
    assert not response.completed.any()


def test_an_unknown_form_is_refused() -> None:
    with pytest.raises(ValueError, match=r"volumetric must be one of .*, got 'hooke'"):
        impact((NeoHookean(25e3),), Samples.of(), volumetric="hooke")
