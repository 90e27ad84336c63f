"""Estimates and their verdicts: sums of squares, the k = 2 interval, and each threshold from both sides."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from doe import Box
from doe.surrogates import SurrogateError
from kolsky.inverse.coarse_search import at_inner_face, on_edge
from kolsky.inverse.estimates import estimates, held_values
from kolsky.inverse.result import Estimate, Method, Verdict, disagreements
from kolsky.inverse.run_table import RunTable
from kolsky.inverse.search import Search

BOX = Box.of({"stiffness_factor": (1.0, 2.0), "friction": (0.0, 4.0)})


def made(x: list[float], sigma: float = 0.01, **options: Any) -> dict[str, Estimate]:
    given: dict[str, Any] = {
        "noise": {"force and shape": np.array([sigma, 4.0 * sigma])},
        "numerical": {"mesh": np.array([0.001, 0.002])},
        "mesh_shift": np.array([-0.01, 0.02]),
        "confirmed": True,
        **options,
    }
    return estimates(BOX, np.array(x), **given)


def test_parts_add_in_quadrature() -> None:
    noise = {
        "force and shape": np.array([0.03, 0.0]),
        "flyer motion": np.array([0.04, 0.0]),
        "curve": np.array([0.12, 0.1]),
    }
    numerical = {"mesh": np.array([0.02, 0.0]), "roughness": np.array([0.015, 0.3])}
    found = made([1.5, 1.0], noise=noise, numerical=numerical)
    m, f = found["stiffness_factor"], found["friction"]
    assert (m.sigma_noise, m.sigma_numerical) == pytest.approx((0.13, 0.025))  # 3-4-12-13, 3-4-5
    assert (f.sigma_noise, f.sigma_numerical) == pytest.approx((0.1, 0.3))
    assert m.noise_parts == {"force and shape": 0.03, "flyer motion": 0.04, "curve": 0.12}
    assert m.numerical_parts == {"mesh": 0.02, "roughness": 0.015}
    assert (m.unit, m.value, m.mesh_shift) == ("1", 1.5, -0.01)


def test_the_interval_is_twice_the_combined_uncertainty_to_both_sides() -> None:
    e = replace(
        made([1.5, 1.0])["stiffness_factor"], sigma_noise=0.03, sigma_numerical=0.04, sigma_systematic=0.12
    )
    assert e.sigma == pytest.approx(0.13)
    assert e.interval == pytest.approx((1.24, 1.76))


def test_not_seen_where_four_sigma_are_the_whole_design() -> None:
    just = made([1.5, 2.0], sigma=0.2499)
    assert [e.outcome for e in just.values()] == [Verdict.IDENTIFIED] * 2
    more = made([1.5, 2.0], sigma=0.2501)
    assert [e.outcome for e in more.values()] == [Verdict.NOT_SEEN] * 2


def test_a_value_on_a_plateau_is_not_identified() -> None:
    noise = {"force and shape": np.array([0.03, 0.03]), "curve": np.array([0.04, 0.04])}
    rough = {"mesh": np.array([0.1, 0.1]), "roughness": np.array([0.0499, 0.0501])}
    found = made([1.5, 2.0], noise=noise, numerical=rough)  # all noise is 0.05: 3-4-5
    assert [e.outcome for e in found.values()] == [Verdict.IDENTIFIED, Verdict.PLATEAU]
    assert not Verdict.PLATEAU.identified


@pytest.mark.parametrize(
    ("x", "options", "expected"),
    [
        ([1.5, 2.0], {}, [Verdict.IDENTIFIED, Verdict.IDENTIFIED]),
        ([1.5, 2.0], {"outline": False}, [Verdict.FORCE_ALONE, Verdict.FORCE_ALONE]),
        ([1.5, 2.0], {"confirmed": False}, [Verdict.DISAGREEING, Verdict.DISAGREEING]),
        ([1.5, 4.0], {}, [Verdict.CONDITIONAL, Verdict.AT_BOUND]),
        ([1.0, 2.0], {}, [Verdict.AT_BOUND, Verdict.CONDITIONAL]),
        ([1.5, 4.0], {"confirmed": False}, [Verdict.DISAGREEING, Verdict.AT_BOUND]),
        ([1.5, 4.0], {"sigma": 0.3}, [Verdict.NOT_SEEN, Verdict.AT_BOUND]),
        ([1.5, 2.0], {"sigma": 0.3, "confirmed": False}, [Verdict.NOT_SEEN, Verdict.NOT_SEEN]),
    ],
)
def test_verdicts_in_their_order(x: list[float], options: dict[str, Any], expected: list[Verdict]) -> None:
    assert [e.outcome for e in made(x, **options).values()] == expected


def test_a_mesh_moves_what_is_seen_and_inside_and_nothing_past_a_bound() -> None:
    correction = np.array([0.02, -0.3])

    def found(x: list[float], sigma: float = 0.01) -> list[tuple[float, float, Verdict]]:
        each = made(x, sigma=sigma, mesh_correction=correction).values()
        assert [e.searched for e in each] == [(1.0, 2.0), (0.0, 4.0)]
        assert all(e.on_mesh == pytest.approx(at) for e, at in zip(each, x, strict=True))
        return [(e.value, e.mesh_correction, e.outcome) for e in each]

    good, bound, other = Verdict.IDENTIFIED, Verdict.AT_BOUND, Verdict.CONDITIONAL
    assert found([1.5, 2.0]) == [(1.52, pytest.approx(0.02), good), (1.7, pytest.approx(-0.3), good)]
    # The correction would take the second below nothing: it lies at nothing.
    assert found([1.5, 0.25]) == [(1.52, pytest.approx(0.02), other), (0.0, -0.25, bound)]
    assert found([1.99, 2.0]) == [(2.0, pytest.approx(0.01), bound), (1.7, pytest.approx(-0.3), other)]
    # At a bound it stays, also where the correction leads inside; what is not seen has no correction.
    assert found([1.5, 4.0]) == [(1.52, pytest.approx(0.02), other), (4.0, 0.0, bound)]
    assert found([1.5, 0.25], sigma=0.3) == [(x, 0.0, Verdict.NOT_SEEN) for x in (1.5, 0.25)]


def test_an_interval_ends_where_the_search_does() -> None:
    e = replace(made([1.1, 2.0])["stiffness_factor"], sigma_noise=0.3, sigma_numerical=0.4)
    assert e.interval == pytest.approx((1.0, 2.0))
    assert e.within(0.05) == pytest.approx((1.05, 1.15))
    assert replace(e, searched=Estimate.searched).interval == pytest.approx((0.1, 2.1))


def test_a_coordinate_lies_on_a_bound_within_a_hundred_thousandth_of_the_edge() -> None:
    assert on_edge(np.array([1.0 + 0.9e-5, 4.0 - 3.9e-5]), BOX).tolist() == [True, True]
    assert on_edge(np.array([1.0 + 1.1e-5, 4.0 - 4.1e-5]), BOX).tolist() == [False, False]
    local = Box.of({"stiffness_factor": (1.4, 1.6), "friction": (2.0, 4.0)})
    assert at_inner_face(np.array([1.4, 3.0]), local, BOX)
    assert not at_inner_face(np.array([1.5, 4.0]), local, BOX)  # it would leave the design


def test_a_held_value_stands_for_the_shots_own(monkeypatch: pytest.MonkeyPatch) -> None:
    from kolsky.inverse.parameters import PARAMETERS

    for name in PARAMETERS:
        monkeypatch.setitem(PARAMETERS, name, replace(PARAMETERS[name], held=lambda shot: 7.0))
    shot = SimpleNamespace(relaxation=None)
    found = held_values(shot, BOX, {"poisson": 0.45})  # type: ignore[arg-type]
    assert found == {"poisson": 0.45, "damping": 7.0, "mass_damping": 7.0, "release_stress": 7.0}


def test_methods_agree_within_a_quarter_of_the_half_width() -> None:
    def method(m: float) -> Method:
        return Method.compared("x", {"m": m}, answer={"m": 1.0}, half_width={"m": 0.02}, runs=1)

    assert method(1.01).distances == {"m": pytest.approx(0.5)}
    assert list(disagreements([method(1.0049), method(0.9951)])) == []
    (far,) = disagreements([method(0.9949)])
    assert far[2] == pytest.approx(-0.255)
    (unknown,) = disagreements([method(float("nan"))])
    assert np.isnan(unknown[2])


def test_a_cost_without_a_surrogate_leaves_the_papers_route_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*given: object) -> None:
        raise SurrogateError("ill-conditioned")

    monkeypatch.setattr("kolsky.inverse.search.paper_route", refuse)
    problem = SimpleNamespace(box=Box.of({"stiffness_factor": (0.5, 2.0)}))
    runner: Any = SimpleNamespace(problem=problem, table=RunTable(("stiffness_factor",)))
    assert Search(runner, Mock(), Mock()).paper_route() is None
