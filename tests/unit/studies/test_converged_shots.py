"""Shots with converged histories: changes of their exports, in closed form."""

import json

import numpy as np
import pytest

from populations import converged_shots
from populations.converged_shots import FLAT, converged, radius_at


def test_the_radius_of_a_side_that_has_folded_at_both_ends():
    """r = 5 mm + y^2 / 1 mm between two ends that lie on platens; beyond the free part there is none."""
    y = np.linspace(1e-3, 5e-3, 41)
    r = 5e-3 + y**2 / 1e-3
    folded_y = np.concatenate([[y[0] + FLAT / 2, y[0] + FLAT / 2], y, [y[-1], y[-1] + FLAT / 2]])
    folded_r = np.concatenate([[4e-3, 4.1e-3], r, [31e-3, 32e-3]])
    assert radius_at(folded_y, folded_r, 2.03e-3) == pytest.approx(5e-3 + 2.03e-3**2 / 1e-3, rel=1e-12)
    assert np.isnan(radius_at(folded_y, folded_r, 0.9e-3))
    assert np.isnan(radius_at(folded_y, folded_r, 5.1e-3))


class Run:
    """A course whose force is 3 N and whose radius is 6 mm."""

    def __init__(self, times, heights):
        self.force_transmission = np.full((1, times.size), 3.0)
        self.surface_y = np.broadcast_to(heights, (1, 3, heights.size))
        self.surface_r = np.full((1, 3, heights.size), 6e-3)


class Course:
    """The other program's: 2 N and 5 mm, in three frames from 10 us on."""

    true = np.array([1.0, 0.499, 25e-6])

    def __init__(self, name):
        self.heights = np.linspace(0.0, 4e-3, 9)
        frames = 1e-5 * np.arange(1.0, 4.0)
        self.seen = {
            "t": frames,
            "y": np.broadcast_to(self.heights, (3, 9)),
            "r": np.full((3, 9), 5e-3),
            "transmitted": np.full(40, 2.0),
        }
        self.times = 1e-6 * np.arange(40.0) - 1e-5
        self.within = (self.times > -1e-9) & (self.times < 2e-5 + 1e-9)

    def runs(self, points, mesh, *, element, grading):
        return Run(self.times[self.within], self.heights)


def test_the_difference_of_the_courses_is_added_and_the_noise_stays(tmp_path, monkeypatch):
    """1 N times 0.0112 V/N and 1 mm, from the beginning of the motion to its last frame; nothing at rest."""
    source = tmp_path / "runs" / "shot"
    source.mkdir(parents=True)
    (source / "shot.toml").write_text("")
    rows = [[0, 0.0, 1.0, 4.9, 0.004], [1, 1e-5, 1.0, 5.013, 0.004], [3, 3e-5, 9.0, 4.7, 0.004]]
    table = "\n".join(",".join(map(str, row)) for row in rows)
    (source / "centreline.csv").write_text(f"frame,time (s),y (mm),Z (mm),sigma_Z (mm)\n{table}\n")
    scope = np.stack([1e-6 * (np.arange(45.0) + 0.5), np.full(45, 7.0), 0.01 * np.arange(45.0)], axis=1)
    header = "Time (s),CH1 incident (V),CH2 transmitted (V)"
    np.savetxt(source / "scope.csv", scope, delimiter=",", header=header, comments="")
    facts = tmp_path / "shots" / "shot"
    facts.mkdir(parents=True)
    (facts / "facts.json").write_text(
        json.dumps({"scope": {"sensitivity_V_per_N": {"transmitted": 0.0112, "incident": 1.0}}})
    )
    monkeypatch.setattr(converged_shots, "RUNS", tmp_path / "runs")
    monkeypatch.setattr(converged_shots, "SHOTS", tmp_path / "shots")
    monkeypatch.setattr(converged_shots, "Course", Course)
    folder = converged("shot", tmp_path / "out")
    outline = np.loadtxt(folder / "centreline.csv", delimiter=",", skiprows=1)
    # At rest nothing differs; where the side has folded away there is nothing to compare.
    np.testing.assert_allclose(outline[:, 3], [4.9, 6.013, 4.7], rtol=1e-9)
    found = np.loadtxt(folder / "scope.csv", delimiter=",", skiprows=1)
    moves = (scope[:, 0] > 1e-5) & (scope[:, 0] < 3e-5)
    np.testing.assert_allclose(found[:, 2] - scope[:, 2], np.where(moves, 0.0112, 0.0), atol=1e-9)
    np.testing.assert_array_equal(found[:, 1], scope[:, 1])
    told = json.loads((folder / "converged.json").read_text())
    assert told == {"force, N rms": pytest.approx(1.0), "outline, um rms": pytest.approx(1e3)}
