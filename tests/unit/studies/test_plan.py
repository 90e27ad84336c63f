"""Predicted information of a test: slopes by an identity of the solver, information, choices, command."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from barrecord import classical_shot
from kolsky_command import json_of, run_kolsky
from shot_folders import OPEN_01, shot_in
from typer.testing import CliRunner

from doe.information import LinearData
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.results import numbers
from kolsky.results.nomenclature import name_of, with_subscripts
from kolsky.shot.load import load_shot
from kolsky.studies.local_sensitivity import ObservationGrid, local_sensitivity
from kolsky.studies.planning.information import (
    FRAMES,
    HEIGHTS,
    Expected,
    Information,
    Instruments,
    information,
    instruments_of,
)
from kolsky.studies.planning.plan import _sigmas, camera_heights, camera_windows, plan, rows, window_ends

TINY = Numerics(mesh=(8, 11), threads=1)
runner = CliRunner()


@pytest.fixture(scope="module")
def prepared():
    return prepare_shot(load_shot(OPEN_01))


@pytest.fixture(scope="module")
def told(prepared):
    return information(
        prepared.forward, instruments_of(prepared), ("stiffness_factor", "damping"), numerics=TINY
    )


def grid_of(prepared, end: float = 0.9e-3) -> ObservationGrid:
    start = prepared.forward.shot.window[0]
    return ObservationGrid(
        edges=np.linspace(start, end, 16),
        frames=np.linspace(start, end, 9),
        heights=np.array([0.001, 0.0015, 0.002]),
    )


def test_slopes_obey_the_scaling_of_the_equations(prepared):
    """Forces are stress times area, and motion knows only stress over density: with damping a time,

    F(a m, a rho) = a F(m, rho) and Z(a m, a rho) = Z(m, rho), so  m dF/dm + rho dF/drho = F  and
    m dZ/dm + rho dZ/drho = 0.
    """
    forward, grid, h = prepared.forward, grid_of(prepared), 1e-3
    found = local_sensitivity(forward, grid, ("stiffness_factor",), reach=h, numerics=TINY)
    ends = []
    for factor in (1.0 + h, 1.0 - h):
        specimen = replace(forward.shot.specimen, density=factor * forward.shot.specimen.density)
        other = replace(forward, shot=replace(forward.shot, specimen=specimen))
        at = local_sensitivity(other, grid, ("stiffness_factor",), reach=h, numerics=TINY)
        ends.append((at.force, at.radius))
    by_density = [(up - down) / (2.0 * h) for up, down in zip(*ends, strict=True)]
    sum_F = found.force_slope[0] + by_density[0]
    # Both slopes ring with amplitudes of 20 N and more; their sum is the force. 2 %: differences over 0.1 %
    # carry the scatter of time steps that follow the parameter.
    scale = np.abs(found.force_slope[0]).max()
    assert scale > 3.0 * found.force.max()
    np.testing.assert_allclose(sum_F, found.force, atol=0.02 * scale)
    seen = np.isfinite(found.radius_slope[0])
    size = np.nanmax(np.abs(found.radius_slope[0]))
    np.testing.assert_allclose((found.radius_slope[0] + by_density[1])[seen], 0.0, atol=0.05 * size)


def test_a_line_through_a_line_leaves_nothing_out(prepared):
    found = local_sensitivity(prepared.forward, grid_of(prepared), ("damping",), reach=0.05, numerics=TINY)
    # Damping changes nothing but amplitudes: over 5 % of 25 us a line holds to 1 % of the change.
    change = found.reach * found.scale[0] * np.abs(found.force_slope[0]).max()
    assert found.force_left[0].max() < 0.05 * change
    assert found.scale[0] == found.point[0] == 25e-6


def test_levels_stay_in_the_allowed_range(prepared):
    found = local_sensitivity(
        prepared.forward, grid_of(prepared, 3e-4), ("damping",), held={"damping": 0.0}, numerics=TINY
    )
    assert np.isfinite(found.force_slope).all()  # no run with damping < 0 was asked for, or it would raise
    near = local_sensitivity(
        prepared.forward, grid_of(prepared, 3e-4), ("poisson",), held={"poisson": 0.4999}, numerics=TINY
    )
    assert np.isfinite(near.force_slope).all()


@pytest.mark.parametrize(
    ("names", "options", "message"),
    [
        ((), {}, "at least one"),
        (("stiffness",), {}, "there is no parameter 'stiffness'"),
        (("damping", "damping"), {}, "damping is named 2 times"),
        (("friction",), {}, "no friction coefficient to start from"),
        (("release_stress",), {}, "release_stress"),
        (("damping",), {"reach": 0.0}, r"reach must be in \(0, 0.5\]"),
        (("damping",), {"held": {"poisson": 0.6}}, "poisson = 0.6 is not allowed"),
    ],
)
def test_refusals(prepared, names, options, message):
    with pytest.raises(ValueError, match=message):
        local_sensitivity(prepared.forward, grid_of(prepared, 2e-4), names, numerics=TINY, **options)


def test_a_faster_flyer_is_at_the_same_places_sooner(prepared):
    path = prepared.path
    fast, t = path.faster(2.0), np.linspace(path.start, path.end, 50)
    sooner = path.start + (t - path.start) / 2.0
    np.testing.assert_allclose(fast.position(sooner), path.position(t), atol=1e-15)  # round-off of mm
    np.testing.assert_allclose(fast.velocity(sooner), 2.0 * path.velocity(t), atol=1e-12)
    # The covariance of the jerks spans many decades: what is left of it in a position is good to 1e-6.
    np.testing.assert_allclose(fast.sigma_position(sooner), path.sigma_position(t), rtol=1e-5)
    with pytest.raises(ValueError, match="factor must be finite and > 0"):
        path.faster(0.0)


def test_instruments_are_those_of_the_shot(prepared):
    found = instruments_of(prepared)
    line = prepared.observations.centre_line
    assert found.frame_interval == pytest.approx(1.0 / 120e3, rel=1e-6)  # the shot's facts
    assert found.outline_sigma == 4e-6
    # Points a frame over the height they span; 15 % because the count is a whole number of a few.
    frame = line.time == line.time[0]
    assert found.points == pytest.approx((frame.sum() - 1) / np.ptp(line.y[frame]), rel=0.15)
    assert 0.0 < found.clearance <= line.y.min()
    for field, value in (("points", -1.0), ("outline_sigma", 0.0), ("bin_width", 1.0), ("clearance", np.nan)):
        with pytest.raises(ValueError, match=field):
            replace(found, **{field: value})


def test_shares_of_all_data_add_up_to_one(told):
    grid = told.sensitivity.grid
    for alone in (False, True):
        force, outline = told.densities(alone=alone)
        area = np.diff(grid.frames).mean() * np.diff(grid.heights).mean()
        whole = (force * np.diff(grid.edges)).sum(axis=1) + np.nansum(outline, axis=(1, 2)) * area
        np.testing.assert_allclose(whole, 1.0, rtol=1e-9)


def test_groups_hold_the_whole_information(told):
    outline = told.data.select(~told.is_force).information
    for groups in (told.by_frame(), told.by_height()):
        np.testing.assert_allclose(groups.sum(axis=0), outline, rtol=1e-9)
    np.testing.assert_allclose(told.of_force + outline, told.data.information, rtol=1e-9)


def test_twice_the_pictures_tell_as_much_as_less_noise(prepared, told):
    instruments = instruments_of(prepared)
    fast = replace(instruments, frame_interval=0.5 * instruments.frame_interval)
    quiet = replace(instruments, outline_sigma=instruments.outline_sigma / np.sqrt(2.0))
    names = told.data.names
    first, second = (
        Expected.of(information(prepared.forward, i, names, numerics=TINY).data) for i in (fast, quiet)
    )
    np.testing.assert_allclose(first.deviations, second.deviations, rtol=1e-9)
    assert (first.deviations < Expected.of(told.data).deviations).all()


def test_the_map_counts_as_many_points_as_the_shot_has(prepared, told):
    """The information of the map must be that of the points it stands for."""
    observations, instruments = prepared.observations, instruments_of(prepared)
    line = observations.centre_line
    from kolsky.inverse.observations import predict

    h = 0.02
    response = prepared.forward.run({"stiffness_factor": np.array([1.0 + h, 1.0 - h])}, TINY)
    prediction = predict(response, observations)
    inside = prediction.inside.all(axis=0)
    slope = (prediction.Z[0] - prediction.Z[1])[inside] / (2.0 * h)
    sigma = 1.0 / np.linalg.norm(slope / line.sigma[inside])
    outline = told.data.select(~told.is_force)
    # 15 %: even density instead of the shot's points, and slopes over 10 instead of 2 %.
    assert outline.conditional_deviations[0] == pytest.approx(sigma, rel=0.15)
    assert instruments.outline_sigma == line.sigma[0]


def made(jacobian: np.ndarray, told: Information) -> Information:
    """The same places with other slopes of the outline; the force sees nothing but the second parameter."""
    rows = np.zeros_like(told.data.jacobian)
    rows[: told.n_force, 1] = 1.0
    rows[told.n_force :] = jacobian
    data = LinearData(told.data.names, rows, np.ones(len(rows)), np.ones(2))
    return Information(told.sensitivity, data, told.seen)


def test_choices_find_where_the_information_was_put(told):
    grid = told.sensitivity.grid
    t = np.broadcast_to(grid.frames[:, None], told.seen.shape)[told.seen]
    y = np.broadcast_to(grid.heights, told.seen.shape)[told.seen]
    rows = np.zeros((told.seen.sum(), 2))
    rows[:, 0] = np.exp(-(((y - 1.2e-3) / 2e-4) ** 2)) * (np.abs(t - 0.8e-3) < 1e-4)
    placed = made(rows, told)
    step = np.diff(grid.heights)[0]
    assert camera_heights(placed, 1).places[0] == pytest.approx(1.2e-3, abs=0.5 * step + 1e-12)
    begin, end = camera_windows(placed, 0.25).places
    assert begin <= 0.71e-3
    assert end >= 0.89e-3
    times, expected = window_ends(placed, np.array([0.3, 1.0]))
    assert np.isinf(expected[0].deviations).all()  # nothing was seen of the first parameter yet
    assert expected[0].correlation is None
    assert "do not move along" in expected[0].unseen
    assert np.isfinite(expected[1].deviations).all()
    assert times[1] == pytest.approx(grid.edges[-1])


def test_later_ends_never_tell_less(told):
    _, expected = window_ends(told, np.linspace(0.2, 1.0, 9))
    deviations = np.array([e.deviations for e in expected])
    assert (np.diff(deviations, axis=0) <= 1e-12).all()


def test_without_cameras_the_force_is_all(prepared):
    blind = replace(instruments_of(prepared), points=0.0)
    found = information(prepared.forward, blind, ("stiffness_factor", "damping"), numerics=TINY)
    assert not found.seen.any()
    assert camera_heights(found, 2) is None
    assert camera_windows(found, 0.5) is None
    assert found.is_force.all()


def test_a_window_beyond_the_motion_is_refused(prepared):
    late = replace(instruments_of(prepared), window=(0.0, 5e-3))
    with pytest.raises(ValueError, match="must lie within the flyer's motion"):
        information(prepared.forward, late, ("stiffness_factor",), numerics=TINY)


# The command


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory):
    folder = shot_in(tmp_path_factory.mktemp("plan") / "shot")
    options = ["--mesh", "8x11", "--rates", "1,2", "--heights", "2", "--threads", "1", "--figures", "svg"]
    return folder / "results", json_of("plan", folder, *options)


def test_json_says_what_is_expected(planned):
    folder, said = planned
    assert json.loads((folder / "plan.json").read_text()) == said
    m = said["parameters"]["stiffness_factor"]
    assert m["value"] == 1.0
    assert m["interval"] == pytest.approx([1.0 - 2.0 * m["sigma"], 1.0 + 2.0 * m["sigma"]])
    assert 0.0 < m["sigma_others_known"] <= m["sigma"] <= min(m["sigma_force"], m["sigma_outline"])
    assert -1.0 < said["correlations"]["stiffness_factor, damping"] < 1.0
    assert [rate["speed_factor"] for rate in said["rates"]] == [1.0, 2.0]
    assert said["rates"][1]["mean_strain_rate"] == pytest.approx(2.0 * said["rates"][0]["mean_strain_rate"])
    assert all(len(choice["places"]) == 2 for choice in said["camera_heights"])
    assert said["discrepancy"]["force_N"] > 0.0


def test_files_hold_the_map(planned):
    folder, said = planned
    page = (folder / "plan.html").read_text("utf-8")
    assert page.count("<figure") == 3
    for name in said["parameters"]:
        assert f'<th scope="row">{with_subscripts(name_of(name).symbol)}' in page
        U = 2.0 * name_of(name).factor * said["parameters"][name]["sigma_others_known"]
        assert f"<td>{numbers.plain(U, 2)}</td>" in page
    with (folder / "plan_outline.csv").open(newline="") as file:
        table = list(csv.reader(file))
    assert len(table) == 1 + FRAMES * HEIGHTS
    assert table[0][:3] == ["time (s)", "y (m)", "Z (m)"]
    assert sorted(p.name for p in (folder / "figures").iterdir()) == [
        "plan-choices.svg",
        "plan-information.svg",
        "plan-slopes.svg",
    ]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--free", "friction=0:1"], "a plan has no bounds"), (["--frame-rate", "0 kHz"], "--frame-rate"),
        (["--outline-sigma", "4 N"], "--outline-sigma: '4 N'"), (["--window", "1 ms"], "START:END"),
        (["--rates", "fast"], "--rates 'fast' cannot be read"), (["--heights", "0"], "whole numbers from 1"),
        (["--discrepancy", "some"], "--discrepancy"), (["--free", "friction"], "no friction coefficient"),
        (["--rates", "-1", "--mesh", "4x4"], "a rate must be finite and > 0"),
    ],
)  # fmt: skip
def test_bad_options_are_one_line_and_exit_code_2(options, message, tmp_path: Path):
    result = run_kolsky("plan", OPEN_01, "--out", tmp_path, *options, code=2)
    assert message in result.stderr
    assert "Traceback" not in result.stderr


def test_wishes_replace_what_the_shot_has(tmp_path: Path):
    options = ["--mesh", "4x6", "--rates", "1", "--heights", "1", "--discrepancy", "none"]
    options += ["--figures", "", "--threads", "1"]
    wishes = [
        "--outline-sigma", "8 um", "--frame-rate", "60 kHz", "--points", "2 1/mm", "--clearance", "1 mm",
    ]  # fmt: skip
    window = ["--window", "0.05 ms:1.0 ms", "--force-sigma", "0.2 N", "--free", "damping"]
    said = json_of("plan", OPEN_01, "--out", tmp_path, *options, *wishes, *window)
    expected = Instruments(
        window=(5e-5, 1e-3),
        bin_width=said["instruments"]["bin_width"],
        force_sigma=0.2,
        frame_interval=1.0 / 60e3,
        points=2000.0,
        outline_sigma=8e-6,
        clearance=1e-3,
    )
    told = said["instruments"]
    assert told.pop("window") == pytest.approx(expected.window)
    assert told == pytest.approx({k: v for k, v in vars(expected).items() if k != "window"})
    assert not (tmp_path / "figures").exists()
    assert said["discrepancy"] == {"force_N": 0.0, "outline_m": 0.0}
    assert list(said["parameters"]) == ["damping"]
    assert all(c["places"][0] >= 1e-3 for c in said["camera_heights"])


@pytest.mark.slow
def test_a_parameter_that_no_data_see_is_said(tmp_path: Path):
    # At such a coefficient all sticks, and a little more of it does nothing.
    options = ["--mesh", "4x6", "--rates", "1", "--heights", "1", "--threads", "1", "--discrepancy", "none"]
    free = ["--free", "damping", "--free", "friction", "-p", "friction=900"]
    wishes = ["--window", "0.05 ms:0.5 ms", "--figures", "svg", "--json"]
    result = run_kolsky("plan", OPEN_01, "--out", tmp_path, *options, *free, *wishes)
    said = json.loads(result.stdout)
    assert said["parameters"]["friction"]["sigma"] is None
    assert said["parameters"]["damping"]["sigma_others_known"] > 0.0
    assert said["correlations"] == {"damping, friction": None}
    assert said["camera_heights"] == said["camera_windows"] == []
    assert "do not move along" in said["unseen"]["all"]
    assert "do not move along" in result.stderr  # a warning
    assert (tmp_path / "figures" / "plan-information.svg").exists()


@pytest.mark.slow
def test_a_plan_for_the_force_alone(tmp_path: Path):
    options = ["--mesh", "4x6", "--rates", "1", "--threads", "1", "--points", "0 1/mm", "--figures", "svg"]
    free = ["--free", "damping", "--window", "0.05 ms:0.5 ms"]
    said = json_of("plan", OPEN_01, "--out", tmp_path, *options, *free)
    assert said["parameters"]["damping"]["sigma"] == said["parameters"]["damping"]["sigma_force"]
    assert "sigma_outline" not in said["parameters"]["damping"]
    assert (tmp_path / "figures" / "plan-choices.svg").exists()


def test_the_force_s_scale_is_listed_apart():
    shot = classical_shot(0)  # between bars, without an outline, the force's scale uncertain
    mesh = Numerics(mesh=(4, 4), threads=1)
    found = plan(shot, names=("stiffness_factor",), rates=(1.0,), numerics=mesh, discrepancy=(0.0, 0.0))
    slopes = found.information.sensitivity
    J, F, gain = slopes.force_slope[0], slopes.force, shot.force.sigma_gain
    assert gain > 0.0
    # One parameter, equal noise: regression through the origin.
    assert found.force_scale[0] == pytest.approx(abs(J @ (gain * F) / (J @ J)), rel=1e-9)
    assert any("by the force's scale" in str(text) for text in rows(found).values())


def test_each_parameter_is_doubled_and_in_its_own_unit() -> None:
    """k = 2; damping is held in s and shown in us."""
    told = _sigmas(np.array([0.001, 0.16e-6]), ("stiffness_factor", "damping"))
    assert told == "m ± 0.002, beta ± 0.32 us"
