"""The paper's method on costs with an answer in closed form, and its interval by hand."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import synthetic

from doe import Box, CostSurrogate, Design, full_factorial
from kolsky.inverse.run_table import Terms
from kolsky.inverse.settings import Numerics
from kolsky.studies import paper_method
from kolsky.studies import paper_method as method
from kolsky.studies.paper_method import CostInterval, cost_interval

COARSE, FINE = (8, 11), (16, 22)
SLOPE = 20.0
"""Of the made cost in m, to both sides."""
DELTA = 1.6
"""delta Phi of every made run."""


def terms(phi: float, *, outline: bool = True) -> Terms:
    """A run with this Phi, all of it by the force: Phi_F = 1000 N x Phi."""
    nan = float("nan")
    shape = 0.0 if outline else nan
    return Terms(
        phi_shape=shape, phi_force=1000.0 * phi, phi=phi if outline else nan,
        sigma_phi_shape=DELTA * 0.8e-3 if outline else nan, sigma_phi_force=DELTA * 0.6e3,
        sigma_phi=DELTA if outline else nan, chi2_force=1.0, chi2_shape=shape, n_force=5,
        n_shape=4 if outline else 0, n_outside=0,
    )  # fmt: skip


class MadeShot:
    """Phi = 3 + SLOPE |m - m0| + penalty (f - 2)^2, m0 higher on the coarse mesh, as a coarse mesh's is."""

    def __init__(self, at: dict[tuple[int, int], float], penalty: float = 0.0, outline: bool = True) -> None:
        self.at, self.penalty, self.outline = at, penalty, outline
        self.interface = SimpleNamespace(faces="bonded", friction=0.0)
        self.runs: list[tuple[dict[str, float], tuple[int, int]]] = []

    def cost(self, values: dict[str, float], mesh: tuple[int, int]) -> float:
        friction = values.get("friction", 2.0)
        away = abs(values["stiffness_factor"] - self.at[mesh])
        return 3.0 + SLOPE * away + self.penalty * (friction - 2.0) ** 2

    def sweep(self, shot: Any, design: Design, *, held: dict, numerics: Numerics, **_: Any) -> Any:
        names = design.box.names
        rows = [{**held, **dict(zip(names, x, strict=True))} for x in design.points]
        phi = np.array([self.cost(row, numerics.mesh) for row in rows])
        shape = np.zeros(len(phi)) if self.outline else np.full(len(phi), np.nan)
        base = synthetic().design
        n = len(phi)
        table = base.__class__(
            names=names, points=design.points, lower=np.array(design.box.lower),
            upper=np.array(design.box.upper), outcomes=("COMPLETED",) * n, end_times=np.ones(n),
            failed_elements=np.full(n, -1), failed_places=np.full((n, 2), np.nan), stage=("design",) * n,
            phi_shape=shape, phi_force=1000.0 * phi, chi2_shape=shape, chi2_force=phi,
        )  # fmt: skip
        return SimpleNamespace(table=table)

    def simulate(self, shot: Any, values: dict[str, float], *, numerics: Numerics) -> Any:
        self.runs.append((values, numerics.mesh))
        found = terms(self.cost(values, numerics.mesh), outline=self.outline)
        return SimpleNamespace(parameters=dict(values), terms=found)


def answer(monkeypatch: pytest.MonkeyPatch, made: MadeShot, **options: Any) -> method.PaperAnswer:
    monkeypatch.setattr(method.sweeping, "sweep", made.sweep)
    monkeypatch.setattr(method.single, "simulate", made.simulate)
    monkeypatch.setattr(method, "LEVELS", 6)  # quicker; a plane of ten levels asks for the same arithmetic
    shot = SimpleNamespace(name="made", interface=made.interface)
    numerics = Numerics(mesh=COARSE)
    return method.paper_method(shot, numerics=numerics, refined_mesh=FINE, **options)  # type: ignore[arg-type]


def test_the_interval_is_the_uncertainty_over_the_slope() -> None:
    x = np.linspace(0.5, 1.5, 11)
    found = cost_interval(x, 7.0 + 20.0 * np.abs(x - 1.0), 3.0)  # 3 / 20 = 0.15 to both sides
    assert found == CostInterval(pytest.approx(0.85), pytest.approx(1.15), False, False)
    assert found.moved(-0.05) == CostInterval(pytest.approx(0.80), pytest.approx(1.10), False, False)


def test_the_interval_spans_every_valley_that_is_as_deep() -> None:
    x = np.linspace(0.0, 1.0, 5)
    found = cost_interval(x, np.array([9.0, 1.0, 9.0, 1.5, 9.0]), 1.0)  # limit 2.0
    assert found.low == pytest.approx(0.25 - 0.25 / 8.0)
    assert found.high == pytest.approx(0.75 + 0.25 * 0.5 / 7.5)


def test_an_interval_that_reaches_its_bound_is_open_there() -> None:
    x = np.linspace(0.0, 1.0, 5)
    found = cost_interval(x, x, 0.3)
    assert (found.low, found.open_low, found.open_high) == (0.0, True, False)
    assert found.high == pytest.approx(0.3)
    assert cost_interval(x, -x, 2.0).open_high
    for bad in (np.nan, -1.0):
        with pytest.raises(ValueError, match="uncertainty >= 0"):
            cost_interval(x, x, bad)


def test_the_profile_takes_the_least_over_the_other_parameter() -> None:
    box = Box.of({"friction": (0.0, 2.0), "stiffness_factor": (0.5, 1.5)})
    points = full_factorial(box, 7).points
    cost = (points[:, 1] - 1.0) ** 2 + (points[:, 0] - 1.0) ** 2
    fit = CostSurrogate.fit(box, points, cost)
    x, least = method.profile(fit)
    np.testing.assert_allclose(least, (x - 1.0) ** 2, atol=0.01)  # interpolation between seven levels
    assert method.friction_constrained(fit, 0.5)  # at f = 2 the least is 1 above
    assert not method.friction_constrained(fit, 1.5)


def test_without_an_outline_the_force_alone_counts() -> None:
    assert method.cost_of(terms(2.5)) == 2.5
    assert method.delta_of(terms(2.5)) == DELTA
    assert method.cost_of(terms(2.5, outline=False)) == pytest.approx(2.5)
    assert method.delta_of(terms(2.5, outline=False)) == pytest.approx(0.6 * DELTA)


def test_the_box_on_the_refined_mesh_stays_inside_the_design() -> None:
    whole = Box.of({"friction": (0.0, 2.0), "stiffness_factor": (0.75, 1.5)})
    box = method.box_around(whole, np.array([1.9, 1.1]), [0.25, 0.16])
    assert (box.lower, box.upper) == (pytest.approx((1.5, 1.04)), pytest.approx((2.0, 1.16)))


@pytest.mark.parametrize("outline", [True, False])
def test_untold_friction_is_no_slip_and_the_optimum_moves_to_the_refined_mesh(
    monkeypatch: pytest.MonkeyPatch, outline: bool
) -> None:
    made = MadeShot({COARSE: 1.10, FINE: 1.05}, outline=outline)
    found = answer(monkeypatch, made)
    assert (found.friction, found.friction_told, found.confirmed) == (None, False, True)
    assert found.coarse["stiffness_factor"] == pytest.approx(1.10, abs=0.02)  # of a kink between 16 levels
    assert found.factor == pytest.approx(1.05, abs=method.CONFIRMED)
    half = found.delta / SLOPE
    assert found.delta == pytest.approx(DELTA if outline else 0.6 * DELTA)
    assert found.interval.high - found.interval.low == pytest.approx(2.0 * half, abs=0.03)
    assert found.interval.low < 1.05 < found.interval.high
    assert [len(s.runs.table.outcomes) for s in found.surfaces] == [36, 16, 7]
    assert made.runs[-1] == ({"stiffness_factor": found.factor}, FINE)
    assert found.cost == pytest.approx(made.cost({"stiffness_factor": found.factor}, FINE))
    said = paper_method.rows(found)
    assert said["f, paper's"] == "no slip, as the data do not constrain it"
    assert ("force alone" in said["Phi, paper's"]) is not outline


def test_told_friction_is_searched_too(monkeypatch: pytest.MonkeyPatch) -> None:
    made = MadeShot({COARSE: 1.10, FINE: 1.05}, penalty=-2.0)  # 8 more Phi without friction than with 2
    found = answer(monkeypatch, made)
    assert found.friction_told
    assert found.friction == pytest.approx(0.0, abs=0.02)
    assert len(found.surfaces) == 2
    sliding = MadeShot({COARSE: 1.10, FINE: 1.05})
    sliding.interface.faces = "coulomb"
    assert answer(monkeypatch, sliding).friction == 2.0  # no slip is the upper bound where faces slide


def test_an_optimum_at_a_bound_is_not_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    found = answer(monkeypatch, MadeShot({COARSE: 1.6, FINE: 1.6}), held={"friction": 0.3})
    assert not found.confirmed
    assert "bound of its design" in paper_method.paper_warnings(found)[0]
    assert found.interval.open_high
    assert "open above" in paper_method.rows(found)["m, paper's, interval (M.6-M.8)"]
    wider = {"stiffness_factor": (1.0, 2.2)}
    assert answer(monkeypatch, MadeShot({COARSE: 1.6, FINE: 1.6}), bounds=wider).confirmed


def test_a_far_shift_between_meshes_is_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    found = answer(monkeypatch, MadeShot({COARSE: 1.20, FINE: 1.05}))  # box edge 0.12: two boxes away
    assert found.confirmed
    assert found.factor == pytest.approx(1.05, abs=method.CONFIRMED)


def test_json_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    found = answer(monkeypatch, MadeShot({COARSE: 1.10, FINE: 1.05}))
    said = paper_method.to_json(found)
    assert said["interval"] == [found.interval.low, found.interval.high]
    assert said["checks"][-1]["phi"] == found.cost


def test_unknown_bounds_are_refused() -> None:
    with pytest.raises(ValueError, match="varies friction and stiffness_factor"):
        method.paper_method(SimpleNamespace(), bounds={"damping": (0.0, 1.0)})  # type: ignore[arg-type]


def test_the_command_has_its_answer_or_says_why_not(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    """What `kolsky identify --method paper` adds to the answer that it has written already."""
    from kolsky.cli.identify import paper_answer
    from kolsky.inverse.settings import Settings

    made = MadeShot({COARSE: 1.10, FINE: 1.05})
    monkeypatch.setattr(method.sweeping, "sweep", made.sweep)
    monkeypatch.setattr(method.single, "simulate", made.simulate)
    monkeypatch.setattr(method, "LEVELS", 6)
    monkeypatch.setattr("kolsky.shot.curve.with_pull", lambda shot, pull: shot)
    shot = SimpleNamespace(name="made", interface=made.interface)
    settings = Settings(
        free={"stiffness_factor": (0.9, 1.3)}, numerics=Numerics(mesh=COARSE), refined_mesh=FINE
    )
    rows, said, doubts = paper_answer(shot, settings, tmp_path)  # type: ignore[arg-type]
    assert rows["m, paper's method"].endswith("confirmed on 16x22")
    assert said["paper_method"]["stiffness_factor"] == pytest.approx(1.05, abs=method.CONFIRMED)
    assert doubts == paper_method.paper_warnings(
        answer(monkeypatch, made, bounds={"stiffness_factor": (0.9, 1.3)})
    )
    assert (tmp_path / "paper_method.json").exists()

    def broken(*_: Any, **__: Any) -> Any:
        raise ValueError("2 of 36 runs of the design completed")

    monkeypatch.setattr(method.sweeping, "sweep", broken)
    rows, said, doubts = paper_answer(shot, settings, tmp_path)  # type: ignore[arg-type]
    assert (rows, said) == ({}, {"paper_method": None})
    assert doubts == ["the paper's method has no answer: 2 of 36 runs of the design completed"]
