"""Free parameters by default, the effect of a shot's declarations, and conditions for a fixed parameter."""

from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from explicit import Samples
from kolsky.inverse.parameters import PARAMETERS, checked_value, design_box, parameter
from kolsky.inverse.problem import BEYOND, EXACT, HELD_AS_ASKED, SLIDES, choose
from kolsky.inverse.search import not_identifiable
from kolsky.inverse.settings import Numerics, Settings, require_finer
from kolsky.shot.load import load_shot


def shot(faces: str = "bonded", side: str = "bonded", **uncertainty: float) -> Any:
    return SimpleNamespace(
        interface=SimpleNamespace(faces=faces, side=side, friction=0.3, release_stress=0.0),
        model=SimpleNamespace(poisson=0.499, damping=25e-6, mass_damping=0.0),
        uncertainty=uncertainty,
        relaxation=None,
        centre_line="seen",
    )


def test_three_are_free_where_the_specimen_keeps_its_hold() -> None:
    found = choose(Settings(), shot())
    assert list(found.free) == ["stiffness_factor", "poisson", "damping"]
    assert found.by_default
    assert found.prior(shot()) is None  # what nobody stated has no width
    assert not list(found.said(shot()))


@pytest.mark.parametrize("laws", [("coulomb", "bonded"), ("bonded", "coulomb"), ("bonded_release", "bonded")])
def test_the_stiffness_alone_where_a_surface_slides_or_lets_go(laws: tuple[str, str]) -> None:
    found = choose(Settings(), shot(*laws))
    assert list(found.free) == ["stiffness_factor"]
    assert set(found.reasons.values()) == {SLIDES}
    unseen = shot()
    unseen.centre_line = None
    assert list(choose(Settings(), unseen).free) == ["stiffness_factor"]
    # A friction that is held makes everything slide.
    assert list(choose(Settings(held={"friction": 0.2}), shot()).free) == ["stiffness_factor"]


def test_declared_uncertainties_are_priors_and_zero_is_exact() -> None:
    declared = shot(poisson=2e-4, damping=0.0)
    found = choose(Settings(), declared)
    assert list(found.free) == ["stiffness_factor", "poisson"]
    assert found.reasons == {"damping": EXACT}
    prior = found.prior(declared)
    assert prior is not None
    np.testing.assert_array_equal(prior.mean, [0.0, 0.499])
    np.testing.assert_array_equal(prior.sigma, [np.inf, 2e-4])


def test_what_the_user_says_counts() -> None:
    held = choose(Settings(hold=("poisson",), held={"damping": 30e-6}), shot())
    assert list(held.free) == ["stiffness_factor"]
    assert held.reasons == {"damping": HELD_AS_ASKED, "poisson": HELD_AS_ASKED}
    assert held.settings.held == {"damping": 30e-6}
    named = choose(Settings(free={"stiffness_factor": None}), shot(poisson=2e-4))
    assert list(named.free) == ["stiffness_factor"]
    assert not named.by_default
    # Asked for, a parameter is free though its value is declared exact.
    assert list(choose(Settings(free={"damping": None}), shot(damping=0.0)).free) == ["damping"]
    with pytest.raises(ValueError, match="nothing is free: stiffness_factor is held as asked"):
        choose(Settings(hold=("stiffness_factor", "poisson", "damping")), shot())
    for settings, words in (
        (Settings(hold=("poison",)), "no parameter 'poison'; choose from stiffness_factor"),
        (Settings(held={"poison": 0.4}), "no parameter 'poison'"),
        (Settings(held={"poisson": 0.7}), r"poisson = 0.7 is not allowed; it must be in \[0, 0.49999\]"),
    ):
        with pytest.raises(ValueError, match=words):
            choose(settings, shot())
    for options, words in (
        ({"pull": "last"}, "pull must be one of first, conditioned, got 'last'"),
        ({"replicates": -1}, r"replicates must be in \[0, inf\], got -1"),
        ({"seed": -1}, r"seed must be in \[0, inf\], got -1"),
    ):
        with pytest.raises(ValueError, match=words):
            Settings(**options)  # type: ignore[arg-type]
    for options, words in (
        ({"past_data": "go"}, "past_data must be one of continue, stop, got 'go'"),
        ({"precision": "fp16"}, "precision must be one of fp64, fp32, got 'fp16'"),
        ({"threads": 0}, r"threads must be in \[1, inf\], got 0"),
    ):
        with pytest.raises(ValueError, match=words):
            Numerics(**options)  # type: ignore[arg-type]
    require_finer((17, 23), (16, 22))
    for refined in ((16, 23), (17, 22)):
        with pytest.raises(ValueError, match="must be finer than that of the search"):
            require_finer(refined, (16, 22))
    with pytest.raises(ValueError, match="damping: a parameter is either free or held, at one value"):
        Settings(hold=("damping",), held={"damping": 1e-5})


def test_a_parameter_that_is_held_after_all_is_said() -> None:
    found = choose(Settings(), shot()).holding({"damping": "held because the data do not constrain it"}, {})
    assert list(found.free) == ["stiffness_factor", "poisson"]
    (said,) = found.said(shot())
    assert said == (
        "damping = 25 µs as declared, held because the data do not constrain it: the answer holds if that is "
        "right"
    )


def test_a_ratio_beyond_the_search_is_held_and_one_at_the_limit_has_the_limits_value() -> None:
    near, beyond = shot(), shot()
    near.model.poisson, beyond.model.poisson = 0.4999, 0.49991
    assert "poisson" in choose(Settings(), near).free
    found = choose(Settings(), beyond)
    assert list(found.free) == ["stiffness_factor", "damping"]
    assert found.reasons == {"poisson": BEYOND}
    assert not list(found.said(beyond))
    held = choose(Settings(), shot()).holding({"poisson": "at the limit"}, {"poisson": 0.49998})
    assert held.settings.held == {"poisson": 0.49998}
    assert not list(held.said(shot()))  # its value is not the declared one


def test_what_the_data_do_not_tell() -> None:
    box = Box.of({"stiffness_factor": (0.5, 1.5), "poisson": (0.49, 0.4999), "damping": (0.0, 1e-4)})
    x = np.array([1.5, 0.499, 2e-5])
    seen = np.array([9.0, 1e-5, 2.49e-5])  # four sigma are just the range; the stiffness is never held
    assert not_identifiable(box, x, seen) == {}
    assert not_identifiable(box, x, np.array([9.0, 1e-5, 2.51e-5])) == {
        "damping": "held because the data do not constrain it"
    }
    assert "poisson" in not_identifiable(box, x, np.array([9.0, np.inf, 1e-6]))
    at = not_identifiable(box, np.array([1.0, 0.4999, 2e-5]), seen)
    assert at == {"poisson": "held because its optimum lies at the bound 0.4999 of its design"}


OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


def test_every_parameter_is_one_of_the_solver_and_has_the_shots_value() -> None:
    shot = load_shot(OPEN_01)
    own = {name: p for name, p in PARAMETERS.items() if p.belongs_to(shot)}
    assert set(own) <= {f.name for f in fields(Samples)}
    declared = {name: p.held(shot) for name, p in own.items()}
    # As written in its shot.toml; m is 1 by the meaning of the quasi-static curve.
    assert declared == pytest.approx(
        {
            "stiffness_factor": 1.0, "friction": 0.0, "poisson": 0.499, "damping": 25e-6, "mass_damping": 0.0,
            "release_stress": 0.0,
        }
    )  # fmt: skip


@pytest.mark.parametrize("name", PARAMETERS)
def test_default_bounds_are_allowed(name: str) -> None:
    p = PARAMETERS[name]
    assert p.name == name
    assert p.allowed[0] <= p.lower < p.upper <= p.allowed[1]
    for end in p.allowed:
        assert checked_value(name, end) == end
    box = design_box({name: None})
    assert (box.names, box.lower, box.upper) == ((name,), (p.lower,), (p.upper,))


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("poisson", 0.5, r"poisson = 0.5 is not allowed; it must be in \[0, 0.49999\]"),
        ("damping", -1e-6, r"damping = -1e-06 s is not allowed; it must be in \[0, 0.01\] s"),
        ("stiffness_factor", float("nan"), "stiffness_factor = nan is not allowed"),
        ("friction", float("inf"), "friction = inf is not allowed"),
    ],
)
def test_values_outside_are_refused(name: str, value: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        checked_value(name, value)
    with pytest.raises(ValueError, match=words):
        design_box({name: (PARAMETERS[name].lower, value)})


def test_unknown_names_and_reversed_bounds_are_refused() -> None:
    with pytest.raises(ValueError, match="no parameter 'm'; choose from stiffness_factor, friction, poisson"):
        parameter("m")
    with pytest.raises(ValueError, match="lower bound 2 must be below the upper bound 1"):
        design_box({"friction": (2.0, 1.0)})


def test_a_box_keeps_the_order_of_the_names() -> None:
    box = design_box({"friction": (0.0, 1.0), "stiffness_factor": None})
    assert box.names == ("friction", "stiffness_factor")
    assert box.upper == (1.0, 2.5)
