"""The three commands on a small actuator: their files and warnings."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from kolsky_command import run_kolsky

from explicit.materials import LAWS
from kolsky.base.errors import InputError
from kolsky.base.units import UnitError
from kolsky.bodies import actuator_control
from kolsky.bodies.actuator_bending import schedule
from kolsky.bodies.actuator_control import (
    Controller,
    Plant,
    ReducedBend,
    Reduction,
    check_targets,
    largest_gain,
    reduce_actuator,
    run_loop,
)
from kolsky.bodies.actuator_model import Actuator, Pneunet
from kolsky.bodies.actuator_reading import ControlSection, read_actuator, volume_reading
from kolsky.equilibrium.loads import FollowerPressure, faces_on, rim
from kolsky.equilibrium.model import SelfContact
from kolsky.equilibrium.points import geometry
from kolsky.equilibrium.reduction import ReducedState
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solution import Outcome
from tests.unit.bodies.small import DOWN, MOST, actuator

SPEC = """
pressures = ["0.2 bar", "0.4 bar"]
[geometry]
chambers = 2
element = "hex8"
[material]
constants = { mu = "218 kPa" }
D1 = "1.150 1/MPa"
density = "1.02 g/cm^3"
[gravity]
downward = [0.0, 0.0, -9.81]
[healed]
mu = "214 kPa"
[invert]
angles = ["2 deg", "30 deg"]
most = "0.6 bar"
[control]
angles = ["1.5 deg", "3 deg"]
hold = "2 s"
most = "0.6 bar"
modes = 5
snapshots = 6
"""


@pytest.mark.slow
def test_simulate_invert_and_control(tmp_path: Path) -> None:
    spec = tmp_path / "small.toml"
    spec.write_text(SPEC)
    run_kolsky("actuator", "simulate", spec, "--out", tmp_path / "s", "--vtu", "--json")
    for name in ("actuator.html", "bend.csv", "line.csv", "downward.vtu"):
        assert (tmp_path / "s" / name).stat().st_size > 0, name
    bends = json.loads((tmp_path / "s" / "actuator.json").read_text())["bends"]["downward"]
    # softer by 214 / 218 alone: it bends more, by less than twice that
    assert 0.0 < bends["healed_over_pristine_less_1"][0] < 0.04
    said = run_kolsky("actuator", "invert", spec, "--out", tmp_path / "i", "--json").output
    assert "beyond the largest pressure" in said
    found = json.loads((tmp_path / "i" / "actuator.json").read_text())["found"]["downward"]
    assert [one["ended"] for one in found] == ["reached", "beyond the largest pressure"]
    run_kolsky("actuator", "control", spec, "--out", tmp_path / "c", "--json")
    run = json.loads((tmp_path / "c" / "actuator.json").read_text())["runs"]["downward"]
    assert run["ticks"] == 80
    assert max(run["settled_error_rad"]) < 1e-3
    assert (tmp_path / "c" / "downward.csv").read_text().startswith("time (s),")


@pytest.mark.slow
def test_chambers_touch_by_command(tmp_path: Path) -> None:
    text = SPEC[: SPEC.index("[healed]")].replace('"0.2 bar", "0.4 bar"', '"0.1 bar", "0.3 bar"')
    thin = 'element = "hex8"\nwall = "1.2 mm"\ngap = "0.3 mm"\ncell = "3 mm"\ninlet = "2 mm"'
    spec = tmp_path / "touching.toml"
    spec.write_text(text.replace('element = "hex8"', thin))
    assert "declare [contact]" in run_kolsky("actuator", "simulate", spec, "--out", tmp_path / "free").output
    spec.write_text(spec.read_text() + "[contact]\n")
    said = run_kolsky("actuator", "simulate", spec, "--out", tmp_path / "t").output
    assert "overlap" not in said
    found = json.loads((tmp_path / "t" / "actuator.json").read_text())["bends"]["downward"]
    free = json.loads((tmp_path / "free" / "actuator.json").read_text())["bends"]["downward"]
    assert free["contact_force_N"] is None
    assert found["contact_force_N"][1] > 0.01
    assert found["angle_rad"][1] > 1.02 * free["angle_rad"][1]
    assert "Contact of neighbouring chambers" in (tmp_path / "t" / "actuator.html").read_text()
    assert "contact force (N)" in (tmp_path / "t" / "bend.csv").read_text()


def test_a_missing_table_is_named(tmp_path: Path) -> None:
    spec = tmp_path / "small.toml"
    spec.write_text(SPEC[: SPEC.index("[invert]")])
    for command, table in (("invert", "invert"), ("control", "control")):
        result = run_kolsky("actuator", command, spec, "--out", tmp_path / "x", code=2)
        assert f"[{table}]" in result.output


READING_SPEC = """
pressures = ["0.1 bar", "0.4 bar"]
[geometry]
{geometry}
[material]
constants = {{ mu = "218 kPa" }}
D1 = "1.150 1/MPa"
density = "1.02 g/cm^3"
[gravity]
downward = {gravity}
"""
STIFF = 'constants = { mu = "10 MPa" }\npoisson = 0.4\n'
TABLE = '[plane.table]\npoint = ["0 mm", "0 mm", "1 mm"]\nnormal = [0, 0, 1]\n'
SMALL = 'chambers = 2\nelement = "hex8"'


def _spec(folder: Path, geometry: str = SMALL, gravity: str = "[0.0, 0.0, -9.81]", **more: str) -> Path:
    text = READING_SPEC.format(geometry=geometry, gravity=gravity)
    for old, new in more.items():
        text = text.replace(old.replace("_", " "), new)
    path = folder / "spec.toml"
    path.write_text(text)
    return path


def test_the_unit_says_which_d1_is_meant() -> None:
    # U = (J - 1)^2 / D1 has U'' = 2 / D1; U = D1 (J - 1)^2 has U'' = 2 D1
    assert volume_reading("1.150 1/MPa") == pytest.approx(2e6 / 1.150)
    assert volume_reading("1.150 MPa") == pytest.approx(2.3e6)
    with pytest.raises(UnitError):
        volume_reading("1.150")
    with pytest.raises(UnitError, match="not > 0"):
        volume_reading("-1 1/MPa")


def test_what_is_declared_is_used(tmp_path: Path) -> None:
    read = read_actuator(_spec(tmp_path))
    assert read.actuator.solid.parameters() == pytest.approx([218e3, 2e6 / 1.150])
    assert read.actuator.density == pytest.approx(1020.0)
    mesh = Pneunet(chambers=2, element="hex8").mesh
    np.testing.assert_array_equal(read.actuator.mesh.points, mesh.points)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"geometry": 'chambers = 2\nwall = "0 mm"'}, "geometry.wall"),
        ({"geometry": 'mesh = "a.vtu"\nwall = "2 mm"\nmesh_unit = "mm"'}, "has no effect with a mesh"),
        ({"gravity": "[0.0, 9.81, 0.0]"}, "half = false"),
        ({"geometry": 'channel = ["30 mm", "2 mm"]'}, "channel's width"),
        (
            {"geometry": 'chambers = 2\nwall = "0.04 m"\nchamber = ["3 m", "1 m", "1 m"]'},
            "actuator that is .* long",
        ),
        ({'["0.1 bar", "0.4 bar"]': '["-0.1 bar", "0.4 bar"]'}, "are of both signs"),
        ({"[gravity]": f'[part.layer]\nheight = ["0 mm", "30 mm"]\n{STIFF}[gravity]'}, "heights must be in"),
        ({"[gravity]": f'[part.layer]\nheight = ["1 mm", "0 mm"]\n{STIFF}[gravity]'}, "has no cell"),
        ({"[gravity]": f"[part.layer]\n{STIFF}[gravity]"}, "part.layer.height"),
        ({"[gravity]": f"{TABLE}[gravity]"}, "lies 1 mm inside the actuator"),
        ({"[gravity]": '[blocked]\nset = "thumb"\n[gravity]'}, "no set 'thumb'"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, wrong: dict[str, str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_actuator(_spec(tmp_path, **wrong))


def test_parts_and_the_outside_are_declared(tmp_path: Path) -> None:
    part = f'[part.layer]\nheight = ["0 mm", "0.3 mm"]\ndensity = "1.2 g/cm^3"\n{STIFF}'
    added = part + TABLE.replace("1 mm", "-1 mm") + "[blocked]\n[gravity]"
    made = read_actuator(_spec(tmp_path, **{"[gravity]": added})).actuator
    heights = made.mesh.points[made.mesh.cells[made.parts[0].cells], 2]
    assert (heights.min(), heights.max()) == pytest.approx((0.0, 0.3e-3))
    # K = 2 mu (1 + nu) / (3 (1 - 2 nu))
    assert made.constants()[1] == pytest.approx([10e6, 10e6 * 2.8 / 0.6])
    assert made.density_of_regions == pytest.approx((1020.0, 1200.0))
    assert [one.where for one in made.world] == ["end", "table"]
    touching = made.mesh.nodes("table")
    assert not np.isin(touching, np.concatenate([made.mesh.nodes("end"), made.mesh.nodes("clamp")])).any()
    inner = np.setdiff1d(made.mesh.nodes("cavity"), made.mesh.nodes("mirror"))
    assert not np.isin(inner, touching).any()
    assert np.isin(made.mesh.nodes("gap_1_left")[:1], touching).all()


def _vtu(path: Path, mesh, sets) -> None:
    k = mesh.cells.shape[1]
    cells = np.column_stack([np.full(len(mesh.cells), k), mesh.cells]).ravel()
    grid = pyvista.UnstructuredGrid(cells, np.full(len(mesh.cells), mesh.element.vtk), 1e3 * mesh.points)
    for name in sets:
        mask = np.zeros(len(mesh.points), dtype=np.uint8)
        mask[mesh.sets[name]] = 1
        grid.point_data[f"set:{name}"] = mask
    grid.save(path)


def test_a_vtu_file_is_the_same_body(tmp_path: Path) -> None:
    mesh = Pneunet(chambers=1, element="tet10").mesh
    _vtu(tmp_path / "finger.vtu", mesh, ["clamp", "mirror", "cavity", "tip", "origin"])
    read = read_actuator(_spec(tmp_path, 'mesh = "finger.vtu"\nmesh_unit = "mm"'))
    assert read.actuator.mesh.points == pytest.approx(mesh.points)
    assert read.actuator.mesh.kind == "tet10"
    assert np.array_equal(read.actuator.mesh.nodes("cavity"), mesh.nodes("cavity"))
    assert len(read.inputs) == 2
    _vtu(tmp_path / "finger.vtu", mesh, ["clamp", "cavity", "tip"])
    with pytest.raises(InputError, match="no set 'origin'"):
        read_actuator(_spec(tmp_path, 'mesh = "finger.vtu"\nmesh_unit = "mm"'))


TET = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
6
2 1 "clamp"
2 2 "cavity"
0 3 "tip"
0 4 "origin"
3 5 "body"
2 6 "inlet"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 10 0 0
3 0 10 0
4 0 0 10
$EndNodes
$Elements
6
1 2 2 1 1 1 3 4
2 2 2 2 2 2 3 4
3 15 2 3 3 2
4 15 2 4 4 1
5 4 2 5 5 1 2 3 4
6 2 2 6 6 2 3 4
$EndElements
"""


def test_a_gmsh_file_names_its_points(tmp_path: Path) -> None:
    (tmp_path / "tet.msh").write_text(TET)
    read = read_actuator(_spec(tmp_path, 'mesh = "tet.msh"\nmesh_unit = "mm"'))
    mesh = read.actuator.mesh
    assert mesh.points[1] == pytest.approx([10e-3, 0.0, 0.0])
    assert mesh.nodes("clamp").tolist() == [0, 2, 3]
    assert mesh.nodes("tip").tolist() == [1]
    assert mesh.nodes("origin").tolist() == [0]


def test_contact_is_declared(tmp_path: Path) -> None:
    path = _spec(tmp_path)
    path.write_text(path.read_text() + '[contact]\ndepth = "20 um"\n')
    read = read_actuator(path)
    assert read.actuator.contacts == (SelfContact("gap_1_left", "gap_1_right", depth=20e-6),)
    path.write_text(path.read_text().replace("chambers = 2", "chambers = 1"))
    with pytest.raises(InputError, match="gap_1_left"):
        read_actuator(path)


def test_steps_pass_the_declared_pressures() -> None:
    steps, asked = schedule(np.array([0.3, 0.5, 0.76]))
    assert steps[asked] == pytest.approx([0.3, 0.5, 0.76])
    assert steps[0] == 0.0
    assert np.diff(steps).max() <= 0.76 / 8 + 1e-12
    suction, place = schedule(np.array([-0.3, -0.76]))
    assert suction[place] == pytest.approx([-0.3, -0.76])
    assert np.diff(suction).max() < 0.0


RUBBER = Isotropic(LAWS["neo_hookean"].of([218e3]), bulk(2.0 / 1.150e-6))
SHAPE = {"chambers": 2, "half": True}


def solid_volume(s: Pneunet) -> float:
    """Outer block less chambers, channel and the open gaps [m3], of the whole."""
    cx, cy, cz = s.chamber
    channel = s.inlet + (2 * s.chambers - 1) * s.wall + (s.chambers - 1) * s.gap
    open_height = s.height - (s.base + s.channel[1] + s.wall)
    return (
        s.length * s.width * s.height
        - s.chambers * cx * cy * cz
        - channel * s.channel[0] * s.channel[1]
        - (s.chambers - 1) * s.gap * s.width * open_height
    )


@pytest.mark.parametrize("element", ["hex27", "hex8", "tet10", "tet4"])
@pytest.mark.parametrize("half", [True, False])
def test_volume_and_net_force_of_the_cavity(element: str, half: bool) -> None:
    s = Pneunet(chambers=2, element=element, half=half)
    mesh = s.mesh
    share = 0.5 if half else 1.0
    volume = geometry(mesh, kinematics="3d", thickness=1.0, gauss=None).volumes.sum()
    assert volume == pytest.approx(share * solid_volume(s), rel=1e-12)
    model = Actuator(mesh, s.cavities, RUBBER, 1020.0).model((0.0, 0.0, -9.81))
    force = FollowerPressure(model, "cavity").evaluate(np.zeros(model.n_dofs))[0].reshape(-1, 3).sum(axis=0)
    # a closed surface has no net force: what the walls feel is what the lids of the openings would not
    bore = share * s.channel[0] * s.channel[1]
    channel = s.inlet + 3 * s.wall + s.gap
    mirror = (2 * s.chamber[0] * s.chamber[2] + channel * s.channel[1]) if half else 0.0
    # three corners of a linear tetrahedron on the mirror may all be corners of the cavity: the force on that
    # face points along the mirror's normal, which holds it
    at = [0, 2] if element == "tet4" and half else [0, 1, 2]
    assert force[at] == pytest.approx(np.array([bore, mirror, 0.0])[at], abs=1e-9 * s.length**2)


def test_parts_follow_one_another() -> None:
    s = Pneunet(chambers=3, wall=2e-3, chamber=(4e-3, 8e-3, 9e-3), gap=1.5e-3, inlet=6e-3, base=3e-3)
    assert s.length == pytest.approx(6e-3 + 3 * (4e-3 + 4e-3) + 2 * 1.5e-3)
    points = s.mesh.points
    assert points.max(axis=0) == pytest.approx([s.length, 6e-3, 14e-3])
    for n, end in ((1, 14e-3), (2, 23.5e-3)):
        left, right = (points[s.mesh.sets[f"gap_{n}_{side}"]] for side in ("left", "right"))
        assert left[:, 0] == pytest.approx(end)
        assert right[:, 0] == pytest.approx(end + 1.5e-3)
        assert left[:, 1:] == pytest.approx(right[:, 1:])
    assert points[s.mesh.sets["tip"]] == pytest.approx(np.array([[s.length, 0.0, 0.0]]))


def test_separate_chambers_have_a_cavity_each_and_no_channel() -> None:
    s = Pneunet(chambers=2, separate=True, element="hex8")
    assert s.cavities == ("cavity_1", "cavity_2")
    for n, low in ((1, 7.5e-3), (2, 17.5e-3)):
        x = s.mesh.points[s.mesh.sets[f"cavity_{n}"], 0]
        assert (x.min(), x.max()) == pytest.approx((low, low + 3e-3))


def test_faces_that_meet_in_an_edge_are_two() -> None:
    s = Pneunet(chambers=1, element="hex27", half=False)
    s8 = Pneunet(chambers=1, element="hex8", half=False)
    assert sum(len(f.cells) for f in faces_on(s.mesh, "cavity")) == sum(
        len(f.cells) for f in faces_on(s8.mesh, "cavity")
    )


@pytest.mark.parametrize("kind", ["hex8", "hex27", "tet4"])
def test_a_cavity_ends_on_clamp_and_mirror_alone(kind: str) -> None:
    mesh = Pneunet(chambers=1, element=kind).mesh
    ends = rim(mesh, "cavity")
    held = [np.isin(ends, mesh.nodes(name)).all(axis=1) for name in ("clamp", "mirror")]
    assert len(ends) > 0
    assert (held[0] | held[1]).all()
    assert len(rim(Pneunet(chambers=1, element=kind, half=False, separate=True).mesh, "cavity_1")) == 0


def test_edges_of_a_hole_in_a_closed_surface() -> None:
    # Without one corner of the hollow three faces are missing: a rim of six edges.
    mesh = Pneunet(chambers=1, element="hex8", half=False, separate=True).mesh
    own = mesh.nodes("cavity_1")
    corner = own[np.argmax(mesh.points[own].sum(axis=1))]
    assert len(rim(mesh.with_set("cavity_1", own[own != corner]), "cavity_1")) == 6


def test_what_makes_no_actuator_is_refused() -> None:
    with pytest.raises(ValueError, match="width"):
        Pneunet(channel=(12e-3, 2e-3))


MODEL_SLOPE = 1e-5


@dataclass
class Line:
    """An actuator whose bend is a straight line: the loop's arithmetic alone."""

    broken: bool = False

    def bend(self, pressure: float, *, start: object = None, tolerance: float = 0.0) -> ReducedBend:
        outcome = Outcome.NOT_CONVERGED if self.broken and pressure > 5e4 else Outcome.COMPLETED
        state = ReducedState(np.zeros(1), np.zeros((1, 1)), outcome, 1)
        return ReducedBend(MODEL_SLOPE * pressure, MODEL_SLOPE, state)


def _control_run(gain: float, delay: int, *, gamma: float = 1.0, n: int = 400, noise: float = 0.0):
    p = np.linspace(0.0, 1e5, 5)
    plant = Plant(p, gamma * MODEL_SLOPE * p)
    section = _section([0.5], n, delay=delay, noise=noise)
    return run_loop(Controller(Line(), gain=gain, most=1e5), plant, section)


def _section(angles: list[float], ticks: int, **others: float) -> ControlSection:
    """A loop at 20 Hz with as many ticks for each angle, without lag, delay and noise but for the others."""
    plain = {"rate": 20.0, "seed": 1, "real_time": False, "delay": 0, "lag": 0.0, "noise": 0.0}
    return ControlSection.model_construct(angles=angles, hold=ticks / 20.0, **plain | others)


def test_limit_of_the_gain() -> None:
    # z - 1 + K, z^2 - z + K, z^3 - z^2 + K on the unit circle
    assert largest_gain(0) == pytest.approx(2.0)
    assert largest_gain(1) == pytest.approx(1.0)
    assert largest_gain(2) == pytest.approx((np.sqrt(5.0) - 1.0) / 2.0)


@pytest.mark.parametrize("delay", [1, 2, 3])
def test_the_loop_is_stable_below_it_and_not_above(delay: int) -> None:
    gamma, bound = 1.05, largest_gain(delay)
    calm = _control_run(0.9 * bound / gamma, delay, gamma=gamma, n=900)
    wild = _control_run(1.1 * bound / gamma, delay, gamma=gamma)
    assert np.abs(calm.angle[-20:] - 0.5).max() < 1e-3
    assert np.abs(wild.angle[-20:] - 0.5).max() > 0.05


def test_a_wrong_stiffness_is_learnt_geometrically() -> None:
    # gamma (wanted + s) = wanted in the end; without delay the error falls by 1 - K gamma each tick
    found = _control_run(0.2, 0, gamma=0.8)
    errors = 0.5 - found.angle[2:12]
    assert errors[1:] / errors[:-1] == pytest.approx(1.0 - 0.2 * 0.8, rel=1e-9)
    # the inverse ends within 1e-5 rad of the 0.5 / 0.8 rad that it is asked for
    assert found.pressure[-1] == pytest.approx(0.5 / (0.8 * MODEL_SLOPE), rel=1.6e-5)


def test_the_sum_does_not_grow_at_a_bound() -> None:
    controller = Controller(Line(), gain=0.5, most=1e5)
    for _ in range(50):
        assert controller.tick(1.5, 0.9).pressure == 1e5
    assert controller.sum == 0.0
    assert controller.tick(0.5, 0.5).pressure == pytest.approx(5e4)


def test_where_the_model_gives_none_the_pressure_is_held_and_said() -> None:
    controller = Controller(Line(broken=True), gain=0.5, most=1e5)
    first = controller.tick(0.4, 0.4)
    assert not first.held
    second = controller.tick(0.8, 0.8)
    assert second.held
    assert second.pressure == first.pressure


def test_the_first_tick_starts_from_the_nearest_angle() -> None:
    class Square:
        """A bend of 1e-10 p^2 that is not found more than 0.2 bar away from where it starts."""

        def bend(self, pressure: float, *, start: Any = None, tolerance: float = 0.0) -> ReducedBend:
            far = start is not None and abs(pressure - start[0]) > 2e4
            outcome = Outcome.NOT_CONVERGED if far else Outcome.COMPLETED
            state = ReducedState(np.array([pressure]), np.zeros((1, 1)), outcome, 1)
            return ReducedBend(1e-10 * pressure**2, 2e-10 * pressure + 1e-7, state)

    first = Controller(Square(), gain=0.5, most=1e5).tick(0.4, 0.4)  # type: ignore[arg-type]
    assert not first.held  # from rest the slope of 1e-7 would take it to the largest pressure
    # the inverse ends within 1e-5 rad, at a slope of 1.3e-5 rad/Pa
    assert first.pressure == pytest.approx(np.sqrt(0.4e10), abs=1.0)


def test_in_real_time_a_tick_begins_when_it_is_due(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = {"now": 100.0}

    def wait(seconds: float) -> None:
        clock["now"] += seconds + 2e-3  # it wakes up 2 ms late

    class Slow(Line):
        def bend(self, pressure: float, **options: object) -> ReducedBend:
            clock["now"] += 1e-3
            return super().bend(pressure)

    monkeypatch.setattr(actuator_control, "perf_counter", lambda: clock["now"])
    monkeypatch.setattr(actuator_control, "sleep", wait)
    p = np.linspace(0.0, 1e5, 5)
    controller = Controller(Slow(), gain=0.5, most=1e5)  # type: ignore[arg-type]
    # 0.45 rad lies between two of the angles that the controller knows
    plant, section = Plant(p, MODEL_SLOPE * p), _section([0.45], 5)
    found = run_loop(controller, plant, section.model_copy(update={"real_time": True}))
    # one bend of 1 ms on a line in every tick; all but the first begin with a wait
    assert found.wall == pytest.approx([1e-3, 3e-3, 3e-3, 3e-3, 3e-3])
    assert found.real_time
    assert clock["now"] == pytest.approx(100.009 + 4 * 50e-3 + 3e-3)  # nine bends make the controller
    assert not run_loop(controller, plant, section).real_time


def _check(angles: list[float], *, error: float = 0.005, reach: tuple[float, float] = (0.0, 0.4)) -> None:
    """Check angles against a plant up to 0.3 rad and a reduced model that is off by `error` at 0.2 rad."""
    unseen = np.array([0.1, 0.2, 0.3])
    made = Reduction(Line(), unseen, unseen, np.array([0.0, -error, 1.0]), np.nan)  # type: ignore[arg-type]
    section = ControlSection.model_construct(angles=angles, most=1e5, plant_stiffness=0.9, error=0.05)
    plant = Plant(np.array([0.0, 1e5]), np.array([0.0, 0.3]))
    check_targets("down", made, plant, section, reach=reach)


def test_an_angle_beyond_reach_is_refused_before_the_loop() -> None:
    _check([0.19, 0.1])
    with pytest.raises(ValueError, match=r"20.05° is beyond reach: the plant, 0.9 times as stiff, .* 17.19°"):
        _check([0.35])
    with pytest.raises(
        ValueError, match=r"10.89° is beyond reach: the model bends from 0° to 8.594° up to 1"
    ):
        _check([0.19], reach=(0.0, 0.15))
    with pytest.raises(ValueError, match="beyond reach"):
        _check([-0.01])


def test_the_reduced_model_is_judged_over_the_angles_it_is_asked_for() -> None:
    # the error of 1 rad at 0.3 rad is beyond what is asked; 0.0096 of 0.19 is above 5 %
    _check([0.19], error=0.0094)
    with pytest.raises(ValueError, match=r"0.55° off a bend of 10.89°, more than control.error = 0.05"):
        _check([0.19], error=0.0096)
    with pytest.raises(ValueError, match="off a bend"):
        _check([0.25])


def test_error_is_judged_where_it_has_settled() -> None:
    found = _control_run(0.5, 0, gamma=1.0, n=100, noise=0.0)
    assert found.settled_error() == pytest.approx([0.0], abs=1e-5)  # the inverse ends within 1e-5 rad
    assert _control_run(0.5, 0, gamma=1.0, n=100, noise=0.01).settled_error()[0] > 1e-3


@pytest.fixture(scope="module")
def reduction():
    return reduce_actuator(actuator(), DOWN, most=MOST, modes=6, tolerance=1e-4, seen=7)


def test_reduced_bend_is_that_of_the_whole_at_pressures_it_has_not_seen(reduction) -> None:
    assert len(reduction.model.reduced.sample.cells) < 40
    # the sampling leaves 1e-4 of the forces; the angle of a slender body is that many times more sensitive
    assert reduction.largest_error < 5e-3 * float(reduction.angle.max())


def test_reduced_slope_is_the_difference_of_bends(reduction) -> None:
    ends = [reduction.model.bend(p, tolerance=1e-12).angle for p in (29.9e3, 30.1e3)]
    assert reduction.model.bend(30e3, tolerance=1e-12).slope == pytest.approx(
        (ends[1] - ends[0]) / 200.0, rel=1e-6
    )


def test_loop_with_the_reduced_model_reaches_the_angle_of_a_softer_plant(reduction) -> None:
    soft = actuator()
    p = np.linspace(0.0, MOST, 5)
    angle = soft.simulate(DOWN, p, constants=soft.constants(0.85)).angle
    controller = Controller(reduction.model, gain=0.3, most=MOST)
    found = run_loop(controller, Plant(p, angle), _section([0.03, 0.05], 60, lag=0.02, delay=1))
    # the inverse ends within 1e-5 rad; of the first error of 15 % the loop leaves (1 - 0.3)^30 = 2e-5
    assert found.settled_error().max() < 1e-5
    assert not found.held.any()


def test_the_loop_of_a_specification_settles_at_its_angle() -> None:
    section = ControlSection.model_construct(
        angles=[0.02], hold=0.5, rate=20.0, gain=0.3, most=MOST, modes=4, tolerance=1e-3, snapshots=3,
        plant_stiffness=0.85, delay=0, lag=0.0, noise=0.0, seed=1, real_time=False, error=0.05,
    )  # fmt: skip
    closed, made = actuator_control.run_control(actuator(chambers=1), {"down": np.array(DOWN)}, section)
    assert made["down"].error_up_to(0.02) <= 0.05 * 0.02
    # of the first error of about 15 % a tick leaves 1 - 0.3 / 0.85; the last five of ten are judged
    assert 0.0 < closed["down"].settled_error()[0] < 0.15 * 0.02 * (1.0 - 0.3) ** 4
