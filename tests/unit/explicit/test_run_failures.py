"""The checks of the time loop: they do not change results and raise no false alarms."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from explicit import (
    CharacteristicBar,
    Mesh,
    Model,
    Outcome,
    PlatenMotion,
    Response,
    Samples,
    Sampling,
    Stepping,
    cylinder,
    run,
)
from explicit.materials import neo_hookean
from explicit.mesh import element_geometry

RADIUS, LENGTH, END = 4.75e-3, 6.5e-3, 8e-4
TIMES = np.linspace(0.0, END, 41)
SAMPLING = Sampling(TIMES, TIMES)
KINDS = pytest.mark.parametrize(
    ("element", "precision"), [("one_point", "fp64"), ("fbar", "fp64"), ("one_point", "fp32")]
)


def stroke(depth: float, start: float = 0.0) -> PlatenMotion:
    """At rest until `start`, then ever faster, `depth` at the end."""
    span = END - start
    return PlatenMotion.sampled(
        lambda t: depth * (np.maximum(t - start, 0.0) / span) ** 2,
        lambda t: 2.0 * depth * np.maximum(t - start, 0.0) / span**2,
        start=0.0,
        end=END,
        n_knots=129,
    )


def model(*motions: PlatenMotion, last: float = 4.0, **changes: Any) -> Model:
    mesh = cylinder(RADIUS, LENGTH, n_radial=4, n_axial=6)
    return replace(Model(mesh, 870.0, (neo_hookean(27e3, last=last),), motions), **changes)


def same(a: Response, b: Response, i: int, j: int) -> bool:
    """Whether row i of one response and row j of another have the same bits."""
    one, other = a.select([i]), b.select([j])
    arrays = [(getattr(one, name), getattr(other, name)) for name in vars(one) if name != "energy"]
    arrays += [(value, getattr(other.energy, name)) for name, value in vars(one.energy).items()]
    pairs = [(x, y) for x, y in arrays if isinstance(x, np.ndarray)]
    assert len(pairs) == 24
    return one.outcomes == other.outcomes and all(
        np.array_equal(x, y, equal_nan=x.dtype.kind == "f") for x, y in pairs
    )


@KINDS
def test_the_end_of_the_data_in_any_pack(element: str, precision: Any) -> None:
    # A pack of simulations against simulations of packs: two depths, of which one stays below the data's end.
    made = model(stroke(0.1 * LENGTH), stroke(0.5 * LENGTH), last=0.7, element=element, past_data="stop")
    motion, n = np.arange(16) % 2, 16
    stepping, factor = Stepping(precision=precision), np.linspace(0.8, 1.2, n)
    batch = run(
        made, Samples.of(poisson=0.49, motion=motion, stiffness_factor=factor), SAMPLING, stepping=stepping
    )
    assert set(batch.outcomes[0::2]) == {Outcome.COMPLETED}
    assert set(batch.outcomes[1::2]) == {Outcome.TABLE_EXCEEDED}
    for i in range(4):
        samples = Samples.of(poisson=0.49, motion=motion[i], stiffness_factor=factor[i])
        assert same(batch, run(made, samples, SAMPLING, stepping=stepping), i, 0)


@KINDS
def test_data_that_are_not_left_change_nothing(element: str, precision: Any) -> None:
    stop = model(stroke(0.4 * LENGTH), element=element, past_data="stop")
    runs = [
        run(made, Samples.of(poisson=0.49), SAMPLING, stepping=Stepping(precision=precision))
        for made in (stop, replace(stop, past_data="continue"))
    ]
    assert runs[0].completed.all()
    assert same(runs[0], runs[1], 0, 0)


def test_histories_until_the_end_of_the_data_are_those_of_a_law_that_continues() -> None:
    stop = model(stroke(0.5 * LENGTH), last=0.7, past_data="stop")
    ended, whole = (
        run(made, Samples.of(poisson=0.49), SAMPLING) for made in (stop, replace(stop, past_data="continue"))
    )
    known = np.isfinite(ended.force_flyer[0])
    assert 10 < known.sum() < len(TIMES) - 5
    np.testing.assert_array_equal(ended.force_flyer[0, known], whole.force_flyer[0, known])
    assert ended.extrapolated_share[0] == 0.0 < whole.extrapolated_share[0]
    assert ended.largest_strain_measure[0] <= 0.7 < whole.largest_strain_measure[0]


@pytest.mark.parametrize(
    ("changes", "precision"),
    [
        ({}, "fp64"),
        ({"support": CharacteristicBar(1e-3, 1e300)}, "fp64"),
        ({"support": CharacteristicBar(8.0, END / 5)}, "fp64"),
        ({"support": CharacteristicBar(8.0, END / 5)}, "fp32"),
        ({"faces": "frictionless", "side": "frictionless"}, "fp64"),
    ],
    ids=["rigid", "feather-light bar", "bar", "bar-fp32", "lifting off"],
)
def test_no_sound_motion_is_called_divergence(precision: Any, changes: dict[str, Any]) -> None:
    trembling = np.random.default_rng(3).normal(0.0, 1e-9, 129)  # a flyer's record at rest [m/s]
    wait = stroke(0.3 * LENGTH, start=0.75 * END)
    motions = (
        wait,
        replace(wait, velocity=wait.velocity + trembling),
        # From rest to 3 m/s at once, back as fast, and away.
        PlatenMotion(0.0, END / 128, LENGTH * np.r_[0.0, np.full(128, 1e-9)], np.zeros(129)),
        PlatenMotion.sampled(lambda t: 3.0 * t, lambda t: 3.0 + 0.0 * t, start=0.0, end=END, n_knots=129),
        PlatenMotion.sampled(lambda t: 1.2e-3 * np.sin(np.pi * t / 4e-4),
         lambda t: 1.2e-3 * np.pi / 4e-4 * np.cos(np.pi * t / 4e-4), start=0.0, end=END, n_knots=129),
    )  # fmt: skip
    samples = Samples.of(poisson=0.49, motion=np.arange(len(motions)))
    ended = run(model(*motions, **changes), samples, SAMPLING, stepping=Stepping(precision=precision))
    assert [outcome.name for outcome in ended.outcomes] == ["COMPLETED"] * len(motions)


def test_the_volume_of_a_mesh() -> None:
    mesh = cylinder(RADIUS, LENGTH, n_radial=5, n_axial=7, grading=3.0)
    assert mesh.volume == pytest.approx(np.pi * RADIUS**2 * LENGTH, rel=1e-14)  # round-off
    inner = ~(
        mesh.on_axis | np.isin(np.arange(mesh.n_nodes), [*mesh.side, *mesh.lower_face, *mesh.upper_face])
    )
    nodes = mesh.nodes + 2e-4 * np.random.default_rng(1).uniform(-1.0, 1.0, mesh.nodes.shape) * inner[:, None]
    bent = Mesh(nodes, mesh.quads, mesh.lower_face, mesh.upper_face, mesh.side)
    assert bent.volume == pytest.approx(element_geometry(bent).volume.sum(), rel=1e-13)
    raised = replace(mesh, nodes=mesh.nodes + np.array([0.0, 1.0]))
    np.testing.assert_allclose(raised.centres, mesh.centres, atol=1e-15)  # round-off of 1 m


LEDGER_TIMES = np.linspace(0.0, 4e-4, 24)[1:]


def ledger_model() -> Model:
    """A specimen pressed at 2.6 m/s from the start."""
    motion = PlatenMotion.sampled(
        lambda t: 2.6 * t, lambda t: np.full_like(t, 2.6), start=0.0, end=LEDGER_TIMES[-1]
    )
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=4, n_axial=6)
    return Model(mesh=mesh, density=870.0, materials=(neo_hookean(27e3),), motions=(motion,))


@pytest.mark.parametrize("n", [1, 8])
def test_entries_left_out_are_nan_and_the_others_keep_their_bits(n: int) -> None:
    samples = Samples.of(stiffness_factor=np.linspace(0.9, 1.1, n), poisson=0.49, damping=2.5e-5)
    every = Sampling(force_times=LEDGER_TIMES, surface_times=LEDGER_TIMES)
    full, thin = (
        run(ledger_model(), samples, every),
        run(ledger_model(), samples, replace(every, ledger_every=5)),
    )
    kept = (np.arange(len(LEDGER_TIMES)) % 5 == 0) | (np.arange(len(LEDGER_TIMES)) == len(LEDGER_TIMES) - 1)
    for field in fields(full.energy):
        whole, part = getattr(full.energy, field.name), getattr(thin.energy, field.name)
        assert np.isfinite(whole).all()
        assert np.array_equal(whole[:, kept], part[:, kept])
        assert np.isnan(part[:, ~kept]).all()
    assert np.array_equal(full.force_transmission, thin.force_transmission)
    assert np.array_equal(full.surface_r, thin.surface_r)
    assert np.isfinite(thin.energy.imbalance()).all()
