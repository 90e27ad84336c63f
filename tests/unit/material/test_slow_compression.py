"""Slow compressions: the duration for a requested error by hand, and every law compared with its closed
form."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from kolsky_command import json_of, run_kolsky

from explicit.materials import LAWS
from explicit.materials.families import InvariantLaw
from explicit.relaxation import uniaxial_stress
from kolsky.base.apparatus import Specimen
from kolsky.inverse import simulate
from kolsky.material import slow_compression as module
from kolsky.material.slow_compression import SlowNumerics

SPECIMEN = Specimen(9.5e-3, 6.5e-3, 870.0)
STRAIN = np.array([0.01, 0.1, 0.3])
STATIC = np.array([1e3, 1e4, 4e4])


def made(monkeypatch: pytest.MonkeyPatch, order: float, size: float) -> list[float]:
    """Runs whose force is the static one times 1 + size / duration^order, ten times that at the outset."""
    asked: list[float] = []

    def runs(law: Any, specimen: Any, strain: Any, *, numerics: SlowNumerics, **_: Any) -> Any:
        asked.append(numerics.passages)
        wrong = size * np.array([10.0, 1.0, 0.5]) / numerics.passages**order
        return module.SlowRun(STATIC * (1.0 + wrong), np.full(3, 5e-3), 0.0, 0.0, 0.0)

    monkeypatch.setattr(module, "slow_run", runs)
    return asked


def compress(**options: Any) -> module.SlowCompression:
    return module.slow_compression(None, SPECIMEN, STRAIN, faces="bonded", **options)  # type: ignore[arg-type]


def test_an_error_of_first_order_is_found_and_met(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = made(monkeypatch, 1.0, 1.2)
    found = compress(error=2e-3)
    # 60 and 120 passages differ by 1.2 / 120: the second is still wrong by that, 1 %, five times too much;
    # 1.2 x 5 times as long it is wrong by 1.2 / 720 = 0.17 %.
    assert asked == [60.0, 120.0, pytest.approx(720.0, abs=15.0)]
    assert found.errors[1] == pytest.approx(0.01, rel=0.02)
    truth = 1.2 / asked[-1]
    assert found.errors[-1] == pytest.approx(truth, rel=0.02)
    assert found.error[0] == pytest.approx(10.0 * truth, rel=0.03)  # the outset is not what is judged
    np.testing.assert_allclose(found.test.stress[1], STATIC[1] * (1.0 + truth))
    np.testing.assert_allclose(found.force, found.test.stress * np.pi * 4.75e-3**2)


def test_an_error_of_second_order_is_never_below_the_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = made(monkeypatch, 2.0, 40.0)
    found = compress(error=2e-3)
    truth = 40.0 / np.array(asked[1:]) ** 2
    assert (np.array(found.errors[1:]) >= truth).all()
    assert found.errors[-1] <= 2e-3


def test_a_force_is_proportional_to_the_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    made(monkeypatch, 1.0, 0.0)
    np.testing.assert_allclose(compress(stiffness_factor=1.12).test.stress, 1.12 * STATIC)


def test_what_cannot_be_reached_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = made(monkeypatch, 0.1, 1.0)  # an error that hardly falls
    with pytest.raises(ValueError, match="more than 8000"):
        compress(error=1e-3)
    assert max(asked) <= 8000.0
    for error in (0.0, 0.2, float("nan")):
        with pytest.raises(ValueError, match="wanted error"):
            compress(error=error)
    with pytest.raises(ValueError, match="stiffness_factor"):
        compress(stiffness_factor=0.0)


def test_a_test_that_is_not_at_rest_is_said() -> None:
    def said(**changed: float) -> list[str]:
        fine = {"kinetic_share": 0.005, "face_difference": 0.005, "past_data": 0.005}
        return simulate.slow_test_warnings(SimpleNamespace(test=SimpleNamespace(**{**fine, **changed})))  # type: ignore[arg-type]

    assert said() == []
    assert "not at rest" in said(kinetic_share=0.011)[0]
    assert "not at rest" in said(face_difference=0.011)[0]
    assert "past the quasi-static curve" in said(past_data=0.011)[0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--slow", "-p", "damping=10us"], "damping has no effect"),
        (["--slow", "--element", "fbar"], "--element has no effect"),
        (["--slow", "--vtu"], "--vtu has no effect"),
        (["--slow", "--strain", "120 %"], "< 100 %"),
        (["--error", "1 %"], "--error needs --slow"),
    ],
)
def test_options_that_do_not_go_together(options: list[str], words: str) -> None:
    refused = run_kolsky("simulate", "runs/open-01", *options, code=2)
    assert words in refused.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gent", "ogden2"])
def test_any_law_without_friction_is_its_closed_form(name: str) -> None:
    law = LAWS[name].example()
    numerics = SlowNumerics(mesh=(4, 6), passages=module.FIRST, poisson=0.499)
    strain = np.array([0.05, 0.2, 0.4])
    found = module.slow_compression(
        law, SPECIMEN, strain, faces="frictionless", error=5e-3, numerics=numerics
    )
    exact = -uniaxial_stress(law, 1.0 - strain)
    assert found.errors[-1] <= 5e-3
    # The wanted error, and a compressibility of 1 - 2 nu = 0.002.
    np.testing.assert_allclose(found.test.stress, exact, rtol=5e-3 + 3e-3)
    assert isinstance(law, InvariantLaw) == (name == "gent")


@pytest.mark.slow  # 5 s of one core
def test_the_command_compresses_a_law_that_the_shot_declares(shot: Path, tmp_path: Path) -> None:
    """Without friction: the closed form of the law times the factor, over the whole face."""
    text = (shot / "shot.toml").read_text("utf-8")
    law = """
[law]
name = "gent"
parameters = { mu = "26 kPa", Jm = 20.0 }
branch = "compression"
largest_strain = "60 %"
relative_sigma = "3 %"
baseline = true
"""
    (shot / "shot.toml").write_text(text.replace('"bonded"', '"frictionless"') + law)
    words = ["--mesh", "4x6", "--strain", "40 %", "--error", "0.5 %", "-p", "stiffness_factor=1.2"]
    said = json_of("simulate", shot, "--slow", *words, "--out", tmp_path / "o")
    exact = 1.2 * float(-uniaxial_stress(LAWS["gent"](26e3, 20.0), np.array([0.6]))[0]) * np.pi * 4.75e-3**2
    # The wanted error, and a compressibility of 1 - 2 nu = 0.002 of the shot.
    assert said["last_force"] == pytest.approx(exact, rel=5e-3 + 3e-3)
    assert said["error"] <= 5e-3
