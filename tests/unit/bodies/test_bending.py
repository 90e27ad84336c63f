"""Bend, its slope and the inverse of both: closed forms, differences, and planted answers."""

from dataclasses import replace

import numpy as np
import pytest

from kolsky.bodies.actuator_bending import Search, SearchEnd, pressure_for, pressures_for
from kolsky.bodies.actuator_control import reduce_actuator
from kolsky.bodies.actuator_model import bend_of, bend_slope, touching
from kolsky.equilibrium.model import SelfContact
from kolsky.equilibrium.solve import Newton
from kolsky.equilibrium.surface_contact import surface_contacts
from tests.unit.bodies.small import DOWN, MOST, actuator

SMALL = actuator()


def test_angle_of_an_arc_is_half_of_its_turn() -> None:
    # the chord of a circular arc that has turned by phi points along phi / 2
    for phi in (-0.6, 0.0, 0.4, 1.5, 3.0):
        radius = 1.0 / phi if phi else 0.0
        chord = np.array([radius * np.sin(phi), 0.0, -radius * (1.0 - np.cos(phi))]) if phi else [1.0, 0, 0]
        assert bend_of(np.asarray(chord)) == pytest.approx(0.5 * phi)


def test_slope_of_the_angle_by_the_chord() -> None:
    chord, h = np.array([0.04, 0.001, -0.03]), 1e-7
    each = [(bend_of(chord + h * e) - bend_of(chord - h * e)) / (2 * h) for e in np.eye(3)]
    assert bend_slope(chord) == pytest.approx(np.array(each), rel=1e-7)


def test_weight_bends_a_beam_down() -> None:
    # without pressure the two directions of gravity bend it oppositely, alike to first order
    down, up = (actuator().simulate((0.0, 0.0, s * 0.05), np.zeros(1)).angle[0] for s in (-1.0, 1.0))
    assert down > 0.0
    assert up == pytest.approx(-down, rel=2e-3)  # O(g): the second order of 0.05 m/s2


def test_slope_is_the_difference_of_angles() -> None:
    tight = Newton(tolerance=1e-11)
    found = SMALL.simulate(DOWN, np.array([20e3, 39.9e3, 40e3, 40.1e3]), newton=tight)
    difference = (found.angle[3] - found.angle[1]) / 200.0
    assert found.slopes()[2, 0] == pytest.approx(difference, rel=1e-6)


def test_newton_finds_the_planted_pressure() -> None:
    planted = SMALL.simulate(DOWN, np.array([17e3, 34e3]))
    found = pressure_for(SMALL, DOWN, float(planted.angle[-1]), most=MOST)
    assert found.ended is SearchEnd.YES
    assert found.pressures[0] == pytest.approx(34e3, rel=1e-3)
    assert found.equilibria <= 6


def test_what_cannot_be_reached_is_said() -> None:
    assert pressure_for(SMALL, DOWN, 2.0, most=20e3).ended is SearchEnd.ABOVE
    assert pressure_for(SMALL, DOWN, -0.5, most=20e3).ended is SearchEnd.BELOW


def test_search_bisects_where_newton_would_leave_the_bracket() -> None:
    search = Search(1.0, 100.0, 0.0, 50.0)
    search.take(2.0, 0.01)  # Newton: -50, outside of (0, 50)
    assert search.pressure == 25.0
    search.take(0.5, 0.05)  # Newton: 35, inside of (25, 50)
    assert search.pressure == pytest.approx(35.0)


def test_two_chambers_by_bounded_least_squares() -> None:
    pair = actuator(separate=True)
    planted = pair.simulate(DOWN, np.array([[10e3, 20e3], [20e3, 40e3]]))
    assert planted.slopes().shape == (2, 2)
    wanted = {"angle": float(planted.angle[-1]), "tip": planted.chord[-1]}
    found = pressures_for(pair, DOWN, **wanted, most=MOST)
    assert found.ended is SearchEnd.YES
    assert found.pressures == pytest.approx([20e3, 40e3], rel=1e-3)
    capped = pressures_for(pair, DOWN, **wanted, most=30e3)
    assert capped.ended is SearchEnd.NEAREST
    assert capped.pressures.max() <= 30e3


def test_a_path_meets_the_same_equilibria() -> None:
    pressures = np.array([0.0, 20e3, 40e3])
    found, path = SMALL.follow(DOWN, pressures, first=15e3)
    assert found.angle == pytest.approx(SMALL.simulate(DOWN, pressures).angle, rel=1e-6)
    assert path.load[0] == 0.0
    assert path.load[-1] >= 40e3
    assert path.limits.size == 0
    with pytest.raises(ValueError, match="rises to"):
        SMALL.follow(DOWN, np.array([40e3]), first=1e3, steps=2)


def test_chambers_that_touch() -> None:
    free = actuator(wall=1.2e-3, gap=0.3e-3, cell=3e-3, inlet=2e-3)
    contact = SelfContact("gap_1_left", "gap_1_right")
    both = replace(free, contacts=(contact,))
    pressures = np.array([10e3, 29.9e3, 30e3, 30.1e3])
    apart, touched = free.simulate(DOWN, pressures), both.simulate(DOWN, pressures)
    assert touched.solution.outcome.ok
    assert touching(apart) is None
    pressed = touching(touched)
    assert pressed is not None
    assert pressed.force[0] == 0.0
    assert pressed.force[2] > 0.01
    # the walls as far through each other as the penalty says: 1 % of a face of 3.6 by 5 mm is what is allowed
    assert 0.0 < pressed.depth[2] < 40e-6
    assert touched.angle[0] == pytest.approx(apart.angle[0], rel=1e-6)
    assert touched.angle[2] > 1.02 * apart.angle[2]  # pushed apart, it bends more
    # half of the actuator is modelled: the pressures of both halves
    u = touched.solution.displacements[2].ravel()
    each = [one.areas @ one.pressures(u) for one in surface_contacts(touched.solution.model)]
    assert pressed.force[2] == pytest.approx(2.0 * sum(each))
    # exact slope in contact
    difference = (touched.angle[3] - touched.angle[1]) / 200.0
    assert touched.slopes()[2, 0] == pytest.approx(difference, rel=1e-4)
    with pytest.raises(ValueError, match="no contact"):
        reduce_actuator(both, DOWN, most=30e3, modes=3, tolerance=1e-3)
