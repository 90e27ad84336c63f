"""The scan of Poisson's ratio against closed forms: its steps, its candidates, and the likely one."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.base.records import MaterialCurve
from kolsky.inverse.objective import Prior
from kolsky.inverse.observations import Prediction
from kolsky.inverse.path_noise import PATTERNS, FrontPath
from kolsky.inverse.runner import Runner
from kolsky.inverse.valleys import (
    MOST_LEVELS,
    PHASE,
    deviance_with_path_noise,
    equal_steps,
    likeliest_floor,
    likely_valleys,
    local_minima,
    margin,
    oscillations,
    small_strain_modulus,
)
from tests.unit.inverse.test_likely_path import Onset, off_by
from tests.unit.inverse.test_objective import NOISE_FORCE, objective


def test_modulus_is_the_slope_through_the_origin_at_small_strains() -> None:
    stretch = np.array([0.7, 0.96, 0.98, 1.0, 1.02, 1.04, 1.3])
    stress = 3e4 * (stretch - 1.0)
    stress[[0, -1]] = [-9e9, 9e9]  # beyond 5 %
    curve = MaterialCurve(stretch, stress, np.ones(7))
    assert small_strain_modulus(curve) == pytest.approx(3e4)
    # Where no point is so near, the three nearest serve: least squares through the origin by hand.
    wide = MaterialCurve(np.array([1.0, 1.1, 1.2, 1.4]), np.array([0.0, 1.0, 3.0, 4.0]), np.ones(4))
    assert small_strain_modulus(wide) == pytest.approx((0.1 + 0.6 + 1.6) / (0.01 + 0.04 + 0.16))


def test_number_of_oscillations_by_hand() -> None:
    # G = 1, nu = 0.25: K = 2 * 1.25 / (3 * 0.5) = 5/3 and c^2 = (5/3 + 4/3) / 3 = 1; T / 2 L = 8.
    found = oscillations(np.array([0.25]), modulus=3.0, density=3.0, length=0.5, window=8.0)
    assert found == pytest.approx([8.0])


def test_steps_are_equal_in_phase_and_reach_both_ends() -> None:
    values = np.linspace(0.49, 0.4999, 4000)
    number = 0.5 / np.sqrt(1.0 - 2.0 * values)
    levels = equal_steps(values, number)
    at = 0.5 / np.sqrt(1.0 - 2.0 * levels)
    assert levels[[0, -1]] == pytest.approx([0.49, 0.4999], abs=1e-15)
    # 3.54 to 35.36 oscillations: 31.82 / 0.4 = 79.6, so 80 steps. Interpolation in the table: 1 %.
    assert len(levels) == 81
    np.testing.assert_allclose(np.diff(at), np.diff(at).mean(), rtol=0.01)
    assert np.diff(at).mean() <= PHASE
    assert len(equal_steps(values, 100.0 * number)) == MOST_LEVELS


def test_local_minima_are_below_both_neighbours() -> None:
    assert local_minima(np.array([3.0, 5.0, 1.0, 4.0, 2.0])) == [2, 4, 0]
    assert local_minima(np.array([np.nan, 5.0, 6.0])) == [1]
    assert local_minima(np.array([2.0, 2.0, 3.0])) == [0]


def test_a_frame_counts_once_where_valleys_are_compared() -> None:
    """The outline of many points prefers one run, the force another: both are searched, the force's first."""
    one = objective(np.zeros(40), np.zeros(400), points_per_frame=10)
    force = np.array([9.0, 3.0, 9.0, 8.0, 9.0])  # rms over its noise
    shape = np.array([9.0, 7.0, 9.0, 5.0, 9.0])
    wave = np.concatenate([NOISE_FORCE * (-1.0) ** np.arange(40), 2e-6 * (-1.0) ** np.arange(400)])
    vectors = np.array([wave * np.repeat([f, s], [40, 400]) for f, s in zip(force, shape, strict=True)])
    # n ln(mean square): 80 ln(8/3) = 78 for run 1 against 800 ln(7/5) = 269 for run 3; a tenth of it is 27.
    joint, balanced = one.deviance(vectors), one.balanced_deviance(vectors)
    assert joint[1] - joint[3] == pytest.approx(800.0 * np.log(7.0 / 5.0) - 80.0 * np.log(8.0 / 3.0))
    assert balanced[1] - balanced[3] == pytest.approx(80.0 * np.log(7.0 / 5.0) - 80.0 * np.log(8.0 / 3.0))
    assert likely_valleys(one, vectors, np.arange(5.0)) == [1, 3]
    assert balanced[1] < balanced[3]


def test_the_valley_nearest_to_the_declared_value_is_searched_too() -> None:
    one = objective(np.zeros(40), np.empty(0))
    depth = np.array([9.0, 1.0, 9.0, 2.0, 9.0, 3.0, 9.0, 4.0, 9.0, 5.0, 9.0])
    vectors = NOISE_FORCE * depth[:, None] * np.ones((1, 40))
    nearest = np.abs(np.arange(11.0) - 9.0)
    assert likely_valleys(one, vectors, nearest) == [1, 3, 5, 9]


def test_how_many_valleys_of_each_misfit_are_searched() -> None:
    """Five valleys of each misfit, none in common: three of a frame as one entry, one of the
    force, and the floor of the former that is nearest to the declared value."""
    rows = {"balanced": [1, 7, 13, 19, 25], "force": [3, 9, 15, 21, 27]}
    misfit = {name: np.full(31, 9.0) for name in rows}
    for name, floors in rows.items():
        misfit[name][floors] = np.arange(5.0)
    one: Any = SimpleNamespace(
        balanced_deviance=lambda vectors: misfit["balanced"], deviance=lambda vectors, part: misfit[part]
    )
    # The force's floor 27 is nearer, but none of those that the declared value may choose.
    found = likely_valleys(one, np.zeros((31, 1)), np.abs(np.arange(31.0) - 26.4))
    assert found == [1, 7, 13, 3, 25]


def test_patterns_enough_for_an_onset() -> None:
    """A residual of 12 independent patterns that the flyer's noise brings, and one as large that it does not.

    Each pattern that is known lowers the first residual's deviance and not the second's."""
    n, patterns = 40, 12
    basis = 6.0 * np.linalg.qr(np.random.default_rng(5).standard_normal((n, n)))[0].T
    brought, other = basis[:patterns].sum(axis=0), basis[patterns : 2 * patterns].sum(axis=0)

    class Begun(Ringing):
        def under_other_motions(self, n: int) -> list[Prediction | None]:
            moved = np.vstack([np.zeros((1, 40)), basis[: min(n, patterns)]])
            empty = np.empty((len(moved), 0))
            seen = [Prediction(empty, own + moved, empty, empty.astype(bool)) for own in (brought, other)]
            return list(seen)

    made: Any = Begun()
    found = deviance_with_path_noise(
        made, np.zeros((2, 1)), made.under_other_motions(PATTERNS), np.empty(0, dtype=bool)
    )
    assert found[1] - found[0] > 105.0


class Ringing:
    """Two points: one has rung as the flyer's noise lets it, the other is off by as much otherwise."""

    objective = Runner.objective

    def __init__(self, prior: Prior | None = None) -> None:
        observations = objective(np.zeros(40), np.empty(0)).observations
        self.problem, self.front = SimpleNamespace(observations=observations, prior=prior), FrontPath(None)  # type: ignore[arg-type]

    def under_other_motions(self, n: int) -> list[Prediction | None]:
        t = np.linspace(0.0, 1.0, 40)
        wave, other = 3.0 * np.sin(40.0 * t), 3.0 * np.cos(23.0 * t)
        found: list[Prediction | None] = []
        for own in (wave, other):
            forces = own + np.array([[0.0], [1.0]]) * wave
            empty = np.empty((2, 0))
            found.append(Prediction(empty, forces, empty, empty.astype(bool)))
        return [*found, None]


def test_what_the_motions_noise_explains_does_not_speak_against_a_valley() -> None:
    made: Any = Ringing()
    points, inside = np.zeros((3, 1)), np.empty(0, dtype=bool)
    found = deviance_with_path_noise(made, points, made.under_other_motions(PATTERNS), inside)
    assert found[0] < found[1] - 50.0
    assert found[2] == np.inf
    # By its own residual alone the second is no worse: both have nearly the same mean square.
    plain = replace(objective(np.zeros(40), np.empty(0)))
    vectors = np.stack([p.force_bins[0] for p in made.under_other_motions(1)[:2]])
    assert abs(np.subtract(*plain.deviance(vectors))) < 5.0


def test_the_prior_counts_where_valleys_are_compared() -> None:
    points, inside = np.array([[0.0], [0.0], [0.0]]), np.empty(0, dtype=bool)
    first: Any = Ringing()
    runs = first.under_other_motions(PATTERNS)
    known: Any = Ringing(Prior(np.array([6.0]), np.array([2.0])))
    with_prior, without = (deviance_with_path_noise(one, points, runs, inside)[:2] for one in (known, first))
    np.testing.assert_allclose(with_prior - without, 9.0)


def test_the_margin_is_of_the_next_valley() -> None:
    """The likeliest floor, one of the same valley, and two of others: 2 oscillations are still its own."""
    assert margin(np.array([-100.0, -95.0, -60.0, -75.0]), np.array([0.0, 2.0, 5.0, 2.01])) == 25.0
    assert margin(np.array([-100.0, -95.0]), np.array([0.0, 1.0])) == np.inf


def test_the_likeliest_floor_and_its_margin() -> None:
    made: Any = Onset(np.array([2.0, -1.5]))
    floors = np.array([off_by(share).x for share in (-3.5, 0.1, 4.0)])
    numerics, inside = made.settings.numerics, np.empty(0, dtype=bool)
    found = likeliest_floor(made, floors, numerics, inside)
    np.testing.assert_array_equal(found.x, floors[1])
    runs = made.under_other_motions(floors, made.front_jerks, numerics)
    values = deviance_with_path_noise(made, floors, runs, inside)
    assert found.margin == pytest.approx(min(values[0], values[2]) - values[1])
    # The patterns are those of the floor: they ring at the frequency there.
    rings = made.rings(found.x)
    left = found.patterns - found.patterns @ np.linalg.pinv(rings) @ rings
    assert np.abs(left).max() < 1e-9 * np.abs(found.patterns).max()
