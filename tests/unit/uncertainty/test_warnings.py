"""Warnings: each is raised only by its cause, with its numbers."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import CHECKS, failed, synthetic

from doe import Box
from explicit import Outcome
from kolsky.base.apparatus import Interface
from kolsky.inverse.estimates import estimates
from kolsky.inverse.forward import coarser_graded, graded
from kolsky.inverse.result import Identification, Method, ParameterProfile, RouteDifference, Verdict
from kolsky.inverse.settings import Numerics
from kolsky.studies.rates.records import COUNTED
from kolsky.uncertainty.analyse import UncertaintyAnalysis, analysis_warnings
from kolsky.uncertainty.mesh_error import LostRun
from kolsky.uncertainty.warnings import collect_warnings

BONDED = Interface(faces="bonded", side="bonded")
SLIDING = Interface(faces="coulomb", side="coulomb", friction=0.3)


def clean(**changes: Any) -> Identification:
    """A result with nothing to say about."""
    result = synthetic(nodes=False)
    design = replace(result.design, outcomes=("COMPLETED",) * len(result.design.outcomes))
    terms = replace(result.terms, n_outside=0)
    response = replace(result.response, extrapolated_share=np.array([0.009]))
    surrogate = {**result.surrogate, "counted_points": float(terms.n_shape)}
    result = replace(result, design=design, terms=terms, response=response, surrogate=surrogate)
    return replace(result, **changes)


def estimate(**changes: Any) -> Identification:
    e = clean().estimates["stiffness_factor"]
    return clean(estimates={"stiffness_factor": replace(e, **changes)})


def said(result: Identification, interface: Interface = BONDED, lost: int = 0, **checks: float) -> str:
    """The only warning."""
    found = collect_warnings(result, checks={**CHECKS, **checks}, interface=interface, lost_replicates=lost)
    assert len(found) == 1, found
    assert "\n" not in found[0]
    assert not found[0].endswith(".")
    return found[0]


def test_nothing_to_say() -> None:
    assert collect_warnings(clean(), checks=CHECKS, interface=BONDED) == ()


def test_strained_past_the_curve() -> None:
    # A uniaxial test at the stretch 0.3 has I1 = 0.09 + 2 / 0.3 and s = sqrt(I1 - 3) = 1.9390.
    s = np.sqrt(0.09 + 2.0 / 0.3 - 3.0)
    response = replace(
        clean().response, extrapolated_share=np.array([0.3014]), largest_strain_measure=np.array([s])
    )
    text = said(clean(response=response), curve_last_s=1.64, curve_last_strain=-0.64)
    for words in (
        "30 % of",
        "reached 1.94",
        "ends at 1.64",
        "strain -0.64",
        "the law is extrapolated there",
        "strain of -0.7 ",
    ):
        assert words in text
    # In tension: lam^3 - (3 + s^2) lam + 2 has the root 0.3; dividing by it leaves lam^2 + 0.3 lam - 2 / 0.3,
    # whose positive root is 2.436.
    lam = (-0.3 + np.sqrt(0.09 + 8.0 / 0.3)) / 2.0
    assert lam == pytest.approx(2.4363, abs=5e-5)
    assert "strain of +1.4 " in said(clean(response=response), curve_last_s=1.0, curve_last_strain=0.64)


def test_hourglass_control_takes_part() -> None:
    energy = clean().response.energy
    # 0.9 % stored and 0.3 % dissipated of the largest strain energy: together they pass 1 %.
    most = energy.elastic.max()
    changed = replace(
        energy,
        hourglass=0.009 * most * np.ones_like(energy.elastic),
        hourglass_damping=0.003 * most * np.ones_like(energy.elastic),
        external=energy.external - energy.artificial + 0.012 * most,  # the balance stays as it was
    )
    text = said(clean(response=replace(clean().response, energy=changed)))
    assert text.startswith("hourglass control stored and dissipated 1.2 % of the strain energy")
    assert "--element fbar" in text


def test_flyer_noise() -> None:
    assert said(clean(), flyer_noise_scale=1.31, flyer_chi2_per_dof=1.75).startswith(
        "the flyer's noise is 1.3 "
    )
    # chi-square 0.25 per degree of freedom: residuals of half the declared sigma.
    text = said(clean(), flyer_chi2_per_dof=0.25)
    assert "about 2 times too large" in text
    assert "about 2 times too small" in said(clean(), flyer_chi2_per_dof=4.0)
    assert collect_warnings(clean(), checks={**CHECKS, "flyer_chi2_per_dof": 0.6}, interface=BONDED) == ()


def test_force_noise_that_is_not_white() -> None:
    # White noise of 400 samples correlates by less than 3 / sqrt(400) = 0.15; at 0.6 the factor is 2.
    text = said(clean(), force_noise_correlation=0.6)
    assert "correlate by 0.6 (white noise: within 0.15)" in text
    assert text.endswith("about 2")
    assert (
        collect_warnings(clean(), checks={**CHECKS, "force_noise_correlation": -0.14}, interface=BONDED) == ()
    )


def test_points_that_do_not_count() -> None:
    terms = replace(clean().terms, n_outside=16, n_shape=2588)
    surrogate = {**clean().surrogate, "counted_points": 2588.0}
    assert said(clean(terms=terms, surrogate=surrogate)).startswith("16 of 2604 outline points lie outside")
    surrogate["counted_points"] = 2500.0
    terms = replace(terms, n_outside=0)
    assert said(clean(terms=terms, surrogate=surrogate)).startswith("88 of 2588 outline points were not")


def test_friction_replaces_the_interface() -> None:
    result = synthetic(("stiffness_factor", "friction"), nodes=False)
    c = clean()
    result = replace(result, design=c.design, terms=c.terms, response=c.response, surrogate=c.surrogate)
    assert "Coulomb's law replaced the interface that the shot declares (faces bonded, side bonded)" in said(
        result
    )
    assert collect_warnings(result, checks=CHECKS, interface=SLIDING) == ()
    held = {**c.provenance, "settings": {"held": {"friction": 0.5}}}
    assert "Coulomb's law replaced" in said(clean(provenance=held))


def test_runs_that_did_not_complete() -> None:
    outcomes = ["COMPLETED"] * 22
    outcomes[3] = outcomes[5] = "INVERTED"
    outcomes[17] = "STEP_COLLAPSED"
    design = replace(
        clean().design, outcomes=tuple(outcomes), end_times=np.full(22, 1.2e-3),
        failed_elements=np.full(22, 351), failed_places=np.tile([4.6e-3, 6.4e-3], (22, 1)),
    )  # fmt: skip
    texts = collect_warnings(clean(design=design), checks=CHECKS, interface=BONDED)
    assert len(texts) == 3  # the count, and the first run of each kind with its moment, element and cure
    count = "3 of 22 runs did not complete (2 in design: INVERTED, 1 in refinement: STEP_COLLAPSED)"
    assert texts[0] == f"{count}; the surrogate uses the others"
    for text, run, outcome in zip(
        texts[1:], (3, 17), (Outcome.INVERTED, Outcome.STEP_COLLAPSED), strict=True
    ):
        assert text.startswith(
            f"run {run} (stiffness_factor = {design.points[run, 0]:.4g}) ended {outcome.name}"
        )
        assert "at 1200.0 us in element 351 (R = 4.60 mm, Y = 6.40 mm)" in text
        assert outcome.cure in text
    assert "4 replicates of the input noise did not complete" in said(clean(), lost=4)


def routes(force: float, shape: float) -> Identification:
    """Force and outline at given optima; 0.004 is the standard uncertainty of their difference."""
    name, result = "stiffness_factor", clean()
    values = {"force only": force, "shape only": shape}
    found = [
        replace(r, parameters={name: values[r.name]}, correction={name: 0.001}) if r.name in values else r
        for r in result.routes
    ]
    difference = RouteDifference({name: force - shape}, {name: 0.004}, ())
    return clean(routes=tuple(found), route_difference=difference)


def test_force_and_shape_that_disagree() -> None:
    # 2.5 times 0.004; what each route alone is uncertain by does not matter.
    assert collect_warnings(routes(1.12, 1.1299), checks=CHECKS, interface=BONDED) == ()
    text = said(routes(1.12, 1.1301))
    assert "1.12 by the force alone, 1.1301 by the outline alone" in text
    assert "k = 2.5 uncertainty of their difference, 0.01;" in text
    assert "edge" not in text
    end = float(clean().curves[0].x[-1])  # of the box on the refined mesh: the correction lies beyond
    assert "at the edge of the box that was searched" in said(routes(1.12, end + 0.001))
    unknown = replace(routes(1.12, end), route_difference=None)  # an old file
    assert collect_warnings(unknown, checks=CHECKS, interface=BONDED) == ()


def test_a_cost_of_the_paper_without_a_surrogate() -> None:
    routes = tuple(route for route in clean().routes if route.name != "paper")
    assert len(routes) == len(clean().routes) - 1
    assert "no surrogate can be fitted to the cost Phi" in said(clean(routes=routes))
    assert collect_warnings(clean(routes=routes[:1]), checks=CHECKS, interface=BONDED) == ()


def test_an_interval_past_the_design() -> None:
    # Bounds 0.75 to 1.45; u = hypot(0.0019, 0.0016) = 0.00248.
    assert collect_warnings(estimate(value=1.4450), checks=CHECKS, interface=BONDED) == ()
    assert "past the bounds of its design (0.75 to 1.45)" in said(estimate(value=1.4451))
    at_bound = estimate(value=1.45, outcome=Verdict.AT_BOUND)
    assert collect_warnings(at_bound, checks=CHECKS, interface=BONDED) == ()


def test_numbers_that_cannot_be_trusted() -> None:
    # Noise 0.0019, U = 0.0038 without the mesh: half of it with a mesh's part of 0.0033.
    less = estimate(sigma_numerical=0.0032, numerical_parts={})
    assert collect_warnings(less, checks=CHECKS, interface=BONDED) == ()
    most = said(estimate(sigma_numerical=0.0034, numerical_parts={}))
    assert "most of the uncertainty of stiffness_factor: U (k = 2) is 0.0078 and would be 0.0038" in most
    rough = {"mesh": 0.0001, "roughness": 0.002}
    assert "so rough that it contributes more to the uncertainty of stiffness_factor (0.002)" in said(
        estimate(sigma_numerical=0.002, numerical_parts=rough)
    )
    flat = said(estimate(value=1.3, sigma_numerical=0.002, numerical_parts=rough))
    assert "between 1.296 and 1.304 the misfit is flat" in flat  # twice 0.002 to both sides
    text = said(replace(estimate(outcome=Verdict.DISAGREEING), surrogate={"check_shift_sigmas": 0.63}))
    assert "still moved the optimum by 0.63 sigma" in text
    parts = {"force and shape": 0.0019, "flyer motion": 0.001}
    assert (
        said(estimate(noise_parts=parts)) == "the interval does not include the noise of the material curve"
    )
    small = replace(clean().terms, chi2_shape=clean().terms.n_shape / 4.0)
    assert "2 times smaller than its declared sigma" in said(clean(terms=small))
    ledger = clean().response.energy
    wrong = replace(clean().response, energy=replace(ledger, external=1.1 * ledger.external))
    assert "% of the simulation's external work is not accounted for" in said(clean(response=wrong))


def test_a_failed_result_has_no_traceback() -> None:
    found = collect_warnings(failed(), checks=CHECKS, interface=BONDED)
    assert any("22 of 22 runs did not complete" in text for text in found)


# Each threshold from both sides: what must be said is said, what need not be is not.


def texts(result: Identification, **checks: float) -> int:
    return len(collect_warnings(result, checks={**CHECKS, **checks}, interface=BONDED))


@pytest.mark.parametrize(
    ("checks", "said"),
    [
        ({"flyer_noise_scale": 1.29}, 0),
        ({"flyer_noise_scale": 1.31}, 1),
        # A sigma wrong by 1.3 is a chi-square of 1.69 or 1 / 1.69 = 0.592.
        ({"flyer_chi2_per_dof": 1.68}, 0),
        ({"flyer_chi2_per_dof": 1.70}, 1),
        ({"flyer_chi2_per_dof": 0.60}, 0),
        ({"flyer_chi2_per_dof": 0.58}, 1),
        ({"front_noise_scale": 1.29}, 0),
        ({"front_noise_scale": 1.31}, 1),
        # White noise of 400 samples: 3 / 20.
        ({"force_noise_correlation": 0.149}, 0),
        ({"force_noise_correlation": 0.151}, 1),
        ({"force_noise_correlation": -0.151}, 1),
        ({"force_noise_correlation": 0.151, "force_baseline_samples": 300}, 0),
        ({"conditioned_ratio": 0.9}, 1),
        ({"symmetry_end": 1.2e-3, "window_end": 1.1e-3}, 1),
    ],
)
def test_thresholds_of_the_measurements(checks: dict[str, float], said: int) -> None:
    assert texts(clean(), **checks) == said


def test_the_window_and_the_flyers_direction() -> None:
    assert "before the window ends at 1.3 ms" in said(clean(), symmetry_end=1.2e-3, window_end=1.3e-3)
    assert said(clean(), symmetry_end=1.2e-3, window_end=1.1e-3).startswith(
        "the window ends at 1.1 ms, where"
    )
    text = said(clean(), conditioned_ratio=0.8)
    assert "the stress of the conditioned curve is 0.8 times as large" in text
    assert "about 1.25 times as large" in text


@pytest.mark.parametrize(("share", "said"), [(0.0099, 0), (0.0101, 1)])
def test_threshold_of_strain_past_the_curve(share: float, said: int) -> None:
    response = replace(clean().response, extrapolated_share=np.array([share]))
    assert texts(clean(response=response)) == said


@pytest.mark.parametrize(("share", "said"), [(0.0099, 0), (0.0101, 1)])
def test_threshold_of_hourglass_control(share: float, said: int) -> None:
    energy = clean().response.energy
    most, zero = energy.elastic.max(), np.zeros_like(energy.elastic)
    changed = replace(
        energy,
        hourglass=zero + share * most,
        hourglass_damping=zero,
        external=energy.external - energy.artificial + share * most,
    )
    assert texts(clean(response=replace(clean().response, energy=changed))) == said


@pytest.mark.parametrize(("share", "said"), [(0.009, 0), (0.011, 1)])
def test_threshold_of_the_energy_balance(share: float, said: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kolsky.uncertainty.warnings.worst_imbalance", lambda response: share)
    assert texts(clean()) == said


@pytest.mark.parametrize(("ratio", "said"), [(1.29, 0), (1.31, 1)])
def test_threshold_of_the_outlines_noise(ratio: float, said: int) -> None:
    terms = replace(clean().terms, chi2_shape=clean().terms.n_shape / ratio**2)
    assert texts(clean(terms=terms)) == said


@pytest.mark.parametrize(
    ("numerical", "parts", "said"),
    [
        (0.0032, {}, 0),
        (0.0034, {}, 1),
        (0.0030, {"mesh": 0.0018, "roughness": 0.0018}, 0),
        (0.0030, {"mesh": 0.0031, "roughness": 0.0018}, 1),  # sigma is 0.00355
        (0.0030, {"mesh": 0.0018, "roughness": 0.0020}, 1),
    ],
)
def test_thresholds_of_the_numerics(numerical: float, parts: dict[str, float], said: int) -> None:
    # The noise is 0.0019: that is the limit of roughness; a mesh's part makes U twice what it is without.
    assert texts(estimate(sigma_numerical=numerical, numerical_parts=parts)) == said


@pytest.mark.parametrize(("distance", "said"), [(0.24, 0), (0.26, 1), (-0.26, 1), (float("nan"), 1)])
def test_threshold_of_methods_that_disagree(distance: float, said: int) -> None:
    method = Method("x", {"stiffness_factor": 1.1}, {"stiffness_factor": distance}, 1, 0, True, "at rest")
    assert texts(clean(methods=(method,))) == said


def test_the_cure_of_an_optimum_that_is_not_confirmed() -> None:
    """Steps start from the coarser mesh. Where a surface slides there are none, and the response is rough."""
    steps = estimate(outcome=Verdict.DISAGREEING, numerical_parts={"mesh": 0.001})
    assert "give a finer one, such as 32x43" in said(steps)
    rough = estimate(outcome=Verdict.DISAGREEING, numerical_parts={"mesh": 0.001, "roughness": 0.001})
    assert "shrink the bounds (--free NAME=LOW:HIGH)" in said(rough)
    assert "32x43" not in said(rough)


@pytest.mark.parametrize(
    ("error", "share", "kind", "said", "own"),
    [
        (0.38, 1.0, "identified", 0, True),  # a tenth of 3.84
        (0.39, 1.0, "identified", 0, False),
        (1.67, 1.0, "identified", 0, False),  # 0.4375 of it: the end of a parabola a quarter too far in
        (1.69, 1.0, "identified", 1, False),
        (2.88, 0.25, "identified", 0, False),  # 3/4 of it: four times the variance of a quarter, 1.32 U
        (2.88, 0.26, "identified", 1, False),  # sqrt(1.78) = 1.334
        (3.85, 0.01, "identified", 1, False),  # as large as its level: the profile tells nothing
        (0.1, 1.0, "ridge", 1, True),
    ],
)
def test_a_profile_is_confirmed_within_a_tenth_of_its_level_and_said_where_the_interval_may_be_a_third_wider(
    error: float, share: float, kind: str, said: int, own: bool
) -> None:
    x = np.linspace(1.0, 1.2, 5)
    profile = ParameterProfile(
        "stiffness_factor", x, 0.0 * x, x[:, None], 3.84, 1.0, (1.0, 1.2), (1.0, 1.2), kind, "it is so", error
    )
    assert len(list(analysis_warnings((profile,), None, np.array([share])))) == said
    found = SimpleNamespace(optimum=np.array([1.1]))
    analysis: Any = SimpleNamespace(found=found, profiles=(profile,), runs=3, posterior=None)
    (method,) = UncertaintyAnalysis.methods(analysis, estimate().estimates)
    assert method.converged is own


def test_lost_runs_that_were_to_tell_the_meshs_error() -> None:
    usual, refined = Numerics(), (64, 86)

    def texts(*lost: LostRun) -> tuple[str, ...]:
        return collect_warnings(clean(), checks=CHECKS, interface=BONDED, lost_meshes=lost)

    ended = "INVERTED at 280 us: an element turned inside out"
    fine, few = texts(
        LostRun(graded(usual, refined), ended, is_graded=True),
        LostRun(coarser_graded(usual, refined), "", is_graded=True),
    )
    across, along = clean().mesh
    assert fine.startswith(f"the run at the answer on the graded mesh of 64 x 86 elements failed ({ended});")
    assert f"come from the coarser mesh of {across} x {along} elements, which usually makes that part" in fine
    assert "give another --refined-mesh" in fine
    assert few.startswith(
        "the run at the answer on the graded mesh of 40 x 54 elements failed; the correction"
    )
    (element,) = texts(LostRun(usual.with_other_element(), ended, is_graded=False))
    assert element.startswith(f"the run at the answer with fbar elements on 20 x 27 failed ({ended});")
    assert "graded" not in element
    assert "give another --mesh" in element
    assert texts() == ()


BOX = Box(("stiffness_factor", "friction", "damping"), (0.75, 0.05, 1e-6), (1.5, 1.0, 6e-5))
INSIDE = (1.1, 0.3, 2.5e-5)


def verdicts(optimum, *, confirmed=True, outline=True, sigma=(0.01, 0.02, 1e-6)):
    zero = {"mesh": np.zeros(3)}
    found = estimates(
        BOX, np.array(optimum), noise={"force and shape": np.array(sigma)}, numerical=zero,
        mesh_shift=np.zeros(3), confirmed=confirmed, outline=outline,
    )  # fmt: skip
    return [found[name].outcome for name in BOX.names]


def test_inside_and_confirmed_all_are_identified():
    assert verdicts(INSIDE) == [Verdict.IDENTIFIED] * 3
    assert verdicts(INSIDE, outline=False) == [Verdict.FORCE_ALONE] * 3


@pytest.mark.parametrize("friction", [0.05, 1.0])
def test_beside_one_at_its_bound_the_others_hold_only_with_it(friction):
    optimum = (INSIDE[0], friction, INSIDE[2])
    assert verdicts(optimum) == [Verdict.CONDITIONAL, Verdict.AT_BOUND, Verdict.CONDITIONAL]
    assert verdicts(optimum, outline=False)[0] is Verdict.CONDITIONAL
    assert Verdict.CONDITIONAL not in COUNTED  # so a fit over shots leaves it out, and says so


def test_what_is_worse_is_said_first():
    at_bound = (INSIDE[0], 1.0, INSIDE[2])
    assert verdicts(at_bound, confirmed=False)[0] is Verdict.DISAGREEING
    # Four standard uncertainties of 0.2 are longer than the design's 0.75.
    assert verdicts(at_bound, sigma=(0.2, 0.02, 1e-6))[0] is Verdict.NOT_SEEN
