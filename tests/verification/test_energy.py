"""Energy balance of dynamic runs with every term of the ledger switched on."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from order import assert_order, fitted_order
from scene import DENSITY, LENGTH, RADIUS, FloatArray, shear_modulus, speed_after_rise

from explicit import CharacteristicBar, Model, Response, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import neo_hookean

TOLERANCE = 1e-3
"""Largest |residual| over the largest external work [-]: a tenth of a per cent, below every other error."""
FRICTION = (0.0, 0.1, 0.3, 1.0)
END = 1.5e-3
TIMES = np.linspace(0.0, END, 61)[1:]
STEPS = (8e-7, 4e-7, 2e-7, 1e-7)  # fixed steps of the study of the residual [s]
TERMS = ("kinetic", "elastic", "hourglass", "hourglass_damping", "damping", "friction", "impact")
BAR = CharacteristicBar(impedance=6910.0, round_trip=617e-6)  # the steel bar of the paper's apparatus


Result = SimpleNamespace


def simulate(
    friction: tuple[float, ...],
    kind: str = "deviatoric",
    *,
    n: tuple[int, int] = (16, 22),
    step: float = float("inf"),
    element: str = "one_point",
) -> tuple[Model, Response]:
    """Compress to 60 % at 2.6 m/s with friction, all damping, the bar and side contact."""
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=n[0], n_axial=n[1]),
        DENSITY,
        (neo_hookean(shear_modulus(0.495)),),
        (speed_after_rise(2.6, 50e-6, end=END),),
        faces="coulomb",
        side="coulomb",
        support=BAR,
        damping_kind=kind,  # type: ignore[arg-type]
        element=element,
    )
    samples = Samples.of(poisson=0.495, damping=2.5e-5, mass_damping=100.0, friction=np.array(friction))
    times = np.linspace(0.0, END, 3001)[1:]
    return model, run(model, samples, Sampling(times, TIMES), stepping=Stepping(largest_step=step))


def external_work(model: Model, response: Response) -> FloatArray:
    """Work of both platens from the recorded impulses and motions [J], shape [n_samples, n_times]."""
    times = np.concatenate([[0.0], response.force_times])
    given = np.pad(response.impulse_flyer, ((0, 0), (1, 0)))
    taken = np.pad(response.impulse_transmission, ((0, 0), (1, 0)))
    flyer = np.diff(given, axis=1) * (np.diff(model.motions[0](times)) / np.diff(times))
    # The platen in front of the bar moves with v = F / Z + 2 h, h the outgoing wave one round trip ago.
    outgoing = np.diff(taken, axis=1) / np.diff(times) / BAR.impedance
    late = response.force_times - 0.5 * times[1] - BAR.round_trip
    for row in outgoing:  # in place: a wave that left is the next one that returns
        for k in range(len(late)):
            row[k] += np.interp(late[k], response.force_times - 0.5 * times[1], row, left=0.0)
    force = np.diff(taken, axis=1) / np.diff(times)
    back = 2.0 * outgoing - force / BAR.impedance  # v = F / Z + 2 h and g = F / Z + h
    work = np.cumsum(flyer - np.diff(taken, axis=1) * back, axis=1)
    return np.array([np.interp(TIMES, response.force_times, row) for row in work])


@cache
def case() -> Result:
    """Both kinds of damping, four friction coefficients, two meshes and four fixed steps."""
    ledgers = {kind: simulate(FRICTION, kind)[1].energy for kind in ("deviatoric", "full")}
    impact = {}
    for n in ((8, 11), (16, 22), (32, 44)):
        ledger = simulate((0.3,), n=n)[1].energy
        impact[f"{n[0]} × {n[1]}"] = float(ledger.impact[0, -1] / ledger.external[0, -1])
    fixed = [simulate((0.3,), step=step) for step in STEPS]
    refined = [float(response.energy.imbalance()[0]) for _, response in fixed]
    model, response = fixed[-1]
    work = np.abs(external_work(model, response) - response.energy.external).max()
    return Result(
        ledgers=ledgers,  # ledger by kind of damping
        # Largest difference of `external` from the platens' impulses and motions, over the work [-].
        work_error=float(work / response.energy.external.max()),
        # Energy lost by landing nodes over external work at the end, f = 0.3, by mesh [-].
        impact_share=impact,
        refined=np.array(refined),  # imbalance by fixed step, f = 0.3 [-], shape [n_steps]
        order=fitted_order(STEPS, refined),  # its fit against the step
    )


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    rows = []
    for kind, ledger in result.ledgers.items():
        for i, f in enumerate(FRICTION):
            work = ledger.external[i, -1]
            parts = (f"{100 * getattr(ledger, name)[i, -1] / work:.2f}" for name in TERMS)
            rows.append([kind, f"{f:g}", f"{1e3 * work:.2f}", *parts, f"{100 * ledger.imbalance()[i]:.4f}"])
    header = [
        "damping", "f", "work [mJ]", *(f"{name.replace('_', ' ')} [%]" for name in TERMS), "imbalance [%]",
    ]  # fmt: skip
    steps = [[f"{1e6 * dt:g}", f"{100 * e:.4f}"] for dt, e in zip(STEPS, result.refined, strict=True)]
    landing = [[mesh, f"{100 * share:.2f}"] for mesh, share in result.impact_share.items()]
    worst = max(float(ledger.imbalance().max()) for ledger in result.ledgers.values())
    return locals()


@pytest.mark.parametrize("kind", ["deviatoric", "full"])
def test_work_is_the_sum_of_its_parts_and_every_one_is_there(kind: str) -> None:
    assert case().ledgers[kind].imbalance().max() < TOLERANCE
    ledger = case().ledgers[kind]
    for name in TERMS:
        values = getattr(ledger, name)[1:, -1]  # all but f = 0, which has no friction
        assert (values > 0.0).all(), name
    assert (ledger.friction[0] == 0.0).all()


@pytest.mark.parametrize("kind", ["deviatoric", "full"])
@pytest.mark.parametrize("name", ["damping", "friction"])
def test_a_dissipation_never_gives_energy_back(kind: str, name: str) -> None:
    # -1e-9 J is 1e-7 of the work: the half of a step that the ledger estimates.
    assert np.diff(getattr(case().ledgers[kind], name), axis=1).min() > -1e-9


def test_work_is_that_of_the_recorded_impulses_and_motions() -> None:
    assert case().work_error < 5e-4  # force known by its mean over 0.5 us; ledger at a step's start


def test_residual_falls_with_the_step() -> None:
    # Second order of the undamped scheme, first order of the lagged damping velocity: in between.
    assert_order(STEPS, case().refined, 1.0, 0.15, at_least=True)


def test_landing_loss_vanishes_with_the_mesh() -> None:
    share = list(case().impact_share.values())
    # Mass of the surface nodes, so first order in the element; contact order differs from mesh to mesh.
    assert_order([4.0, 2.0, 1.0], share, 1.0, 0.25)
