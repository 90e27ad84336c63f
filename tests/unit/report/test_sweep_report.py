"""Analysis of a sweep: rejection of wrong interpolants, effects, indices, the page."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from synthetic import synthetic

from doe import Box, sobol
from kolsky.inverse.run_table import DesignTable
from kolsky.report.canvas import build
from kolsky.report.figures import SWEEPS
from kolsky.report.pages.studies import render_sweep
from kolsky.studies.sweep_analysis import LEVELS, ForcesAlong, SweepAnalysis, analyse_sweep, surface_optimum

BOX = Box.of({"friction": (0.0, 1.0), "stiffness_factor": (0.5, 1.5), "damping": (1e-6, 1e-4)})
EVIL = "<script>alert(1)</script>"


def table(n: int = 128, *, lost: tuple[int, ...] = (), rough: bool = False) -> DesignTable:
    """Runs of known misfits: Phi_F = 1 + 2 f + m, Phi_S = (m - 1)^2 + 0.1; nothing depends on the damping."""
    points = sobol(BOX, n, rng=1).points
    force = 1.0 + 2.0 * points[:, 0] + points[:, 1]
    if rough:
        force = force + 50.0 * np.sin(1e4 * points[:, 0])
    shape = (points[:, 1] - 1.0) ** 2 + 0.1
    outcomes = np.array(["COMPLETED"] * n, dtype=object)
    for i in lost:
        force[i] = shape[i] = np.nan
        outcomes[i] = "INVERTED"
    base = synthetic().design
    return replace(
        base, names=BOX.names, points=points, lower=np.array(BOX.lower), upper=np.array(BOX.upper),
        outcomes=tuple(outcomes), end_times=np.full(n, 1e-3),
        failed_elements=np.where(outcomes == "COMPLETED", -1, 3),
        failed_places=np.where((outcomes == "COMPLETED")[:, None], np.nan, [[1e-3, 2e-3]]),
        stage=("design",) * n, phi_force=force, phi_shape=shape, chi2_force=force, chi2_shape=shape,
    )  # fmt: skip


@cache
def analysed(**options: object) -> SweepAnalysis:
    """Made once: no test changes it."""
    return analyse_sweep("shot", BOX, table(**options))  # type: ignore[arg-type]


def along() -> SweepAnalysis:
    """A sweep over the stiffness alone, with forces in proportion to it."""
    x, time = np.linspace(0.5, 1.5, 8), np.linspace(0.0, 1e-3, 50)
    forces = ForcesAlong(x, np.arange(8) + 2000, time, x[:, None] * time, time)
    runs = replace(
        table(8), names=("stiffness_factor",), points=x[:, None], lower=np.array([0.5]), upper=np.array([1.5])
    )
    return replace(analyse_sweep("shot", Box.of({"stiffness_factor": (0.5, 1.5)}), runs), forces=forces)


def test_misfits_without_an_interpolant_are_drawn_as_runs() -> None:
    found = analysed(rough=True)
    assert found.outputs["Phi_F"].surrogate is None
    figure = build(SWEEPS["sweep-effects"], found)
    assert "No interpolant of Φ_F" in str(figure.get_label())
    first = figure.axes[0]
    np.testing.assert_array_equal(first.lines[0].get_ydata(), found.outputs["Phi_F"].values)
    assert len(first.lines) == 1


def test_indices_of_known_functions() -> None:
    # Phi_F is linear: variances (2 / sqrt 12)^2 and (1 / sqrt 12)^2, so 4/5 and 1/5. Phi_S has one cause.
    found = analysed().indices
    first = dict(zip(found.outputs, found.first, strict=True))
    # Sampling error of 1024 points, and an interpolant within a few percent.
    np.testing.assert_allclose(first["Phi_F"], [0.8, 0.2, 0.0], atol=0.02)
    np.testing.assert_allclose(first["Phi_S"], [0.0, 1.0, 0.0], atol=0.02)


def test_main_effects_of_known_functions() -> None:
    # The mean over m in [0.5, 1.5] of 1 + 2 f + m is 2 + 2 f; of the other two draws, 256 of them.
    effect = analysed().outputs["Phi_F"].effects["friction"]
    np.testing.assert_allclose(effect.mean, 2.0 + 2.0 * effect.x, atol=0.06)
    np.testing.assert_allclose(effect.high - effect.low, 0.8, atol=0.08)  # 80 % of a uniform width of 1


def test_maps_are_cuts_through_the_best_run() -> None:
    found = analysed()
    assert found.best is not None
    x, y, values = found.map("Phi_F", "friction", "damping")
    m = found.table.points[found.best][1]
    assert values.shape == (LEVELS, LEVELS)
    # Linear functions are interpolated to a fraction of a percent of their range.
    np.testing.assert_allclose(values, np.broadcast_to(1.0 + 2.0 * x + m, values.shape), atol=0.02)
    assert (y[0], y[-1]) == pytest.approx((1e-6, 1e-4))


def test_the_least_of_the_interpolant_is_that_of_the_function() -> None:
    # Phi = (1 + 2 f + m) / 1000 + 1000 ((m - 1)^2 + 0.1): least at f = 0 and 1 + 1e-3 / 2000 for m.
    found = analysed().optimum
    assert found.x[1] == pytest.approx(1.0, abs=0.01)  # an interpolant of 128 runs
    assert found.value == pytest.approx(100.002, abs=1.0)
    said = surface_optimum(analysed())
    assert said["surface_optimum"] == BOX.as_dict(found.x)
    assert said["surface_phi"] == found.value


def test_an_optimum_on_a_face_is_said_and_without_a_surface_the_reason() -> None:
    runs = table()
    tilted = replace(runs, phi_shape=np.full(len(runs.points), np.nan))  # Phi_F = 1 + 2 f + m alone
    found = surface_optimum(analyse_sweep("shot", BOX, tilted))
    assert found["surface_phi_force"] == pytest.approx(1.5, abs=0.05)
    assert {"friction": "lower", "stiffness_factor": "lower"}.items() <= found["surface_at_bound"].items()
    rough = surface_optimum(
        analyse_sweep("shot", BOX, replace(tilted, phi_force=table(rough=True).phi_force))
    )
    assert rough["surface_optimum"] is None
    assert "of their standard deviation" in rough["no_surface"]
    lost = surface_optimum(analyse_sweep("shot", BOX, table(lost=tuple(range(128)))))
    assert lost == {"surface_optimum": None, "no_surface": "no run completed"}


def test_a_rough_misfit_is_refused_with_the_runs_it_would_take() -> None:
    found = analysed(rough=True)
    output = found.outputs["Phi_F"]
    assert output.surrogate is None
    assert output.error > 0.2
    assert "about" in output.refused
    assert "runs would be enough if the misfit is smooth" in output.refused
    assert "Phi_F" not in found.indices.outputs
    with pytest.raises(ValueError, match="has no interpolant"):
        found.map("Phi_F", "friction", "damping")


def test_many_runs_are_tried_on_those_left_out() -> None:
    found = analysed(n=1024)
    assert found.outputs["Phi_S"].surrogate is not None
    assert len(found.outputs["Phi_S"].surrogate.points) == 400
    assert found.outputs["Phi_S"].error < 0.01


def test_runs_that_failed_are_left_out_and_listed() -> None:
    found = analysed(lost=(3, 7))
    assert found.outputs["Phi_F"].surrogate is not None
    assert len(found.outputs["Phi_F"].surrogate.points) == 126
    text = render_sweep(found)
    assert text.count('class="lost"') == 2
    assert "inverted" in text


def test_no_run_completed() -> None:
    found = analysed(lost=tuple(range(128)))
    assert (found.outputs, found.indices, found.best) == ({}, None, None)
    assert "128, 0 completed" in render_sweep(found)


@pytest.mark.parametrize("name", SWEEPS)
def test_figures_can_be_built(name: str) -> None:
    found = along() if name == "sweep-forces" else analysed(lost=(3,))
    assert SWEEPS[name].applies(found)
    figure = build(SWEEPS[name], found)
    assert all(ax.get_title() == "" for ax in figure.axes)
    assert SWEEPS[name].caption(found).endswith(".")


def test_the_page_escapes_what_it_is_given() -> None:
    found = analyse_sweep(EVIL, BOX, table())
    text = render_sweep(found, [EVIL])
    assert "<script" not in text
    assert "&lt;script&gt;" in text
    assert "http" not in text.replace("http-equiv", "")  # nothing is fetched


def test_long_tables_are_cut_and_say_so() -> None:
    text = render_sweep(analysed(n=512, lost=(5,)))
    assert "200 of 512 runs" in text
    assert text.count('<th scope="row">') < 300


def test_a_map_without_variation_has_labels_that_can_be_read() -> None:
    # In the made-up sweep Phi_S does not depend on friction and damping: its map of the two is even.
    figure = build(SWEEPS["sweep-maps"], analysed(n=512))
    labels = [label.get_text() for ax in figure.axes for label in ax.get_yticklabels()]
    assert max(map(len, labels)) <= 10  # a sign, six digits and "10^" of a logarithmic axis; 21 of noise
