"""Relaxation, the incompressible limit and mass-proportional damping in a shot."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import cumulative_trapezoid
from shot_folders import OPEN_01, shot_in

from doe import Box
from explicit.arguments import nodal_mass
from explicit.relaxation import BergstromBoyce, PronySeries
from kolsky.base.apparatus import INCOMPRESSIBLE, NETWORK_CONSTANTS, Relaxation, prony_names
from kolsky.inverse import incompressible, search
from kolsky.inverse.forward import Forward
from kolsky.inverse.incompressible import (
    AT_LIMIT,
    LEAST_POISSON,
    RISE,
    limit_of,
    limit_warning,
    profiled_rise,
    rise_at_limit,
)
from kolsky.inverse.parameters import (
    PARAMETERS,
    parsed_kind,
    reference_words,
    require_declared,
    same_bulk,
    what_relaxes,
    with_relaxation,
)
from kolsky.inverse.problem import choose, prepare_shot
from kolsky.inverse.settings import Numerics, Settings
from kolsky.inverse.valleys import LEAST_MARGIN, from_search, search_box, to_search
from kolsky.schema.material import RelaxationSection, declared_relaxation
from kolsky.shot.load import load_shot
from kolsky.virtual.schema import Specification
from kolsky.virtual.shot_file import toml_text
from populations.incompressible_shots import counts, line

# Relaxation in a shot: declaration, error messages, conversion to the solver's series, free or fixed

PRONY = Relaxation("prony", dict(zip(prony_names(1), (0.3, 4e-4), strict=True)), free=True)


def section(**given: Any) -> RelaxationSection:
    return RelaxationSection.model_validate(given)


@pytest.fixture(scope="module")
def forward() -> Forward:
    """A third of a shot, in which nothing is damped."""
    shot = load_shot(OPEN_01)
    first = shot.window[0]
    shot = replace(shot, window=(first, first + 0.3 * (shot.window[1] - first)))
    return prepare_shot(replace(shot, model=replace(shot.model, damping=0.0, poisson=0.49))).forward


def force(forward: Forward, **points: float) -> np.ndarray:
    response = forward.run(points, Numerics(mesh=(4, 6), threads=1))
    assert response.completed.all()
    return np.diff(response.impulse_transmission, axis=1)


def relaxing(forward: Forward, strength: float, time: float) -> Forward:
    values = dict(zip(prony_names(1), (strength, time), strict=True))
    return replace(forward, shot=replace(forward.shot, relaxation=Relaxation("prony", values)))


def test_a_branch_that_never_relaxes_is_a_stiffer_specimen(forward: Forward) -> None:
    # Eq. (V.2) with t / tau = 0: G = G_inf (1 + c), and the bulk modulus follows the instantaneous one.
    found = force(relaxing(forward, 0.25, 1e6), stiffness_factor=1.2)
    np.testing.assert_allclose(found, force(forward, stiffness_factor=1.5), rtol=1e-6, atol=1e-9)


def test_named_constants_stand_for_the_declared_ones(forward: Forward) -> None:
    declared = relaxing(forward, 0.25, 4e-4)
    named = force(relaxing(forward, 0.1, 1e-3), prony_strength_1=0.25, prony_time_1=4e-4)
    np.testing.assert_array_equal(force(declared), named)
    less = force(declared, prony_time_1=4e-5)
    assert less.sum() < named.sum()  # the faster branch has given up more


def test_a_batch_chooses_among_the_series_that_it_needs() -> None:
    fields = {"poisson": 0.49, "prony_strength_1": np.array([0.3, 0.1, 0.3]), "prony_time_1": 4e-4}
    rest, series = what_relaxes(fields, PRONY)
    assert set(rest) == {"poisson", "relaxation"}
    assert series == (PronySeries((0.1,), (4e-4,)), PronySeries((0.3,), (4e-4,)))
    np.testing.assert_array_equal(rest["relaxation"], [1, 0, 1])
    two = Relaxation("prony", dict(zip(prony_names(2), (0.1, 0.2, 1e-4, 2e-3), strict=True)))
    assert what_relaxes(two.values, two) == ({"relaxation": 0}, (PronySeries((0.1, 0.2), (1e-4, 2e-3)),))
    network = section(kind="bergstrom_boyce", ratio=0.5, resistance="8 kPa", exponent=3.0).declared()
    assert what_relaxes(network.values, network)[1] == (BergstromBoyce(0.5, 8e3, 3.0, -1.0, 0.01),)
    assert what_relaxes({"poisson": 0.49}, None) == ({"poisson": 0.49}, ())


def test_the_table_is_read_in_si_and_its_sigmas_stand_with_the_others() -> None:
    given = section(kind="prony", strengths=[0.3], times=["400 us"], sigma_times=["50 us"], free=True)
    found = declared_relaxation(given, None)
    assert found["relaxation"].values == pytest.approx({"prony_strength_1": 0.3, "prony_time_1": 4e-4})
    assert found["uncertainty"] == pytest.approx({"prony_time_1": 5e-5})
    assert found["relaxation"].free_names == ("prony_strength_1", "prony_time_1")
    network = section(kind="bergstrom_boyce", ratio=0.5, resistance="8 kPa").declared()
    assert tuple(network.values) == NETWORK_CONSTANTS
    assert (network.values["creep_resistance"], network.free_names) == (8e3, ())
    assert declared_relaxation(None, None) == {"relaxation": None, "uncertainty": {}}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"kind": "prony", "strengths": [0.3]}, "is missing"),
        ({"kind": "prony", "strengths": [0.3], "times": ["1 ms", "2 ms"]}, "has 2 entries, strengths has 1"),
        ({"kind": "prony", "strengths": [-0.3], "times": ["1 ms"]}, "strength 0 must be >= 0"),
        ({"kind": "prony", "strengths": [0.1] * 4, "times": ["1 ms"] * 4}, "is not a list of 1 to 3"),
        ({"kind": "prony", "strengths": [0.3], "times": ["1 ms"], "ratio": 0.5}, "would have no effect"),
        ({"kind": "bergstrom_boyce", "ratio": 0.5, "resistance": "0 Pa"}, "resistance must be > 0"),
        (
            {"kind": "prony", "strengths": [0.3], "times": ["1 ms"], "sigma_strengths": [-1.0]},
            "standard uncertainty of prony_strength_1 is -1",
        ),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError) as refused:
        section(**given)
    said = refused.value.errors()[0]
    assert words in said.get("ctx", {}).get("message", said["msg"])


def test_a_constant_that_the_shot_does_not_have_is_refused(forward: Forward) -> None:
    with pytest.raises(ValueError, match=r"prony_time_1 has no effect: the shot declares no \[relaxation\]"):
        force(forward, prony_time_1=1e-3)
    shot = replace(forward.shot, relaxation=PRONY)
    require_declared(["prony_time_1", "poisson"], shot)
    with pytest.raises(ValueError, match="declares a Prony series of 1 branch"):
        require_declared(["creep_ratio"], shot)
    assert not PARAMETERS["creep_ratio"].belongs_to(shot)
    with pytest.raises(ValueError, match="prony has the constants"):
        Relaxation("prony", {"prony_strength_1": 0.1})


def test_it_is_free_where_the_shot_says_so_and_held_as_asked() -> None:
    shot: Any = SimpleNamespace(
        interface=SimpleNamespace(faces="bonded", side="bonded"),
        model=SimpleNamespace(poisson=0.499, damping=25e-6),
        uncertainty={"prony_time_1": 5e-5, "prony_strength_1": 0.0},
        relaxation=PRONY,
        centre_line="seen",
    )
    found = choose(Settings(), shot)
    # an uncertainty of 0 is an exact value; the other one is a prior about the declared time
    assert list(found.free) == ["stiffness_factor", "poisson", "damping", "prony_time_1"]
    prior = found.prior(shot)
    assert prior is not None
    np.testing.assert_array_equal(prior.mean, [0.0, 0.0, 0.0, 4e-4])
    np.testing.assert_array_equal(prior.sigma, [np.inf, np.inf, np.inf, 5e-5])
    assert "prony_time_1" not in choose(Settings(hold=("prony_time_1",)), shot).free
    shot.relaxation = replace(PRONY, free=False)
    assert list(choose(Settings(), shot).free) == ["stiffness_factor", "poisson", "damping"]
    shot.relaxation, shot.centre_line = PRONY, None
    assert list(choose(Settings(), shot).free) == ["stiffness_factor"]


def test_a_search_moves_the_logarithm_of_a_time() -> None:
    from kolsky.inverse.parameters import design_box

    box = design_box({"prony_time_1": (1e-5, 1e-3), "poisson": (0.49, 0.499)})
    inner = search_box(box)
    middle = inner.scale(np.array([[0.5, 0.5]]))
    np.testing.assert_allclose(from_search(box, middle)[0], [1e-4, 0.5 - 0.5 * np.sqrt(2e-2 * 2e-3)])
    np.testing.assert_allclose(to_search(box, from_search(box, middle)), middle)


def test_a_start_without_constants_of_its_own(forward: Forward) -> None:
    span = forward.shot.window[1] - forward.shot.window[0]
    found = with_relaxation(forward.shot, "prony", 2).relaxation
    assert found is not None
    assert found.free
    assert list(found.values.values()) == pytest.approx([0.2, 0.2, 0.08 * span, 0.6 * span])
    network = with_relaxation(forward.shot, "bergstrom_boyce").relaxation
    assert network is not None
    assert network.values["creep_resistance"] == pytest.approx(0.5 * np.abs(forward.shot.curve.stress).max())
    with pytest.raises(ValueError, match="needs 1 to 3 branches, got 4"):
        with_relaxation(forward.shot, "prony", 4)
    assert parsed_kind("prony:2") == ("prony", 2)
    assert parsed_kind("bergstrom_boyce") == ("bergstrom_boyce", 1)
    with pytest.raises(ValueError, match=r'must be prony, prony:2.* got "prony:7"'):
        parsed_kind("prony:7")


def test_the_answer_says_that_m_is_of_the_long_term_curve() -> None:
    assert reference_words(["stiffness_factor", "poisson"]) == ""
    assert "long-term curve, to which a Prony series" in reference_words(["prony_time_1"])
    assert "network creeps" in reference_words(["poisson", "creep_ratio", "creep_exponent"])


def test_a_specification_declares_it_once_and_writes_it() -> None:
    from kolsky.virtual.shot_file import relaxation_table

    given = {"kind": "prony", "strengths": [0.3], "times": ["400 us"], "free": True}
    made = Specification.model_validate({"relaxation": given})
    assert made.relaxing == (PronySeries((0.3,), (4e-4,)),)
    assert made.relaxation is not None
    text = toml_text({"relaxation": relaxation_table(made.relaxation)}, name="x")
    assert '[relaxation]\nkind = "prony"\nfree = true\nstrengths = [0.3]\ntimes = ["0.0004 s"]' in text
    assert Specification().relaxing == ()


def test_the_bulk_modulus_stays_where_poissons_ratio_follows_the_branch() -> None:
    """K goes with m (1 + c) / (1 - 2 nu)."""
    poisson = same_bulk(np.array([0.4985, 0.49]), np.array([1.3, 1.001]))
    np.testing.assert_allclose(np.array([1.3, 1.001]) / (1.0 - 2.0 * poisson), 1.0 / np.array([0.003, 0.02]))
    assert float(same_bulk(0.4985, 1.0)) == 0.4985


# The incompressible limit on linear models: when it is used, and when the data distinguish it.


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
    # A valley that was not distinguished from the limit is not rejected either.
    curve = RISE * (kappa**2 - kappa[0] ** 2) / 0.003**2
    assert [limit_of(0.49998, kappa, curve, valley).least for valley in (0.4952, 0.4997)] == [
        0.4952,
        found.least,
    ]
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
    """Data 1 + t m + 1e4 t^2 (1 - 2 nu), noise 0.1, with the weights of that noise alone.

    With patterns of the flyer's noise, the noise is `sigma`.
    """

    t = np.linspace(-1.0, 1.0, 40)
    prior = None

    def __init__(self, kappa: float, sigma: float = 0.1) -> None:
        self.kappa, self.sigma, self.data = kappa, sigma, self.of(1.1, kappa)

    def of(self, m: float, kappa: float) -> np.ndarray:
        return 1.0 + self.t * m + 1e4 * self.t**2 * kappa

    def vectors(self, prediction: Any) -> np.ndarray:
        return np.array([self.of(m, 1.0 - 2.0 * nu) for m, nu in prediction.points])

    def with_discrepancy(self, vector: np.ndarray) -> "Linear":
        return self

    def replaced(self, prior: None = None, balanced: bool = False, front: Any = None) -> "Linear":
        return self if front is None or front.patterns is None else Linear(self.kappa, front.patterns)

    def gain(self, slopes: np.ndarray) -> np.ndarray:
        return np.linalg.pinv(slopes)

    def balanced_deviance(self, vectors: np.ndarray) -> np.ndarray:
        return (((vectors - self.data) / self.sigma) ** 2).sum(axis=1)


def rise(
    monkeypatch: pytest.MonkeyPatch,
    true: float,
    x: list[float],
    patterns: Any = None,
    *,
    lost: bool = False,
    **uncertainty: float,
) -> float:
    box = Box.of({"stiffness_factor": (0.5, 2.5), "poisson": (0.49, 0.4999)})
    lines = Linear(1.0 - 2.0 * true)

    def run(points: Any, numerics: Any) -> Any:
        assert numerics == "the surrogate's mesh"
        return SimpleNamespace(completed=np.arange(len(points)) != (1 if lost else 9), points=points)

    problem = SimpleNamespace(
        box=box, shot=SimpleNamespace(uncertainty=uncertainty), numerics="the surrogate's mesh",
        observations=None, point=lambda points: points,
    )  # fmt: skip
    runner: Any = SimpleNamespace(
        problem=problem, forward=SimpleNamespace(run=run), objective=lambda counted: lines
    )
    seen = SimpleNamespace
    monkeypatch.setattr(
        incompressible, "predict", lambda r, _: seen(points=r.points, inside=np.ones((len(r.points), 3)))
    )
    monkeypatch.setattr(incompressible, "replace", lambda objective, **given: objective.replaced(**given))
    return rise_at_limit(runner, np.array(x), patterns)


def test_the_rise_at_the_limit_in_closed_form(monkeypatch: pytest.MonkeyPatch) -> None:
    # The data are a line in m and a parabola in kappa, and t and t^2 are orthogonal. m follows exactly, so
    # that -2 ln L at the limit is (1e4 (kappa - kappa of the data) / 0.1)^2 sum t^4. At the optimum, m adds
    # (dm / sigma)^2 sum t^2, with the patterns' sigma.
    t, limit = Linear.t, 1.0 - 2.0 * INCOMPRESSIBLE

    def expected(true: float, m: float, nu: float, sigma: float = 0.1) -> float:
        kappa = 1.0 - 2.0 * true
        at_limit = (1e4 * (limit - kappa) / 0.1) ** 2 * (t**4).sum()
        own = (1e4 * (1.0 - 2.0 * nu - kappa)) ** 2 * (t**4).sum() + (m - 1.1) ** 2 * (t**2).sum()
        return float(at_limit - own / sigma**2)

    # Data at the limit, and an optimum far below the end of the range.
    for true, m, nu in [(INCOMPRESSIBLE, 1.1, 0.49957), (0.4991, 1.1, 0.4991), (0.4998, 1.4, 0.49985)]:
        assert rise(monkeypatch, true, [m, nu]) == pytest.approx(expected(true, m, nu), rel=1e-6)
        # The patterns count at the optimum and not at the limit.
        with_patterns = rise(monkeypatch, true, [m, nu], 0.2)
        assert with_patterns == pytest.approx(expected(true, m, nu, 0.2), rel=1e-6)
    assert expected(INCOMPRESSIBLE, 1.1, 0.49957) < 0.0 < LEAST_MARGIN < expected(0.4991, 1.1, 0.4991)


def test_a_limit_that_cannot_be_compared_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    assert rise(monkeypatch, INCOMPRESSIBLE, [1.1, 0.49985], poisson=1e-4) == np.inf
    assert rise(monkeypatch, INCOMPRESSIBLE, [1.1, 0.49985], lost=True) == np.inf


@pytest.mark.parametrize(("above", "margin"), [(249.0, 24.9), (251.0, 25.1), (700.0, 60.0)])
@pytest.mark.parametrize("by_default", [True, False])
@pytest.mark.parametrize("nu", [0.4993, 0.4997])
def test_the_limit_is_one_more_valley(
    monkeypatch: pytest.MonkeyPatch, above: float, margin: float, by_default: bool, nu: float
) -> None:
    """By default, Poisson's ratio is held there if it is near; otherwise the margin counts it."""
    x, numerics = np.array([1.1, nu]), Numerics()
    words = "-2 ln L at nu = 0.49998 is 249 above that of the answer, and must be 250"
    assert (words in (limit_warning(above) or "")) == (above < 250.0)
    optimum = SimpleNamespace(x=x, sigma=np.full(2, 1e-6), least_sigma=np.full(2, 1e-6))
    fine = SimpleNamespace(x=x, sigma=np.full(2, 1e-6), front=None, offsets={})
    found = {
        "_search_held": SimpleNamespace(
            coarse=SimpleNamespace(x=x[:1]), runner=SimpleNamespace(table=None), values={}
        ),
        "search_meshes": SimpleNamespace(
            optima={numerics.mesh: optimum},
            front=SimpleNamespace(noise=SimpleNamespace(patterns="patterns")),
            replicates=None,
            valley_margin=60.0,
        ),
        "search_by_gauss_newton": (None, fine),
    }
    for name, value in found.items():
        monkeypatch.setattr(search, name, lambda *given, value=value: value)
    compared = []
    monkeypatch.setattr(search, "rise_at_limit", lambda _, *given: compared.append(given) or above)
    problem = SimpleNamespace(
        box=Box.of({"stiffness_factor": (0.5, 2.5), "poisson": (0.49, 0.4999)}),
        freed=SimpleNamespace(by_default=by_default),
        declared=x.copy(),
        numerics=numerics,
    )
    runner: Any = SimpleNamespace(problem=problem, table=SimpleNamespace(take=lambda table, values: None))
    runner.under = lambda front, offsets=None: runner
    result = search._search_several(runner)
    assert compared == [(x, "patterns")]
    if by_default and margin < 25.0 and nu > 0.4996:
        assert isinstance(result, search.NotIdentifiable)
        assert result.reasons == {"poisson": AT_LIMIT}
        assert result.limit_rise == above
    else:
        assert isinstance(result, search.Search)
        assert (result.valley_margin, result.limit_rise) == (pytest.approx(margin), above)


def test_answers_of_incompressible_shots_are_counted_by_hand() -> None:
    def one(asked: str, value: float, poisson: float, verdict: str = "identified") -> dict[str, Any]:
        said = {"number": 0, "asked": asked, "true": 1.0, "speed": 2.0, "verdict": verdict, "warnings": []}
        found = {"value": value, "sigma": 0.01, "poisson": poisson, "of poisson": [], "limit rise": 7.4}
        return {**said, **found}

    rows = [
        one("nothing", 1.0, INCOMPRESSIBLE, "identified by the outline alone"),
        one("incompressible", 1.005, INCOMPRESSIBLE),
        one("0.49999", 1.021, 0.49999, "not explained by the model"),
    ]
    assert counts(rows) == {
        "answers": 3, "inside": 2, "identified": 2, "held at the limit": 1,
        "largest change over sigma": pytest.approx(2.1),
    }  # fmt: skip
    assert "| 7 | 0.49999 | +2.10 ± 2.00 | no |" in line(rows[2])


def test_a_shot_file_may_ask_for_the_limit(tmp_path: Path) -> None:
    folder = shot_in(tmp_path / "shot", ("poisson = 0.499 ", 'poisson = "incompressible" '))
    assert load_shot(folder).model.poisson == INCOMPRESSIBLE


# Mass-proportional damping in a shot: the drag alpha M v is the difference of flyer and transmission forces.


@pytest.mark.parametrize("alpha", [0.0, 400.0])
def test_the_impulses_of_a_shot_differ_by_momentum_and_drag(alpha: float) -> None:
    shot = load_shot(OPEN_01)
    first = shot.window[0]
    short = replace(shot, window=(first, first + 0.4 * (shot.window[1] - first)))
    short = replace(short, model=replace(short.model, mass_damping=alpha, poisson=0.49))
    prepared = prepare_shot(short)
    times = np.linspace(*short.window, 801)[1:]
    sampling = replace(prepared.forward.sampling, force_times=times, surface_times=times)
    forward = replace(prepared.forward, sampling=sampling)
    numerics = Numerics(mesh=(4, 6), threads=1)
    response = forward.run({}, numerics, all_nodes=True)
    assert response.nodes is not None
    mesh = forward.mesh(numerics)
    mass = nodal_mass(mesh, short.specimen.density)
    assert mass.sum() == pytest.approx(
        short.specimen.density * np.pi * short.specimen.radius**2 * short.specimen.length, rel=1e-9
    )
    down = mesh.nodes[:, 1] - response.nodes[0, :, :, 1]
    moved = down @ mass  # \int p dt [kg m], shape [times]
    impulse = response.impulse_flyer[0] - response.impulse_transmission[0]
    # Once more over the time: positions are known at the solver's steps alone, their rates are not.
    balance = cumulative_trapezoid(impulse - alpha * moved, times, initial=0.0)
    change, scale = moved - moved[0], np.ptp(moved)
    np.testing.assert_allclose(balance, change, atol=0.005 * scale)
    if alpha:  # without the drag the balance is off by far more than it holds with it
        without = cumulative_trapezoid(impulse, times, initial=0.0)
        assert np.abs(without - change).max() > 0.05 * scale
