"""Parts around the specimen: elastic parts, the incident bar, and a transducer behind the face."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from coupled_parts import couple
from kolsky_command import json_of
from shot_folders import shot_in

import explicit
import kolsky
from explicit.bars import Section, elastic_bar
from kolsky.base.apparatus import Bar, ElasticBody
from kolsky.base.errors import InputError
from kolsky.inverse.forward import Forward, at_transducer, mass_before
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict
from kolsky.inverse.problem import PreparedShot, prepare_shot
from kolsky.inverse.settings import Numerics, Settings
from kolsky.inverse.simulate import simulate
from kolsky.shot.records import Shot

# Parts around the specimen: elastic parts behind it and in the flyer, and the incident force as data.

NUMERICS = Numerics(mesh=(5, 7), threads=1)
BAR = Bar(15e-3, 0.5, 190e9, 8048.0)
SOFT = Bar(9.5e-3, 0.5, 5e9, 1200.0, 0.0)
"""Light and soft, as wide as the specimen and with no Poisson's ratio: one-dimensional in a mesh too."""
PLATEN, SENSOR = Bar(15e-3, 10e-3, 190e9, 8048.0), Bar(15e-3, 16e-3, 190e9, 6594.0)
FLYER = ElasticBody("bar", (PLATEN, SENSOR, PLATEN), transducer_depth=14e-3, seen_at=5e-3)


COMPARED = ("[incident_force]", "[incident_force]\ncompared = true\n#")
PARTS = """support = "mesh"
element_size = "5 mm"
transducer_depth = "14 mm"
[transmission.parts.platen]
diameter = "15 mm"
length = "10 mm"
youngs_modulus = "190 GPa"
density = "8048 kg/m^3"
[transmission.parts.bar]
diameter = "15 mm"
length = "490 mm"
youngs_modulus = "190 GPa"
density = "8048 kg/m^3"
"""


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    """A third of the shipped shot, its incident force compared."""
    found = kolsky.load_shot(shot_in(tmp_path_factory.mktemp("shot") / "shot", COMPARED))
    first = found.window[0]
    return replace(found, window=(first, first + 0.3 * (found.window[1] - first)))


def run(shot: Shot, numerics: Numerics = NUMERICS) -> tuple[PreparedShot, explicit.Response]:
    prepared = prepare_shot(shot)
    return prepared, prepared.forward.run({}, numerics)


def apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(((a - b) ** 2).mean() / (b**2).mean()))


def test_a_meshed_bar_is_the_characteristic_one_where_waves_are_long(shot: Shot) -> None:
    body = ElasticBody("mesh", (SOFT,), element_size=5e-3)
    fine = replace(NUMERICS, safety=0.2)
    _, bar = run(replace(shot, support="bar", transmission_bar=SOFT), fine)
    _, mesh = run(replace(shot, support="mesh", transmission_bar=SOFT, behind=body), fine)
    _, rigid = run(shot, fine)
    moved = apart(rigid.force_transmission, bar.force_transmission)
    assert moved > 0.02
    # The characteristic bar knows the force a time step late, here 0.6 us: 5 % of what a bar changes.
    assert apart(mesh.force_transmission, bar.force_transmission) < 0.1 * moved
    assert apart(mesh.surface_y, bar.surface_y) < 0.1 * apart(rigid.surface_y, bar.surface_y)


def test_elastic_parts_are_those_of_the_full_model(shot: Shot) -> None:
    """Against `coupled_parts.couple`, which marches the parts in time in every pass."""
    parts = (replace(PLATEN, diameter=9.5e-3), replace(SOFT, length=0.2))
    body = ElasticBody("mesh", parts, element_size=5e-3, transducer_depth=14e-3)
    prepared, found = run(replace(shot, support="mesh", transmission_bar=BAR, behind=body, incident=None))
    problem = prepared.forward.problem({}, NUMERICS)
    sections = [Section(p.length, 0.5 * p.diameter, p.youngs_modulus, p.density, p.poisson) for p in parts]
    full = couple(
        problem.model, problem.samples, elastic_bar(sections, size=5e-3, depths=[14e-3]), threads=1,
        max_passes=10,
    )  # fmt: skip
    history = full.parts[0]
    wanted = np.interp(found.force_times, history.times, history.section_force[:, 0])
    # Both press on the whole face; there the times' interpolation differs.
    assert apart(found.force_transmission[0], wanted) < 2e-3


def test_a_rigid_flyer_adds_the_inertia_of_what_lies_before_its_transducer(shot: Shot) -> None:
    assert shot.incident is not None
    prepared, shown = run(shot)
    _, face = run(replace(shot, incident=None))
    path = prepared.path
    times = shown.force_times
    added = shot.incident.mass * path.acceleration(times)
    np.testing.assert_allclose(
        shown.force_flyer[0] - face.force_flyer[0], added, atol=2e-2 * np.abs(added).max()
    )
    gained = shot.incident.mass * path.velocity(times)
    np.testing.assert_allclose(
        shown.impulse_flyer[0] - face.impulse_flyer[0], gained, atol=1e-3 * np.abs(gained).max()
    )
    np.testing.assert_array_equal(shown.force_transmission, face.force_transmission)


def test_an_elastic_flyer_is_the_rigid_one_of_its_mass_where_waves_are_long(shot: Shot) -> None:
    assert shot.incident is not None
    mass = 0.25 * np.pi * 15e-3**2 * (8048.0 * 10e-3 + 6594.0 * 4e-3)
    assert mass_before(FLYER) == pytest.approx(mass)
    assert mass_before(FLYER, FLYER.length) == pytest.approx(
        0.25 * np.pi * 15e-3**2 * (2 * 8048.0 * 10e-3 + 6594.0 * 16e-3)
    )
    _, elastic = run(replace(shot, flyer_body=FLYER))
    _, rigid = run(replace(shot, incident=replace(shot.incident, mass=mass)))
    edges = prepare_shot(shot).observations.bins.edges
    means = [np.diff(np.interp(edges, r.force_times, r.impulse_flyer[0])) for r in (elastic, rigid)]
    assert apart(*means) < 5e-3
    mesh = replace(FLYER, model="mesh", element_size=5e-3)
    _, meshed = run(replace(shot, flyer_body=mesh))
    assert apart(np.diff(np.interp(edges, meshed.force_times, meshed.impulse_flyer[0])), means[0]) < 5e-3


def test_the_face_of_an_elastic_flyer_gives_way(shot: Shot) -> None:
    """A flyer of a polymer, seen 5 mm behind its face: the specimen's end lags by what lies between."""
    part = replace(SOFT, diameter=15e-3, length=36e-3)
    body = ElasticBody("bar", (part,), seen_at=5e-3)
    _, face = run(replace(shot, incident=None))
    _, given = run(replace(shot, incident=None, flyer_body=body))
    late = len(face.surface_times) // 2
    lag = given.surface_y[0, late:, -1] - face.surface_y[0, late:, -1]
    force = np.interp(face.surface_times[late:], face.force_times, face.force_flyer[0])
    # F l / (E A) on the mean; behind a section less is pushed, evenly less to nothing at the far end.
    per_newton = 5e-3 * (1.0 - 0.5 * 5.0 / 36.0) / (5e9 * 0.25 * np.pi * 15e-3**2)
    assert lag.mean() == pytest.approx(per_newton * force.mean(), rel=0.1)


def test_the_incident_force_is_among_the_data(shot: Shot) -> None:
    prepared, response = run(shot)
    seen = prepared.observations
    assert seen.incident is not None
    assert seen.n_force == len(seen.bins.mean) + len(seen.incident.mean)
    found = predict(response, seen)
    objective = Objective(seen, np.ones(len(seen.centre_line.Z), bool))
    assert objective.n_force == seen.n_force == found.force_bins.shape[1]
    n = len(seen.bins.mean)
    np.testing.assert_array_equal(objective.data[n : seen.n_force], seen.incident.mean)
    edges = seen.incident.edges
    by_hand = np.diff(np.interp(edges, response.force_times, response.impulse_flyer[0])) / np.diff(edges)
    np.testing.assert_allclose(found.force_bins[0, n:], by_hand, rtol=1e-9)
    scaled = Objective(replace(seen, force_sigma_gain=0.01), objective.counted).scale_error
    np.testing.assert_allclose(scaled[:n], 0.01 * seen.bins.mean)
    assert not scaled[n:].any()  # the other transducer has a calibration of its own
    assert len(objective.times) == len(objective.data)


def test_runs_corrected_for_poisson_are_refused_beside_elastic_parts(shot: Shot) -> None:
    forward: Forward = prepare_shot(replace(shot, flyer_body=FLYER)).forward
    with pytest.raises(ValueError, match="run it directly"):
        forward.run({}, Numerics(mesh=(12, 16), compressible=0.495))


def test_from_the_shot_file(tmp_path: Path) -> None:
    body = """[flyer_body]
model = "bar"
transducer_depth = "12 mm"
[flyer_body.parts.platen]
diameter = "15 mm"
length = "40 mm"
youngs_modulus = "190 GPa"
density = "8048 kg/m^3"

[window]"""
    found = kolsky.load_shot(
        shot_in(tmp_path / "shot", COMPARED, ('support = "rigid"', PARTS), ("[window]", body))
    )
    assert found.behind is not None
    assert [part.length for part in found.behind.parts] == [0.01, 0.49]
    assert found.behind.transducer_depth == pytest.approx(14e-3)
    assert found.behind.element_size == pytest.approx(5e-3)
    assert found.transmission_bar is not None
    assert found.transmission_bar.length == pytest.approx(0.5)
    assert found.flyer_body is not None
    assert found.flyer_body.model == "bar"
    assert found.incident is not None


def test_the_command_simulates_with_elastic_parts_on_both_sides(tmp_path: Path) -> None:
    """Meshes behind the specimen and in the flyer, the incident force compared: all from the shot file."""
    body = """[flyer_body]
model = "mesh"
element_size = "5 mm"
transducer_depth = "12 mm"
seen_at = "5 mm"
[flyer_body.parts.platen]
diameter = "15 mm"
length = "40 mm"
youngs_modulus = "190 GPa"
density = "8048 kg/m^3"

[window]
end = "0.5 ms"
#"""
    changes = (COMPARED, ('support = "rigid"', PARTS), ("[window]", body))
    forces, bins = [], []
    for name, given in (("elastic", changes), ("rigid", (("[window]", '[window]\nend = "0.5 ms"\n#'),))):
        shot, out = shot_in(tmp_path / name, *given), tmp_path / f"{name}-out"
        words = ["simulate", str(shot), "--mesh", "5x7", "--out", str(out)]
        said = json_of(*words)
        assert said["outcome"] == "COMPLETED"
        bins.append(said["n_force"])
        forces.append(said["phi_force"])
    assert bins[0] == 2 * bins[1]  # those of the incident force beside those of the transmitted one
    assert forces[0] > forces[1]  # a sum of absolute values over both


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ([('support = "rigid"', 'support = "mesh"')], "transmission.parts.platen"),
        ([('support = "rigid"', PARTS.replace('"14 mm"', '"500 mm"'))], "below the parts' length, 0.5 m"),
        ([('support = "rigid"', 'support = "rigid"\nelement_size = "5 mm"')], "would have no effect"),
        ([("[window]", '[flyer_body]\nmodel = "rigid"\nseen_at = "5 mm"\n[window]')], "moves as one"),
        ([("[window]", '[flyer_body]\nmodel = "bar"\n[window]')], "flyer_body.parts.platen"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, changes: list[tuple[str, str]], words: str) -> None:
    with pytest.raises(InputError, match=words):
        kolsky.load_shot(shot_in(tmp_path / "shot", *changes))


@pytest.mark.slow  # 15 s on a quiet core
def test_a_shot_is_identified_with_its_incident_force(tmp_path: Path) -> None:
    found = kolsky.load_shot(shot_in(tmp_path / "shot", COMPARED))
    numerics = Numerics(mesh=(8, 11))
    settings = Settings(
        free={"stiffness_factor": None}, numerics=numerics, refined_mesh=(16, 22), replicates=2
    )
    answer = kolsky.identify(found, settings)
    # The shot was made with 1.12; meshes this coarse are 1 % off, which the interval need not hold.
    assert answer.estimates["stiffness_factor"].value == pytest.approx(1.12, rel=0.02)
    assert answer.provenance["incident_force"] == "compared"
    # The figure of the transmitted force has its own bins alone.
    assert len(answer.comparison.force_model) == len(answer.comparison.force_time)


# A transducer behind the face: closed forms of a pulse in a bar, and the whole chain from the shot file.

DEPTH = 0.1
STEEL = """
transducer_depth = "100 mm"
[transmission.bar]
diameter = "15 mm"
length = "500 mm"
youngs_modulus = "190 GPa"
density = "8048 kg/m^3"
"""


def made(depth: float, bar: Bar | None = BAR) -> Any:
    return SimpleNamespace(transducer_depth=depth, transmission_bar=bar)


def test_a_pulse_passes_and_comes_back_as_tension(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pulse shorter than the way to the far end: later by d, and by T - d as tension; T + d compression."""
    from kolsky.inverse import forward

    times = np.linspace(0.0, 4e-4, 40_001)
    pulse = np.exp(-(((times - 3e-5) / 5e-6) ** 2))
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (pulse[1:] + pulse[:-1]) * np.diff(times))])
    monkeypatch.setattr(forward, "replace", lambda response, **new: SimpleNamespace(**new))
    response = SimpleNamespace(
        force_times=times, force_transmission=pulse[None], impulse_transmission=impulse[None]
    )
    found = at_transducer(made(DEPTH), response)  # type: ignore[arg-type]
    d, T = DEPTH / BAR.wave_speed, BAR.round_trip

    def at(late: float) -> float:
        return float(np.interp(3e-5 + late, times, found.force_transmission[0]))

    assert at(d) == pytest.approx(1.0, abs=1e-3)
    assert at(T - d) == pytest.approx(-1.0, abs=1e-3)
    assert at(T + d) == pytest.approx(1.0, abs=1e-3)
    assert at(0.0) == pytest.approx(0.0, abs=1e-3)
    # The impulse is the integral of the force there, and returns to nothing after the tension.
    gained = np.interp([3e-5 + 0.5 * T, 3e-5 + T], times, found.impulse_transmission[0])
    np.testing.assert_allclose(gained, [5e-6 * np.sqrt(np.pi), 0.0], atol=2e-8)


def test_at_the_face_or_on_a_rigid_support_nothing_changes() -> None:
    response = object()
    assert at_transducer(made(0.0), response) is response  # type: ignore[arg-type]
    assert at_transducer(made(DEPTH, None), response) is response  # type: ignore[arg-type]


def transducer_place_declared(folder: Path, text: str) -> Path:
    return shot_in(folder, ('support = "rigid"', f'support = "bar"{text}'))


def test_from_the_shot_file_to_the_prediction(tmp_path: Path) -> None:
    behind = kolsky.load_shot(transducer_place_declared(tmp_path / "behind", STEEL))
    assert behind.transducer_depth == pytest.approx(0.1)
    face = replace(behind, transducer_depth=0.0)
    numerics = Numerics(mesh=(6, 8))
    runs = [simulate(shot, {}, numerics=numerics) for shot in (face, behind)]
    direct, shown = (run.response for run in runs)
    assert shown.surface_r == pytest.approx(direct.surface_r)  # only the force is seen elsewhere
    delay = 0.1 / behind.transmission_bar.wave_speed  # type: ignore[union-attr]
    early = direct.force_times < direct.force_times[0] + behind.transmission_bar.round_trip - delay  # type: ignore[union-attr]
    exact = np.interp(direct.force_times - delay, direct.force_times, direct.force_transmission[0], left=0.0)
    np.testing.assert_allclose(shown.force_transmission[0][early], exact[early], atol=1e-9)
    seen = predict(shown, prepare_shot(behind).observations)
    assert not np.allclose(seen.force, predict(direct, prepare_shot(face).observations).force)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (STEEL.replace("100 mm", "260 mm"), "below half the bar"),
        (STEEL.replace('"100 mm"', '"-1 mm"'), "> 0"),
    ],
)
def test_depths_that_cannot_be(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        kolsky.load_shot(transducer_place_declared(tmp_path / "shot", text))


def test_a_rigid_support_has_no_depth(tmp_path: Path) -> None:
    rigid = 'support = "rigid"\ntransducer_depth = "10 mm"'
    with pytest.raises(InputError, match="nothing moves"):
        kolsky.load_shot(shot_in(tmp_path / "shot", ('support = "rigid"', rigid)))
