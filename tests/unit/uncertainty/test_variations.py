"""Other windows and bins, sensitivities in texts, and budgets of routes."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.identification import identify
from kolsky.inverse.coarse_search import search
from kolsky.inverse.estimates import RouteOptimum
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction, observe
from kolsky.inverse.result import Declaration
from kolsky.inverse.settings import Numerics, Settings
from kolsky.results.printed import printed_sensitivities, signed_percent
from kolsky.shot.load import load_shot
from kolsky.uncertainty.analyse import FORCE_BINS, SEARCHED, WINDOW_END, _halves, shorter_window, wider_bins
from kolsky.uncertainty.budgets import InputChanges, Sources, budgeted, noise_parts, route_difference
from kolsky.uncertainty.declarations import (
    UNDECLARED,
    amount_text,
    caution,
    elasticity,
    invisible_inputs,
    relative_moves,
)
from kolsky.uncertainty.mesh_error import MeshChange

# Other windows and bins of the same data: the remaining data, and the result of a whole identification.

ROOT = Path(__file__).parents[3]
BOX = Box(names=("stiffness_factor",), lower=(0.5,), upper=(1.5,))
WINDOW = (0.0, 1e-3)
SAMPLES = np.linspace(*WINDOW, 1001)
FRAMES = np.linspace(0.05e-3, 0.95e-3, 19)


def force(m: float, time: FloatArray) -> FloatArray:
    """A force that a factor of 1 fits until 0.85 ms, and one of 1.1 afterwards."""
    return m * 1e5 * time * np.where(time <= 0.85e-3, 1.0, 1.0 / 1.1)


def made() -> tuple[Objective, FloatArray]:
    """An objective over 21 bins and 19 points, every fourth not counted; the slope of its linear model."""
    line = CentreLine(
        time=FRAMES, frame=np.arange(19), y=np.full(19, 1e-3), Z=1.0 + 100.0 * FRAMES, sigma=np.full(19, 0.1)
    )
    history = ForceHistory(time=SAMPLES, force=1e5 * SAMPLES, sigma=np.full(SAMPLES.size, 0.5))
    seen = observe(history, line, window=WINDOW, bin_width=1e-3 / 21)
    objective = Objective(seen, np.arange(19) % 4 != 0)
    return objective, np.concatenate([force(1.0, seen.bins.centres), np.zeros(int(objective.counted.sum()))])


def model(points: FloatArray) -> FloatArray:
    """The force answers m linearly, the outline not at all."""
    objective, slope = made()
    level = np.concatenate([np.zeros(objective.n_force), objective.data[objective.n_force :]])
    return level + np.atleast_2d(points) * slope


def test_a_shorter_window_is_that_window() -> None:
    objective, _ = made()
    cut, predict = shorter_window(objective, model, 0.8e-3)
    assert cut.times.max() <= 0.8e-3
    whole = objective.times <= 0.8e-3  # a bin that the end cuts is left out: its centre may be inside
    assert whole.sum() - len(cut.data) in (0, 1)
    assert cut.data.size == cut.noise.size == predict(np.array([1.2])).shape[1]
    np.testing.assert_array_equal(np.unique(cut.observations.centre_line.time), FRAMES[FRAMES <= 0.8e-3])
    # What of the model lies before the kink fits exactly; the last 15 % pull the optimum of the whole up.
    assert search(BOX, cut, predict).x[0] == pytest.approx(1.0, abs=1e-5)  # tolerance of the search
    assert search(BOX, objective, model).x[0] > 1.02


@pytest.mark.parametrize(("end", "words"), [(0.1e-3, "2 bins of the force"), (-1.0, "0 bins")])
def test_a_window_that_is_too_short(end: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        shorter_window(made()[0], model, end)


def test_wider_bins_are_the_means_that_the_samples_have() -> None:
    objective, _ = made()
    wide, predict = wider_bins(objective, model)
    bins = wide.observations.bins
    assert bins.mean.size == 11  # ten pairs and the odd one
    for k, mean in enumerate(bins.mean):
        low, high = bins.edges[k : k + 2]
        inside = (low <= SAMPLES) & (high >= SAMPLES)
        t, F = SAMPLES[inside], objective.observations.force.force[inside]
        assert mean == pytest.approx(np.trapezoid(F, t) / np.ptp(t), rel=1e-12)  # round-off
        assert bins.n[k] == inside.sum()
        # n equal samples: sigma / sqrt(n), where the ends of the trapezoid count half: to 1 in n.
        assert bins.sigma[k] == pytest.approx(0.5 / np.sqrt(inside.sum() - 1), rel=1.5 / inside.sum())
    data = wide.data
    exact = model(np.array([1.0]))
    exact[0, : objective.n_force] = objective.observations.bins.mean
    merged = wider_bins(objective, lambda x: exact)[1](np.array([1.0]))[0]
    np.testing.assert_allclose(merged, data, rtol=1e-12)  # data and model are merged alike
    assert predict(np.array([1.0])).shape == (1, data.size)


def test_halves_have_the_mean_of_their_bin() -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5, 1.5, 61))
    edge = np.array([0, 12, 20, 40, 60])
    halves = np.array([0, 6, 12, 16, 20, 30, 40, 50, 60])
    F = np.stack([3.0 + 0.2 * time, np.sin(time)])
    exact = np.stack([3.0 + 0.1 * (time[edge[1:]] + time[edge[:-1]]), rng.normal(size=4)])
    empty = np.empty((2, 0))
    made = Prediction(force=F, force_bins=exact, Z=empty, inside=empty.astype(bool))
    found = _halves(made, time, edge, halves)
    h = np.diff(time[halves])
    again = (h * found).reshape(2, 4, 2).sum(axis=2) / h.reshape(4, 2).sum(axis=1)
    np.testing.assert_allclose(again, exact, rtol=1e-12)
    line = 3.0 + 0.1 * (time[halves[1:]] + time[halves[:-1]])  # a straight line's means are its middles'
    np.testing.assert_allclose(found[0], line, rtol=1e-12)


@pytest.mark.slow
def test_the_shift_is_that_of_an_identification_with_the_other_window() -> None:
    """The same shot with its window declared shorter, identified from scratch."""
    shot = load_shot(ROOT / "runs" / "open-01")
    settings = Settings(
        free={"stiffness_factor": None}, numerics=Numerics(mesh=(16, 22)), refined_mesh=(24, 32), replicates=0
    )
    # (On 12 x 16 elements, half as fine as the answer's, the ringing in the shorter window is not the refined
    # mesh's, and the surrogate's shift is too small by three times what the residuals leave open.)
    found = identify(shot, settings)
    told = {(v.key, round(1e6 * v.value)): v for v in found.variations}
    assert [key for key, _ in told] == [WINDOW_END, WINDOW_END, FORCE_BINS, FORCE_BINS]
    assert {v.status for v in told.values()} == {SEARCHED}
    first, last = shot.window
    end = first + 0.8 * (last - first)
    other = identify(replace(shot, window=(first, end)), settings)
    m, n = (answer.estimates["stiffness_factor"] for answer in (found, other))
    shift = told[WINDOW_END, round(1e6 * end)].shifts["stiffness_factor"]
    # Another design about another optimum, and steps on a mesh half as fine as the answer's on the way to
    # it: the two agree within what the residuals alone leave open.
    # Both on the mesh they were searched on. Each answer is then corrected for that mesh's error: how fine
    # the mesh is is no choice of a window.
    assert shift == pytest.approx(n.on_mesh - m.on_mesh, abs=m.noise_parts["force and shape"])
    assert shift > 0.6 * m.noise_parts["force and shape"]  # and there is something to foretell


# Sensitivities in texts and shares: amounts, the largest undeclared input, inputs without a residual.

ANSWER = {"stiffness_factor": 1.2, "damping": 0.0}


def part(key: str, amount: float, move: float, unit: str = "1", **more: Any) -> Declaration:
    made = Declaration(
        key, float("nan"), unit, {}, UNDECLARED, amount, {"stiffness_factor": move, "damping": 1e-7}, 0.5
    )
    return replace(made, **more)


LENGTH = part("specimen_length", 0.01, 0.024)
CLOCK = part("clock_offset", 1e-6, -0.036, "s")


def test_an_amount_has_its_unit() -> None:
    parts = (LENGTH, CLOCK, part("Z_offset", 1e-5, 0.0, "m"), part("poisson", 1e-5, 0.0))
    assert [amount_text(one) for one in parts] == ["1 %", "1 us", "10 um", "1e-05"]


def test_shares_are_of_the_answer_and_of_the_amount() -> None:
    # 0.024 of 1.2 is 2 %; d ln m / d ln length is 2 % over 1 %. A parameter at zero has no share.
    assert relative_moves(LENGTH, ANSWER) == pytest.approx({"stiffness_factor": 0.02})
    assert elasticity(LENGTH, ANSWER) == pytest.approx({"stiffness_factor": 2.0})
    assert elasticity(CLOCK, ANSWER) == {}
    assert signed_percent(0.0123) == "+1.2 %"


def test_rows_of_a_terminal_say_what_is_exact_and_what_leaves_no_residual() -> None:
    curve = part("curve_scale", 0.01, -0.012, visible=0.0009)
    estimates = {name: SimpleNamespace(value=value) for name, value in ANSWER.items()}
    declared = replace(CLOCK, status="varied")
    result: Any = SimpleNamespace(estimates=estimates, systematic=(LENGTH, curve, declared))
    assert printed_sensitivities(result, {"stiffness_factor": "m", "damping": "beta"}) == {
        "per 1 % of specimen_length": "m +2 % (taken as exact)",
        "per 1 % of curve_scale": "m -1 % (leaves no residual, taken as exact)",
        "per 1 us of clock_offset": "m -3 %",
    }


def test_the_caution_names_the_largest_that_is_undeclared() -> None:
    (said,) = caution((LENGTH, CLOCK), ANSWER)
    assert "[force] clock_offset" in said
    assert "1 us of it would change stiffness_factor by -3 %" in said
    assert "and so is one more" in said
    declared = replace(CLOCK, status="varied", sigma=1e-6)
    (said,) = caution((LENGTH, declared), ANSWER)
    assert "1 % of it would change stiffness_factor by +2 %; declare specimen_length" in said
    assert list(caution((declared,), ANSWER)) == []
    assert list(caution((), ANSWER)) == []


def test_what_leaves_no_residual_is_said_once() -> None:
    curve = part("curve_scale", 0.01, -0.012, visible=0.0009)
    density = part("specimen_density", 0.01, 0.012, visible=0.0011, alike=("sensitivity",))
    force = part("sensitivity", 0.01, 0.0, alike=("specimen_density",))
    first, second = invisible_inputs((curve, density, force))
    assert "the data show only m times the curve" in first
    assert "does not change the motion: a wrong specimen_density acts as a force gain" in second
    assert list(invisible_inputs((replace(curve, visible=float("nan")),))) == []


# Budgets of routes and of their difference on a linear problem whose covariance is known.

RNG = np.random.default_rng(4)
N, K = 12, 30  # entries of the force, and of all the data
JACOBIAN = np.column_stack([np.linspace(1.0, 3.0, K), np.cos(0.7 * np.arange(K))])
SIGMA = np.where(np.arange(K) < N, 0.2, 0.5)
FLYER = RNG.normal(size=(40, K)) @ (0.3 * RNG.normal(size=(K, K)))
"""Changes by forty replicates; their mean square is the covariance that is true here."""
NAMES = ("stiffness_factor", "damping")


def gain(part: str) -> np.ndarray:
    """Least squares on a part of the data, as a map of all of them."""
    weight = SIGMA**-2 * {"joint": 1.0, "force": np.arange(K) < N, "shape": np.arange(K) >= N}[part]
    return np.linalg.solve((JACOBIAN.T * weight) @ JACOBIAN, JACOBIAN.T * weight)


def optimum(part: str, x: tuple[float, float]) -> RouteOptimum:
    G = gain(part)
    names = {"joint": "joint", "force": "force only", "shape": "shape only"}
    return RouteOptimum(names[part], part, np.array(x), 1.0, G, (G * SIGMA**2) @ G.T)


def sources(mesh: np.ndarray | None = None) -> Sources:
    coarser = np.zeros(K) if mesh is None else mesh
    return Sources(InputChanges({"flyer motion": FLYER}, {}), MeshChange(coarser, np.zeros(K), 2.0))


def drawn(n: int) -> np.ndarray:
    """Data of which the noise and the flyer's part are drawn from what is true."""
    rng = np.random.default_rng(9)
    flyer = rng.normal(size=(n, len(FLYER))) @ FLYER / np.sqrt(len(FLYER))
    return SIGMA * rng.normal(size=(n, K)) + flyer


def test_the_budget_of_a_route_is_what_draws_scatter_by() -> None:
    n = 20_000
    for part in ("joint", "force", "shape"):
        said = budgeted(NAMES, optimum(part, (1.0, 2.0)), sources())
        scatter = (drawn(n) @ gain(part).T).std(axis=0)
        # A standard deviation of n draws is known to 1 / sqrt(2 n) of itself; four times that.
        np.testing.assert_allclose(list(said.sigma.values()), scatter, rtol=4.0 / np.sqrt(2.0 * n))
        flyer = next(part.sigma for part in said.budget if part.source == "flyer motion")
        covariance = gain(part) @ (FLYER.T @ FLYER / len(FLYER)) @ gain(part).T
        np.testing.assert_allclose(list(flyer.values()), np.sqrt(np.diag(covariance)), rtol=1e-12)


def test_the_difference_has_a_budget_of_its_own() -> None:
    n = 20_000
    force, shape = optimum("force", (1.5, 2.0)), optimum("shape", (1.0, 2.25))
    found = route_difference(NAMES, [optimum("joint", (1.2, 2.1)), force, shape], sources())
    assert found.values == {"stiffness_factor": 0.5, "damping": -0.25}
    scatter = (drawn(n) @ (gain("force") - gain("shape")).T).std(axis=0)
    np.testing.assert_allclose(list(found.sigma.values()), scatter, rtol=4.0 / np.sqrt(2.0 * n))
    # Not the sum of the two routes' own: the flyer moves both.
    apart = [budgeted(NAMES, one, sources()).sigma["stiffness_factor"] for one in (force, shape)]
    assert abs(found.sigma["stiffness_factor"] / np.hypot(*apart) - 1.0) > 0.02


def test_what_moves_both_alike_is_no_part_of_their_difference() -> None:
    # A change of the data like that of a parameter moves every least-squares answer by the same.
    alike = Sources(
        InputChanges(
            {"flyer motion": np.outer([0.3, -0.3], JACOBIAN[:, 0])}, {"force scale": JACOBIAN[:, 1]}
        ),
        MeshChange(0.1 * JACOBIAN[:, 0], JACOBIAN[:, 1], 2.0),
    )
    pair = [optimum("force", (1.0, 2.0)), optimum("shape", (1.0, 2.0))]
    found = route_difference(NAMES, pair, alike)
    assert found.values == pytest.approx({"stiffness_factor": 0.0, "damping": 0.0}, abs=1e-12)
    own = np.sqrt(np.diag(pair[0].residual + pair[1].residual))
    np.testing.assert_allclose(list(found.sigma.values()), own, rtol=1e-12)
    # Each alone has it all: 0.3 of the flyer, and of the mesh what an order of 2.1 corrects more than 3.2.
    parts = {part.source: part.sigma for part in budgeted(NAMES, pair[0], alike).budget}
    assert parts["flyer motion"]["stiffness_factor"] == pytest.approx(0.3)
    assert parts["force scale"]["damping"] == pytest.approx(1.0)
    assert parts["mesh"]["stiffness_factor"] == pytest.approx(0.1 / (2.0**2.1 - 1.0) - 0.1 / (2.0**3.2 - 1.0))


FORCE_ROW = JACOBIAN[:, 0] * (np.arange(K) < N)


@pytest.mark.parametrize(
    ("field", "rows", "source", "each", "between"),
    [
        ("declared", np.sqrt(2.0) * np.stack([FORCE_ROW, 2.0 * JACOBIAN[:, 1]]), "declared inputs",
         ((1.0, 2.0), (0.0, 2.0)), (1.0, 0.0)),
        # Two runs that deviate like a parameter, one in the force alone: 0.3 and 0.4 move the joint optimum
        # and the route of the force, 0.4 alone that of the outline, and 0.3 their difference.
        ("deviations", np.stack([0.3 * FORCE_ROW, 0.4 * JACOBIAN[:, 0]]), "roughness",
         ((0.5, 0.0), (0.4, 0.0)), (0.3, 0.0)),
    ],
)  # fmt: skip
def test_what_is_given_in_rows_counts_as_each_map_makes_of_it(
    field: str,
    rows: np.ndarray,
    source: str,
    each: tuple[tuple[float, float], ...],
    between: tuple[float, float],
) -> None:
    given = replace(sources(), **{field: rows})
    pair = [optimum("force", (1.0, 2.0)), optimum("shape", (1.0, 2.0))]
    parts = [budgeted(NAMES, one, given).budget for one in pair] + [
        route_difference(NAMES, pair, given).budget
    ]
    for part, wanted in zip(parts, (*each, between), strict=True):
        (found,) = (one.sigma for one in part if one.source == source)
        assert found == pytest.approx(dict(zip(NAMES, wanted, strict=True)), abs=1e-12)
    assert sources().roughness(gain("joint")) is None


def test_a_route_is_corrected_by_its_own_map() -> None:
    mesh = np.where(np.arange(K) < N, 0.2, 0.0)  # of the force alone
    for part in ("force", "shape"):
        said = budgeted(NAMES, optimum(part, (1.0, 2.0)), sources(mesh))
        move = gain(part) @ mesh / (2.0**3.2 - 1.0)
        np.testing.assert_allclose(list(said.correction.values()), move, atol=1e-15)
        np.testing.assert_allclose(list(said.parameters.values()), move + np.array([1.0, 2.0]), rtol=1e-12)
        assert said.on_mesh("stiffness_factor") == pytest.approx(1.0, rel=1e-12)
    pair = [optimum("force", (1.0, 2.0)), optimum("shape", (1.0, 2.0))]
    found = route_difference(NAMES, pair, sources(mesh))
    assert found is not None
    move = gain("force") @ mesh / (2.0**3.2 - 1.0)  # the outline has none
    np.testing.assert_allclose(list(found.values.values()), move, rtol=1e-12)


def test_without_an_outline_there_is_no_difference() -> None:
    assert route_difference(NAMES, [optimum("force", (1.0, 2.0))], sources()) is None


def test_the_answer_counts_residuals_replicates_and_scales() -> None:
    objective = SimpleNamespace(
        gain=lambda slope: np.linalg.pinv(slope),
        residual_covariance=lambda slope, vector: np.diag([4.0, 9.0]),
    )
    fine = SimpleNamespace(
        objective=objective, jacobian=JACOBIAN, x=np.zeros(2), model=lambda x: np.zeros((1, K))
    )
    changes = InputChanges({"flyer motion": JACOBIAN[:, :1].T}, {"force scale": JACOBIAN[:, 0]})
    found = noise_parts(fine, Sources(changes, MeshChange(np.zeros(K), None, 2.0)))  # type: ignore[arg-type]
    np.testing.assert_allclose(found["force and shape"], [2.0, 3.0])
    np.testing.assert_allclose(found["flyer motion"], [1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found["force scale"], [1.0, 0.0], atol=1e-12)
