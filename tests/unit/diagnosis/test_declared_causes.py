"""Inputs within their declared uncertainty: their effect is no misfit, and they are not named."""

from dataclasses import replace
from math import inf
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kolsky.diagnosis.cause_fit import Allowances, ExpectedResidual, fit_linear
from kolsky.diagnosis.cause_inputs import declared_span
from kolsky.diagnosis.cause_search import CauseSearch
from kolsky.diagnosis.causes import ALIKE, EVIDENCE, best_trials, ranked
from kolsky.inverse.result import CauseFinding
from kolsky.shot.input_records import Cause, Change
from kolsky.shot.inputs import DAMPING, POISSON, SENSITIVITY, causes

FloatArray = NDArray[np.float64]
K = 200  # Entries, all of the force, each at a time of its own; their noise is 1
BY_KEY = {c.key: c for c in causes()}


def expected() -> ExpectedResidual:
    return ExpectedResidual(
        np.ones(K), np.zeros((K, 0)), np.zeros(K, dtype=np.int64), np.arange(K), np.zeros(2)
    )


def runner(*, onset: float = 0.0, **declared: float) -> Any:
    shot = SimpleNamespace(uncertainty=declared)
    path = SimpleNamespace(sigma_onset=onset)
    prepared = SimpleNamespace(forward=SimpleNamespace(shot=shot))
    box = SimpleNamespace(names=("stiffness_factor",))
    problem = SimpleNamespace(prepared=prepared, shot=shot, settings=SimpleNamespace(held={}), box=box)
    return SimpleNamespace(problem=problem, front=SimpleNamespace(path=path))


def test_an_allowance_is_least_squares_with_its_prior_and_ends_at_its_bounds() -> None:
    """Columns of disjoint entries: a = -b r / (b^2 + 1) each, no further than the bound; z = -r / c."""
    B, A, r = np.zeros((K, 3)), np.zeros((K, 1)), np.zeros(K)
    B[0, 0], B[1, 1], B[2, 2], A[3, 0] = 3.0, 3.0, 0.5, 2.0
    r[:4] = [0.9, -60.0, 0.8, 5.0]
    fit = fit_linear(r, A, expected(), Allowances(B, np.full(3, -2.0), np.full(3, 2.0)))
    tau = float(expected().with_tau(fit.residual).tau[0])
    weight = 1.0 / (1.0 + tau**2)
    first, third = -3.0 * 0.9 * weight / (9.0 * weight + 1.0), -0.5 * 0.8 * weight / (0.25 * weight + 1.0)
    # 60 would take an amplitude of 18 and more: it ends at 2.
    np.testing.assert_allclose(
        fit.residual[:4], [0.9 + 3.0 * first, -60.0 + 6.0, 0.8 + 0.5 * third, 0.0], rtol=1e-6, atol=1e-9
    )
    assert fit.step == pytest.approx([-2.5], rel=1e-9)


def test_an_allowance_widens_the_uncertainty_of_what_it_resembles() -> None:
    """Input and allowance with the same column b: the variance is 1 / |b|^2, and the prior's 1 beside it."""
    b = np.random.default_rng(1).standard_normal((K, 1))
    free = fit_linear(np.zeros(K), b, expected()).covariance[0, 0]
    wide = fit_linear(np.zeros(K), b, expected(), Allowances(b, np.full(1, -2.0), np.full(1, 2.0)))
    own = 1.0 / float(b[:, 0] @ b[:, 0])
    assert free == pytest.approx(own, rel=1e-9)
    assert wide.covariance[0, 0] == pytest.approx(own + 1.0, rel=1e-9)


@pytest.mark.parametrize(
    ("key", "declared", "wanted"),
    [
        ("specimen.diameter", {"specimen_diameter": 0.0005}, (-0.001, 0.001)),
        (SENSITIVITY, {"sensitivity": 0.01}, (1.0 / 1.02, 1.0 / 0.98)),
        (SENSITIVITY, {"sensitivity": 0.8}, (1.0 / 2.6, 100.0)),  # a gain below 0.01 is none
        ("force.clock_offset", {"clock_offset": 1e-6}, (-2e-6, 2e-6)),
        ("force.clock_offset", {}, None),
        ("force.clock_offset", {"onset": 2e-6}, (-4e-6, 4e-6)),  # granted: what the path leaves open
        ("flyer.time", {"onset": 2e-6}, (-4e-6, 4e-6)),
        ("force.clock_offset", {"onset": 2e-6, "clock_offset": 1.5e-6}, (-5e-6, 5e-6)),
        ("centre_line.time", {"onset": 2e-6}, None),
        ("flyer tilt", {}, (0.0, (16e-6) ** 2)),  # granted; its coordinate is the square
    ],
)
def test_what_is_declared_reaches_to_k_2(
    key: str, declared: dict[str, float], wanted: tuple[float, float] | None
) -> None:
    found = declared_span(BY_KEY[key], runner(**declared))
    assert found == (None if wanted is None else pytest.approx(wanted, rel=1e-12, abs=1e-18))


def test_a_finding_is_within_up_to_k_2() -> None:
    one = CauseFinding(
        "specimen.diameter", "", "1", 1.0, 1.00099, 1e-5, 0.9, 150.0, 1.0, {}, {}, False,
        declared_sigma=0.0005,
    )  # fmt: skip
    assert one.within
    assert replace(one, value=0.99901).within
    assert not replace(one, value=1.00101).within
    assert not replace(one, value=0.99899).within
    assert not replace(one, declared_sigma=None).within


class LinearModel:
    """Predictions that are linear in the parameter and in two inputs, in place of simulations."""

    def __init__(self, columns: dict[str, FloatArray], data: FloatArray) -> None:
        self.columns, self.data, self.x = columns, data, np.ones(1)
        self.lower, self.upper = np.zeros(1), np.full(1, 10.0)
        self.observations = SimpleNamespace(bins=SimpleNamespace(mean=data), n_force=data.size)

    def steps(self, x: FloatArray) -> FloatArray:
        return np.full(1, 0.01)

    def slopes(self, x: FloatArray, changed: Change) -> list[Any]:
        return [SimpleNamespace(x=x + 0.01, changed=changed)]

    @property
    def screen(self) -> Any:
        return self

    def vectors(self, points: Any) -> FloatArray:
        return np.array(
            [
                self.columns["m"] * (p.x[0] - 1.0)
                + sum(u * self.columns[name] for name, u in p.changed.values.items())
                for p in points
            ]
        )


def candidate(key: str, declared: str = "") -> Cause:
    return Cause(
        key=key, words="a change", check="check it", scan=(), step=0.1, typical=1.0,
        changed=lambda u: Change(values={key: u}), declared=declared, simulated=False, highest=inf,
    )  # fmt: skip


def search(planted: float) -> CauseSearch:
    """An input of standard uncertainty 1, planted off; another that nobody declares resembles it by 0.95."""
    rng = np.random.default_rng(7)
    m, off, other = np.linalg.qr(rng.standard_normal((K, 3)))[0].T
    columns = {
        "m": 300.0 * m,
        "off": 12.0 * off,
        "alike": 12.0 * (0.95 * off + np.sqrt(1.0 - 0.95**2) * other),
    }
    data = planted * columns["off"] + rng.standard_normal(K)
    model: Any = LinearModel(columns, data)
    tried = [candidate("off", "specimen_diameter"), candidate("alike")]
    return CauseSearch(runner(specimen_diameter=1.0), model, expected(), np.ones(K, dtype=bool), tried)


def test_an_allowance_is_one_declared_standard_uncertainty_up_to_two_of_them() -> None:
    one = search(0.0)
    found = one.allowed()
    np.testing.assert_allclose(found.columns[:, 0], one.columns["off"], rtol=1e-12)
    assert (found.lower.tolist(), found.upper.tolist()) == ([-2.0], [2.0])
    assert one.allowed(one.declared[0]).columns.shape == (K, 0)


def test_an_error_within_what_is_declared_is_listed_and_nothing_is_named() -> None:
    one = search(1.9)
    bare = one.bare[0]
    assert bare == pytest.approx(1.0 + (1.9 * 12.0) ** 2 / K, abs=0.35)
    assert one.before[0] == pytest.approx(1.0, abs=0.2)  # nothing is left where it may be off
    off, alike = ranked(one, best_trials(one, [*one.declared, candidate("alike")]))
    assert (off.key, off.within, off.named) == ("off", True, False)
    assert off.value == pytest.approx(1.9, abs=0.25)
    assert off.evidence == pytest.approx(K * np.log(bare / max(1.0, one.before[0])), rel=0.15)
    assert off.evidence > EVIDENCE
    assert off.explained > 0.9
    assert (alike.named, alike.within) == (False, False)
    assert alike.evidence < 0.3 * EVIDENCE


def test_a_cause_with_strong_evidence_is_named_whatever_share_it_explains(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The input is 144 of the 928 that the data lie off, over 200 entries of noise 1: a share of 0.16."""
    monkeypatch.setattr("kolsky.diagnosis.causes.EVIDENCE", 20.0)
    rng = np.random.default_rng(5)
    m, off, rest = np.linalg.qr(rng.standard_normal((K, 3)))[0].T
    model: Any = LinearModel(
        {"m": 300.0 * m, "off": 12.0 * off}, 12.0 * off + 28.0 * rest + rng.standard_normal(K)
    )
    one = CauseSearch(runner(), model, expected(), np.ones(K, dtype=bool), [candidate("off")])
    (found,) = ranked(one, one.tangents([candidate("off")]))
    before = one.before[0]
    assert before == pytest.approx(1.0 + 928.0 / K, abs=1.0)  # noise along both directions adds to them
    assert found.explained == pytest.approx(144.0 / 928.0, abs=0.06)
    left = 1.0 + (1.0 - found.explained) * (before - 1.0)
    assert found.evidence == pytest.approx(K * np.log(before / left), rel=1e-9)
    assert found.named


def test_an_error_beyond_what_is_declared_is_named_by_what_k_2_leaves() -> None:
    """Of six standard uncertainties two are allowed: the misfit that counts is that of the other four."""
    one = search(6.0)
    assert one.before[0] == pytest.approx(1.0 + (4.0 * 12.0) ** 2 / K, rel=0.15)
    off, alike = ranked(one, best_trials(one, [*one.declared, candidate("alike")]))
    assert (off.key, off.named, off.within) == ("off", True, False)
    assert off.value == pytest.approx(6.0, abs=0.3)
    assert off.evidence == pytest.approx(K * np.log(one.before[0]), rel=0.1)
    assert off.sigma < 0.2  # 1 / 12, and what correlation adds: its own allowance takes no part
    assert alike.key == "alike"
    assert alike.evidence < off.evidence


def beside(
    planted: dict[str, float], refuted: str, declared: float | None = None, *, left: float = 1.0
) -> list[CauseFinding]:
    """Findings for inputs at right angles, each off by so many standard deviations of its own estimate.

    `left` is the mean square of what no input explains.
    """
    directions = np.linalg.qr(np.random.default_rng(11).standard_normal((K, 1 + len(planted))))[0].T
    columns = {"m": 300.0 * directions[0]}
    columns |= {key: 10.0 * d for key, d in zip(planted, directions[1:], strict=True)}
    noise = np.random.default_rng(12).standard_normal(K)
    noise -= directions.T @ (directions @ noise)  # the estimates are exact, the mean square is one
    data = noise * np.sqrt(left * K / (noise @ noise))
    data += sum(0.1 * off * columns[key] for key, off in planted.items())
    model: Any = LinearModel(columns, data)
    tried = [candidate(key, "specimen_diameter" if key == DAMPING and declared else "") for key in planted]
    known = {} if declared is None else {"specimen_diameter": declared}
    one = CauseSearch(runner(**known), model, expected(), np.ones(K, dtype=bool), tried)
    return list(ranked(one, best_trials(one, tried), refuted=refuted))


def test_beside_a_refuted_value_its_pair_is_named_when_it_leads_and_is_significant() -> None:
    """The evidence is K ln(1 + off^2 / K)."""
    off = np.sqrt(K * np.expm1(0.6 * EVIDENCE / K))
    found = beside({DAMPING: off, "specimen.length": 0.0}, POISSON)
    assert (found[0].key, found[0].named, found[0].alike) == (DAMPING, True, ())
    assert found[0].evidence == pytest.approx(0.6 * EVIDENCE, rel=1e-9)  # round-off
    assert [f.named for f in found[1:]] == [False]
    # With nothing refuted, or what is no member of the pair, the evidence is too little.
    for refuted in ("", "specimen.length"):
        assert not any(f.named for f in beside({DAMPING: off, "other": 0.0}, refuted))
    # Another input that the pair does not have is not named, nor is a member behind it.
    assert not any(f.named for f in beside({DAMPING: 0.5 * off, "specimen.length": off}, POISSON))
    # Where most is left by something else, it explains little of that: the pair has explained enough.
    off = np.sqrt(3.0 * K * np.expm1(0.3 * EVIDENCE / K))
    (little, _) = beside({DAMPING: off, "specimen.length": 0.0}, POISSON, left=3.0)
    assert little.explained == pytest.approx(off**2 / (2.0 * K + off**2), rel=1e-9)
    assert little.explained < 0.2
    assert little.named
    # A likelihood ratio of less than exp(5) tells nothing apart, however small the probability.
    small = np.sqrt(K * np.expm1(0.99 * ALIKE / K))
    assert not any(f.named for f in beside({DAMPING: small, "specimen.length": 0.0}, POISSON))
    # What the noise brings is not significant.
    assert not any(f.named for f in beside({DAMPING: 1.0, "specimen.length": 0.0}, POISSON))


def test_a_value_within_its_declared_uncertainty_is_not_named_with_its_pair() -> None:
    found = beside({DAMPING: 12.0, "specimen.length": 0.0}, POISSON, declared=1.0)  # 1.2 of k = 2
    assert not any(f.named for f in found)
    assert found[0].key == DAMPING
    assert found[0].within


class Short(LinearModel):
    """A model whose runs away from x = 1 lose the last entries of the data."""

    lost = 1

    def vectors(self, points: Any) -> FloatArray:
        found = super().vectors(points)
        for row, p in zip(found, points, strict=True):
            row[len(row) - self.lost :] = np.where(
                abs(p.x[0] - 1.0) > 0.1, np.nan, row[len(row) - self.lost :]
            )
        return found


def test_a_start_that_does_not_reach_a_point_has_no_residual_there_and_one_that_ends_early_is_said() -> None:
    data = np.linspace(1.0, 2.0, K)
    model: Any = Short({"m": np.ones(K)}, data)
    model.observations.n_force = K - 1
    whole = np.ones(K, dtype=bool)
    one = CauseSearch(runner(), model, expected(), whole, [], start=np.full(1, 2.0))
    assert one.residual(one.vector) == pytest.approx(np.append(1.0 - data[:-1], 0.0))
    assert np.isfinite(one.before).all()
    model.lost = 2
    with pytest.raises(ValueError, match="the run at the start of the search for a wrong input did not"):
        CauseSearch(runner(), model, expected(), whole, [], start=np.full(1, 2.0))
