"""The incompressible limit on linear models: when it is used, and when the data distinguish it."""

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from kolsky.base.apparatus import INCOMPRESSIBLE
from kolsky.inverse import incompressible
from kolsky.inverse.incompressible import LEAST_POISSON, RISE, is_at_limit, limit_of, profiled_rise
from kolsky.shot.load import load_shot
from populations.incompressible_shots import counts, line

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


def test_the_rise_is_what_other_parameters_do_not_follow() -> None:
    rng = np.random.default_rng(2)
    slopes, first, u = rng.standard_normal((2, 30)), rng.standard_normal(30), rng.standard_normal(30)
    kappa = np.array([0.0, 0.5, 2.0])
    # Square of a sum less its projection on the slopes: r and u without it, (r + k u)^2 - r^2.
    q, _ = np.linalg.qr(slopes.T)
    bare, across = first - q @ (q.T @ first), u - q @ (q.T @ u)
    expected = 2.0 * kappa * (bare @ across) + kappa**2 * (across @ across)
    found = profiled_rise(first + kappa[:, None] * u, slopes)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_the_least_ratio_that_is_not_rejected() -> None:
    kappa = np.geomspace(4e-5, 2e-2, 24)
    # A rise of 2.71 x 4 (kappa / 0.003)^2: the limit of nu is (1 - 0.003) / 2, but for two levels' chord.
    found = limit_of(INCOMPRESSIBLE, kappa, RISE * (kappa**2 - kappa[0] ** 2) / 0.003**2)
    assert found.least == pytest.approx(0.4985, abs=2e-6)
    assert (
        found.sentence
        == "nu is held at 0.49998: nu >= 0.49850 at 95 %, not distinguished from incompressible"
    )
    # A second valley that the data allow counts, whatever lies between.
    rise = RISE * kappa / 0.001
    rise[15] = 1.0
    assert 0.5 * (1.0 - kappa[16]) < limit_of(0.49998, kappa, rise).least < 0.5 * (1.0 - kappa[15])
    anything = limit_of(0.49998, kappa, 0.0 * kappa)
    assert anything.least == LEAST_POISSON
    assert "the data do not constrain it between 0.49 and that" in anything.sentence


def test_a_ratio_that_the_data_prefer_is_named() -> None:
    kappa = np.geomspace(4e-5, 2e-2, 24)
    rise = np.zeros(24)
    rise[12] = -1.01 * RISE
    found = limit_of(0.49998, kappa, rise)
    assert found.preferred == pytest.approx(0.5 * (1.0 - kappa[12]))
    assert f"the data prefer nu = {found.preferred:.5f}" in found.sentence
    assert limit_of(0.49998, kappa, 0.98 * rise).preferred is None


class Linear:
    """Data 1 + t m + 1e4 t^2 (1 - 2 nu), noise 0.1, with the weights of that noise alone."""

    t = np.linspace(-1.0, 1.0, 40)

    def __init__(self, kappa: float) -> None:
        self.data = self.of(1.1, kappa)

    def of(self, m: float, kappa: float) -> np.ndarray:
        return 1.0 + self.t * m + 1e4 * self.t**2 * kappa

    def vectors(self, prediction: Any) -> np.ndarray:
        return np.array([self.of(m, 1.0 - 2.0 * nu) for m, nu in prediction.points])

    def with_discrepancy(self, vector: np.ndarray) -> "Linear":
        return self

    prior = None

    def gain(self, slopes: np.ndarray) -> np.ndarray:
        return np.linalg.pinv(slopes)

    def balanced_deviance(self, vectors: np.ndarray) -> np.ndarray:
        return (((vectors - self.data) / 0.1) ** 2).sum(axis=1)


def at_limit(monkeypatch: pytest.MonkeyPatch, true: float, x: list[float], **uncertainty: float) -> bool:
    box = Box.of({"stiffness_factor": (0.5, 2.5), "poisson": (0.49, 0.4999)})
    lines = Linear(1.0 - 2.0 * true)

    def run(points: Any, numerics: Any) -> Any:
        return SimpleNamespace(completed=np.ones(len(points), bool), points=points)

    problem = SimpleNamespace(
        box=box,
        shot=SimpleNamespace(uncertainty=uncertainty),
        numerics=None,
        observations=None,
        point=lambda points: points,
    )
    runner: Any = SimpleNamespace(
        problem=problem, forward=SimpleNamespace(run=run), objective=lambda counted: lines
    )
    seen = SimpleNamespace
    monkeypatch.setattr(
        incompressible, "predict", lambda r, _: seen(points=r.points, inside=np.ones((len(r.points), 3)))
    )
    monkeypatch.setattr(incompressible, "replace", lambda objective, prior: objective)
    return is_at_limit(runner, np.array(x))


def test_the_limit_is_taken_where_the_data_do_not_reject_it(monkeypatch: pytest.MonkeyPatch) -> None:
    # Data at the limit, a search that ended at 0.49985 with a stiffness that makes up for nothing.
    assert at_limit(monkeypatch, INCOMPRESSIBLE, [1.1, 0.49985])
    # m is off by 0.3 at the limit's run: it follows there.
    assert at_limit(monkeypatch, INCOMPRESSIBLE, [1.4, 0.49985])
    # Data at 0.4998, found there: the limit is 36e-5 of 1e4 t^2 away, some hundred standard deviations.
    assert not at_limit(monkeypatch, 0.4998, [1.1, 0.4998])
    # Where the limit is as good it is not asked below 0.4996, nor against what the shot declares.
    assert not at_limit(monkeypatch, INCOMPRESSIBLE, [1.1, 0.4995])
    assert not at_limit(monkeypatch, INCOMPRESSIBLE, [1.1, 0.49985], poisson=1e-4)


def test_answers_of_incompressible_shots_are_counted_by_hand() -> None:
    def one(asked: str, value: float, poisson: float, verdict: str = "identified") -> dict[str, Any]:
        said = {"number": 0, "asked": asked, "true": 1.0, "speed": 2.0, "verdict": verdict, "warnings": []}
        return {**said, "value": value, "sigma": 0.01, "poisson": poisson, "of poisson": []}

    rows = [
        one("nothing", 1.0, INCOMPRESSIBLE, "identified by the outline alone"),
        one("incompressible", 1.005, INCOMPRESSIBLE),
        one("0.49999", 1.021, 0.49999, "not explained by the model"),
    ]
    assert counts(rows) == {
        "answers": 3,
        "inside": 2,
        "identified": 2,
        "held at the limit": 1,
        "largest change over sigma": pytest.approx(2.1),
    }
    assert "+2.10 ± 2.00 | no |" in line(rows[2])


def test_a_shot_file_may_ask_for_the_limit(tmp_path: Path) -> None:
    folder = tmp_path / "shot"
    shutil.copytree(OPEN_01, folder, ignore=shutil.ignore_patterns("results*"))
    text = (folder / "shot.toml").read_text("utf-8")
    assert "poisson = 0.499 " in text
    (folder / "shot.toml").write_text(
        text.replace("poisson = 0.499 ", 'poisson = "incompressible" '), "utf-8"
    )
    assert load_shot(folder).model.poisson == INCOMPRESSIBLE
