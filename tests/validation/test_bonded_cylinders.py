"""Bonded cylinders simulated by FElupe: their laws, their draws, and the fitted constants."""

from dataclasses import replace

import numpy as np
import pytest

from populations import bonded_cylinders

pytest.importorskip("felupe")
SEED = 27182  # of no recorded study


@pytest.mark.parametrize("number", range(len(bonded_cylinders.LAWS)))
def test_felupes_laws_are_their_own_derivatives(number):
    """The tangent is the difference of the stress, for each of the laws, under shear and change of volume."""
    law = bonded_cylinders.drawn(SEED)[number].felupe
    F = np.eye(3) + np.array([[0.1, 0.2, 0.0], [-0.05, -0.1, 0.03], [0.02, 0.0, 0.04]])
    F, h = F[..., None, None], 1e-6
    (A,) = law.hessian([F])
    for k, l in np.ndindex(3, 3):
        step = np.zeros_like(F)
        step[k, l] = h
        high, low = (law.gradient([F + sign * step])[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose(A[:, :, k, l], (high - low) / (2.0 * h), rtol=1e-6, atol=1e-6 * A.max())


def test_the_draws_fill_the_ranges_that_were_asked_for():
    made = bonded_cylinders.drawn(SEED)
    assert [one.law for one in made[: len(bonded_cylinders.LAWS)]] == list(bonded_cylinders.LAWS)
    for values, low, high in (
        ([one.slenderness for one in made], 0.2, 1.2),
        ([one.strain for one in made], 0.05, 0.30),
    ):
        bins = np.histogram(values, bins=bonded_cylinders.SPECIMENS, range=(low, high))[0]
        assert (bins == 1).all()


def test_a_constant_counts_where_it_is_determined_and_outside():
    one = replace(bonded_cylinders.drawn(SEED)[1], constants={"C10": 100.0, "C20": 50.0})
    found = {"constants": {"C10": 102.1, "C20": 90.0}, "sigma": {"C10": 1.0, "C20": 1.0}}
    assert bonded_cylinders.judged(one, found | {"not_determined": ["C20"]})["outside"] == ["C10"]
    found["sigma"] = {"C10": 1.1, "C20": 20.1}
    assert bonded_cylinders.judged(one, found | {"not_determined": []}) == {
        "right": True,
        "outside": [],
        "determined": ["C10", "C20"],
    }
    assert not bonded_cylinders.judged(one, {"refused": "error"})["right"]


@pytest.mark.slow
def test_constants_of_a_fresh_cylinder_are_inside_their_intervals(tmp_path):
    """One specimen on FElupe's meshes of 9 and 6 elements across."""
    one = next(
        one for one in bonded_cylinders.drawn(SEED) if 0.5 < one.slenderness < 1.0 and one.strain < 0.15
    )
    strain, force, mesh = bonded_cylinders.force_of(one, elements=9)
    assert mesh < 5e-3
    noise = np.random.default_rng([SEED, 1]).normal(0.0, bonded_cylinders.NOISE, bonded_cylinders.READINGS)
    found = bonded_cylinders.answer(one, strain, force * (1.0 + noise), tmp_path)
    assert bonded_cylinders.judged(one, found)["right"], found


def test_the_recorded_study_is_as_right_as_its_page_says():
    """All of a seed on which nothing was chosen. Moduli are known within 1 %."""
    rows = bonded_cylinders.recorded()
    assert len(rows) == bonded_cylinders.SPECIMENS
    assert all(row["judged"]["right"] for row in rows)
    modulus = [
        2.0 * row["found"]["sigma"][name] / row["found"]["constants"][name]
        for row in rows
        for name in ("mu", "C10")
        if name in row["judged"]["determined"]
    ]
    assert np.median(modulus) < 0.01
