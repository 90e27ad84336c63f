"""Profiles, ridge, declared uncertainties and posterior: on disk, in JSON and on the page."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic import synthetic

from kolsky.base.errors import InputError
from kolsky.inverse.result import (
    Declaration,
    Identification,
    PairMap,
    ParameterProfile,
    PosteriorSummary,
    Variation,
)
from kolsky.report.canvas import build
from kolsky.report.figures import REGISTRY
from kolsky.report.pages.identification import render
from kolsky.report.pages.uncertainty import choices
from kolsky.results.display import in_display_units
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.results.tables import to_json

NAMES = ("stiffness_factor", "damping")


def parabola(name: str, centre: float, sigma: float, column: int) -> ParameterProfile:
    """A profile of known shape; with residuals that are correlated its level is four times 3.84."""
    values = centre + sigma * np.linspace(-6.0, 6.0, 25)
    points = np.tile([1.12, 2.5e-5], (25, 1))
    points[:, column] = values
    half = np.sqrt(3.84) * sigma
    return ParameterProfile(
        name=name, values=values, rise=4.0 * ((values - centre) / sigma) ** 2, points=points,
        level=4.0 * 3.84, correlation=4.0, interval=(centre - half, centre + half),
        alone=(centre - 0.5 * half, centre + 0.5 * half), verdict="identified", text=f"{name} is identified",
        error=0.03,
    )  # fmt: skip


def knowing(*, bound: bool = False) -> Identification:
    """A made-up result with all that `kolsky.uncertainty` adds; `bound` opens the interval of damping."""
    result = synthetic(NAMES)
    rng = np.random.default_rng(1)
    profiles = (parabola(NAMES[0], 1.12, 0.002, 0), parabola(NAMES[1], 2.5e-5, 4e-7, 1))
    if bound:
        opened = replace(
            profiles[1],
            interval=(profiles[1].interval[0], np.nan),
            verdict="one-sided bound",
            text="damping is at least 2.4e-05",
        )
        profiles = (profiles[0], opened)
    x, y = profiles[0].values, profiles[1].values
    samples = rng.normal([1.12, 2.5e-5, 0.2, 1e-6], [0.002, 4e-7, 0.02, 1e-7], size=(500, 4))
    low, middle, high = np.percentile(samples, [2.5, 50.0, 97.5], axis=0)
    estimates = {name: replace(e, sigma_systematic=0.5 * e.sigma) for name, e in result.estimates.items()}
    return replace(
        result,
        estimates=estimates,
        profiles=profiles,
        ridge=PairMap(NAMES, x, y, np.add.outer(profiles[1].rise, profiles[0].rise)),
        systematic=(
            Declaration("poisson", 5e-4, "1", {NAMES[0]: -0.002, NAMES[1]: 1e-7}, "varied"),
            Declaration("Z_offset", 5e-6, "m", {NAMES[0]: 3e-4, NAMES[1]: 0.0}, "varied"),
            Declaration("friction", np.nan, "1", {}, "not declared, counted as exact"),
        ),
        posterior=PosteriorSummary(
            names=(*NAMES, "force_discrepancy", "shape_discrepancy"),
            samples=samples,
            median=middle,
            lower=low,
            upper=high,
            converged=True,
            autocorrelation=41.0,
            steps=2500,
            acceptance=0.57,
            power=0.25,
            prior="stiffness_factor: uniform in [0.75, 1.5]",
        ),
    )


@pytest.mark.parametrize("bound", [False, True])
def test_round_trip_is_exact(bound: bool, tmp_path: Path) -> None:
    result = knowing(bound=bound)
    write_identification(tmp_path / "r.h5", result)
    again = read_identification(tmp_path / "r.h5")
    assert again.estimates == result.estimates
    for one, other in zip(again.profiles, result.profiles, strict=True):
        for name, value in vars(other).items():
            np.testing.assert_array_equal(getattr(one, name), value)
    assert again.posterior is not None
    np.testing.assert_array_equal(again.ridge.rise, result.ridge.rise)
    np.testing.assert_array_equal(again.posterior.samples, result.posterior.samples)  # type: ignore[union-attr]
    assert again.posterior.converged is True
    assert [part.shifts for part in again.systematic] == [dict(part.shifts) for part in result.systematic]
    assert np.isnan(again.systematic[2].sigma)


OTHERS = (
    Variation("window_end", 1.2e-3, {NAMES[0]: 0.0012, NAMES[1]: -3e-7}, "searched again on the surrogate"),
    Variation("force_bins", 4e-6, {}, "not searched: the force has no sample inside its bins"),
)


def test_other_choices_are_kept_and_shown(tmp_path: Path) -> None:
    made = replace(knowing(), variations=OTHERS, image_correlation={"sigma_match_px": 0.011})
    write_identification(tmp_path / "r.h5", made)
    again = read_identification(tmp_path / "r.h5")
    assert again.variations == OTHERS
    assert again.image_correlation == {"sigma_match_px": 0.011}
    assert to_json(made)["variations"][0]["shifts"] == OTHERS[0].shifts
    rows = {done: cells for *cells, done in (row.values() for row in choices(in_display_units(again)))}
    row = rows["1.200 ms instead: searched again on the surrogate"]
    assert row[0] == "End of the window"
    assert row[2:] == ["0.00120", "−0.300"]  # damping in microseconds
    assert rows["4 µs instead: not searched: the force has no sample inside its bins"][2:] == ["–", "–"]


def test_a_file_of_the_first_version_is_still_read(tmp_path: Path) -> None:
    path = tmp_path / "r.h5"
    write_identification(path, replace(knowing(), variations=OTHERS))
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 1
        del file["entry/knowledge/variations"]
        del file["entry/image_correlation"]
        for name in NAMES:
            del file[f"entry/estimates/{name}/numerical_parts"]
    again = read_identification(path)
    # Neither its parts nor a correction for the mesh were recorded then.
    known = knowing().estimates.items()
    assert again.estimates == {n: replace(e, numerical_parts={}, mesh_correction=0.0) for n, e in known}
    assert again.variations == ()
    assert again.image_correlation == {}
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 2
    with pytest.raises(InputError, match=r"numerical_parts: missing.*kolsky identify"):
        read_identification(path)


def test_a_damaged_profile_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "r.h5"
    write_identification(path, knowing())
    with h5py.File(path, "a") as file:
        place = file["entry/knowledge/profiles/0"]
        del place["rise"]
        place["rise"] = np.zeros(7)  # not as many as there are values
    with pytest.raises(InputError, match=r"profiles/0/(rise|points).*expected"):
        read_identification(path)


def test_json_has_open_ends_as_null() -> None:
    said = json.loads(json.dumps(to_json(knowing(bound=True)), allow_nan=False))
    assert said["profiles"]["damping"]["interval"][1] is None
    assert said["profiles"]["damping"]["verdict"] == "one-sided bound"
    assert said["systematic"]["friction"] == {
        "sigma": None,
        "unit": "1",
        "shifts": {},
        "status": "not declared, counted as exact",
    }
    assert "samples" not in said["posterior"]
    assert said["stiffness_factor"]["sigma_systematic"] > 0.0


def test_combined_uncertainty_holds_the_declared_part() -> None:
    e = knowing().estimates["stiffness_factor"]
    # 0.5 of the root sum of squares of the other two, in quadrature with them: sqrt(1.25) times it.
    assert e.sigma == pytest.approx(np.sqrt(1.25) * np.hypot(0.0019, 0.0016), rel=1e-12)


@pytest.mark.parametrize("name", ["likelihood", "ridge", "corner"])
@pytest.mark.parametrize("bound", [False, True])
def test_figures_have_labels_with_units(name: str, bound: bool) -> None:
    result = knowing(bound=bound)
    assert REGISTRY[name].applies(result)
    assert not REGISTRY[name].applies(synthetic(NAMES))
    figure = build(REGISTRY[name], result)
    labels = [axis.get_label_text() for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)]
    assert any("µs" in label for label in labels)  # damping is shown in microseconds
    assert all(label.endswith(")") for label in labels if label)


def test_figure_of_the_profile_reaches_its_threshold_at_the_interval() -> None:
    """The drawn curve crosses 3.84 where the interval ends, in shown units."""
    figure = build(REGISTRY["likelihood"], knowing())
    ax = figure.axes[1]
    curve = max(ax.get_lines(), key=lambda line: len(np.atleast_1d(line.get_xdata())))
    x, y = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
    inside = x[y <= 3.84]
    # 2001 points over 12 sigma: the crossing is found to 0.006 sigma = 0.0024 us.
    assert inside[0] == pytest.approx(25.0 - np.sqrt(3.84) * 0.4, abs=0.005)
    assert inside[-1] == pytest.approx(25.0 + np.sqrt(3.84) * 0.4, abs=0.005)


def test_page_says_verdicts_and_what_was_not_declared() -> None:
    page = render(knowing(bound=True))
    assert "Likelihood, posterior and declared uncertainties" in page
    assert "one-sided bound" in page
    assert "open</td>" in page
    assert "not declared, counted as exact" in page
    assert "Declared uncertainties of the inputs" in page
    assert "Likelihood, posterior and declared uncertainties" not in render(synthetic(NAMES))


def test_shown_units_reach_every_field() -> None:
    shown = in_display_units(knowing())
    assert shown.profiles[1].interval[0] == pytest.approx(1e6 * knowing().profiles[1].interval[0])
    assert shown.profiles[0].points[0, 1] == pytest.approx(25.0)
    assert shown.ridge.y.mean() == pytest.approx(25.0)
    assert shown.posterior.median[3] == pytest.approx(1.0, rel=0.05)  # the outline's discrepancy, in um
    assert shown.systematic[0].shifts["damping"] == pytest.approx(0.1)
