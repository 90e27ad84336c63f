"""Far values of inputs: the same trials in one launch as one by one."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from kolsky.diagnosis.cause_fit import fit_linear
from kolsky.diagnosis.cause_model import Point
from kolsky.diagnosis.cause_search import CauseSearch, scan_inputs
from kolsky.shot.input_records import Cause, Change
from tests.unit.diagnosis.test_declared_causes import K, LinearModel, candidate, expected, runner

NARROW, WIDE, ALTERED = "narrow", "wide", "altered"


class Asked(LinearModel):
    """A model that notes what is asked for."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.asked: list[list[str]] = []

    def vectors(self, points: Any) -> Any:
        self.asked.append(sorted({key for point in points for key in point.changed.values}))
        found = super().vectors(points)
        for row, point in zip(found, points, strict=True):
            # Two valleys, so that each input has two values from which both neighbours are worse.
            row += sum(20.0 * np.cos(3.0 * u) for u in point.changed.values.values()) * self.columns["bend"]
        return found


def inputs() -> list[Cause]:
    coarse = tuple(0.5 * n for n in range(-8, 9))
    return [
        replace(candidate(ALTERED), scan=coarse),
        replace(candidate(NARROW), scan=coarse, simulated=True, lowest=-3.0, highest=3.0),
        replace(candidate(WIDE), scan=coarse, simulated=True),
    ]


def search() -> tuple[CauseSearch, Asked]:
    rng = np.random.default_rng(8)
    rows = np.linalg.qr(rng.standard_normal((K, 5)))[0].T
    columns = {
        name: size * row
        for name, size, row in zip(
            ("m", ALTERED, NARROW, WIDE, "bend"), (300.0, 9.0, 9.0, 9.0, 1.0), rows, strict=True
        )
    }
    model = Asked(columns, -2.0 * columns[NARROW] + rng.standard_normal(K))
    one: Any = model
    return CauseSearch(runner(), one, expected(), np.ones(K, dtype=bool), inputs()), model


def one_by_one(one: CauseSearch, tried: list[tuple[Cause, float]]) -> dict[float, float]:
    """Loss of each value, by a whole fit of its own."""
    losses = {}
    for c, u in tried:
        if c.lowest <= u <= c.highest:
            vector = one.model.vectors([Point(one.x, Change(values={c.key: u}))])[0]
            fit = fit_linear(one.residual(vector), one.slope, one.expected, one.allowed(c))
            losses[u] = one.loss(one.expected.misfits(fit.residual))
    return losses


def floors(losses: dict[float, float]) -> list[float]:
    """The two lowest values from which both neighbours are worse."""
    us = sorted(losses)
    found = [
        u
        for i, u in enumerate(us)
        if all(losses[u] <= losses[us[j]] for j in (i - 1, i + 1) if 0 <= j < len(us))
    ]
    return sorted(found, key=lambda u: losses[u])[:2]


def test_the_trials_are_those_of_every_value_by_itself() -> None:
    one, _ = search()
    found = scan_inputs(one, inputs())
    wanted = [(c.key, u) for c in inputs() for u in floors(one_by_one(one, [(c, u) for u in c.scan]))]
    assert [(t.candidate.key, t.u) for t in found] == wanted
    for t in found:
        assert one.loss(t.misfits) == one_by_one(one, [(t.candidate, t.u)])[t.u]


def test_all_that_does_not_depend_on_others_is_one_launch() -> None:
    one, model = search()
    model.asked.clear()
    scan_inputs(one, inputs())
    assert model.asked == [[ALTERED, NARROW, WIDE]]


def test_far_values_are_tried_on_the_coarse_mesh_alone() -> None:
    one, model = search()
    coarse = Asked(model.columns, model.data)
    fine: Any = SimpleNamespace(
        **{name: getattr(model, name) for name in ("x", "data", "lower", "upper", "observations")},
        screen=coarse,
    )
    one.model = fine  # it has no vectors: asked for one, it fails
    assert [t.u for t in scan_inputs(one, inputs())] == [t.u for t in scan_inputs(search()[0], inputs())]
    assert coarse.asked == [[ALTERED, NARROW, WIDE]]
