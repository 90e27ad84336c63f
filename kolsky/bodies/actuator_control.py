"""Closed loop of an actuator: reduced model, controller and simulated plant.

The controller converts the measured bend to a pressure in milliseconds. It uses the inverse of the reduced
model.

    s <- s + K (Theta_d - Theta_m),   p = Theta_model^-1(Theta_d + s)                           (A.3)

at every tick, with the target angle, the measured angle and the gain K. The sum s estimates the model's
error. It does not grow while the pressure is at a bound. Let the plant's slope be gamma times the model's,
and the measurement be delayed by d ticks. The loop is stable for

    K gamma < 2 sin(pi / (2 (2 d + 1)))                                                        (A.4)

(the roots of z^(d+1) - z^d + K gamma lie inside the unit circle; Levin and May 1976).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter, process_time, sleep

import numpy as np
from scipy.interpolate import PchipInterpolator

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.bodies.actuator_model import WEIGHT, Actuator, bend_of, bend_slope, smallest_gap
from kolsky.bodies.actuator_reading import ControlSection
from kolsky.equilibrium.reduction import ReducedModel, ReducedState, reduce

FINER = 3
"""Maximum number of divisions by ten of the tolerance for choosing elements. Below 1e-6 of the forces, the
remaining error is due to missing modes."""
BASIS_PRESSURES = 13
"""Number of pressures for the basis. Between two of them, there is one check pressure."""


@dataclass(frozen=True)
class ReducedBend:
    """An equilibrium of the reduced actuator."""

    angle: float
    """Bending angle [rad]."""
    slope: float
    """dTheta/dp [rad/Pa]."""
    state: ReducedState


class ReducedActuator:
    """Bend over pressure from a reduced model."""

    def __init__(self, reduced: ReducedModel) -> None:
        self.reduced = reduced
        mesh = reduced.model.mesh
        tip, origin = (mesh.points[mesh.nodes(where)].mean(axis=0) for where in ("tip", "origin"))
        self._rest = tip - origin
        self._modes = reduced.rows("tip") - reduced.rows("origin")

    def bend(
        self, pressure: float, *, start: FloatArray | None = None, tolerance: float = 1e-9
    ) -> ReducedBend:
        """The bend under a pressure [Pa]. The search starts from nearby amplitudes."""
        state = self.reduced.equilibrium([pressure], start=start, tolerance=tolerance)
        chord = self._rest + self._modes @ state.q
        slope = float(bend_slope(chord) @ (self._modes @ state.slopes[:, 0]))
        return ReducedBend(float(bend_of(chord)), slope, state)


@dataclass(frozen=True)
class Reduction:
    """A reduced actuator with its error."""

    model: ReducedActuator
    pressure: FloatArray
    """Check pressures, between the pressures of the basis [Pa], shape [n]."""
    angle: FloatArray
    """Angle of the full model at the check pressures [rad], shape [n]."""
    error: FloatArray
    """Angle of the reduced model minus that of the full model [rad], shape [n]."""
    gap: float
    """Smallest distance of neighbouring chambers of the full model at any pressure [m]; NaN without gaps."""

    @property
    def largest_error(self) -> float:
        """Largest error at a check pressure [rad]."""
        return float(np.abs(self.error).max())

    def error_up_to(self, angle: float) -> float:
        """Largest error at check pressures up to the first with a bend of at least `angle` [rad]."""
        beyond = np.flatnonzero(self.angle >= angle)
        last = beyond[0] + 1 if len(beyond) else len(self.angle)
        return float(np.abs(self.error[:last]).max())


def reduce_actuator(
    actuator: Actuator,
    gravity: Sequence[float] | FloatArray,
    *,
    most: float,
    modes: int,
    tolerance: float,
    seen: int = BASIS_PRESSURES,
    within: tuple[float, float] | None = None,
) -> Reduction:
    """Reduce an actuator with one cavity for pressures in [0, most].

    ``within``: an angle, and the largest allowed error of the bend at check pressures up to it [rad]. The
    elements are chosen by the error of the forces. The bend may contribute little to this error. The
    tolerance is therefore divided by ten, up to `FINER` times, until the error is small enough.
    """
    if len(actuator.cavities) != 1:
        raise ValueError("the reduced model and its loop have one pressure: set separate = false")
    if actuator.contacts or actuator.world:
        raise ValueError("the reduced model has no contact: remove [contact], [plane] and [blocked]")
    pressures = np.linspace(0.0, most, 2 * seen - 1)
    whole = actuator.simulate(gravity, pressures)
    reached = 1e-5 * pressures[max(whole.solution.reached - 1, 0)]
    whole.solution.outcome.require(f"beyond {reached:.3g} bar")
    model, snapshots = whole.solution.model, whole.solution.displacements[::2]
    check, angle = pressures[1::2], whole.angle[1::2]
    gaps = smallest_gap(whole)
    gap = float("nan") if np.isnan(gaps).all() else float(np.nanmin(gaps))
    found = None
    for finer in range(FINER + 1):
        choice = 0.1**finer * tolerance
        made = ReducedActuator(reduce(model, snapshots, modes=modes, tolerance=choice, gravity=WEIGHT))
        try:
            angles = _reduced_angles(made, check)
        except ValueError:
            if within is None or finer == FINER:
                raise
            continue
        found = Reduction(made, check, angle, angles - angle, gap)
        if within is None or found.error_up_to(within[0]) <= within[1]:
            break
    assert found is not None
    return found


def _reduced_angles(made: ReducedActuator, pressures: FloatArray) -> FloatArray:
    """Angles of the reduced actuator [rad], shape [n]. Raises ValueError if there is no equilibrium."""
    angles, start = [], None
    for pressure in pressures:
        bend = made.bend(float(pressure), start=start)
        if not bend.state.outcome.ok:
            raise ValueError(
                f"the reduced model has no equilibrium at {1e-5 * pressure:.3g} bar: raise control.modes or "
                "control.snapshots, or lower control.tolerance"
            )
        angles.append(bend.angle)
        start = bend.state.q
    return np.array(angles)


ANGLE_TOLERANCE = 1e-5
"""Difference from the target angle at which the inverse ends [rad]."""
_INVERSIONS = 8
"""Maximum number of Newton steps in a tick."""
_EQUILIBRIUM = 1e-6
"""Tolerance of the equilibria in a tick, as a share of the forces [-]."""


def largest_gain(delay: int) -> float:
    """Upper limit of K gamma for a delay of whole ticks, Eq. (A.4) [-]."""
    return float(2.0 * np.sin(np.pi / (2.0 * (2.0 * delay + 1.0))))


@dataclass(frozen=True)
class Tick:
    """Output of the controller at one tick."""

    pressure: float
    """Pressure [Pa], in [0, most]."""
    bounded: bool
    """True if the pressure is at a bound."""
    held: bool
    """True if the model gave no pressure. The last pressure was kept."""


class Controller:
    """The controller of Eq. (A.3). Its state is the sum s and the last equilibrium."""

    def __init__(self, model: ReducedActuator, *, gain: float, most: float) -> None:
        self.model, self.gain, self.most = model, gain, most
        self.sum = 0.0
        self.pressure = 0.0
        self._path = [(0.0, model.bend(0.0))]
        for pressure in np.linspace(0.0, most, 9)[1:]:
            start = self._path[-1][1].state.q
            self._path.append((float(pressure), model.bend(float(pressure), start=start)))
        self._low, self._high = self._path[0][1], self._path[-1][1]
        self._last: ReducedBend = self._low

    @property
    def reach(self) -> tuple[float, float]:
        """Angles of the model at the smallest and the largest pressure [rad]."""
        return self._low.angle, self._high.angle

    def tick(self, wanted: float, measured: float) -> Tick:
        """Return the pressure for a target angle, given the measured angle; both in rad."""
        error = wanted - measured
        asked = wanted + self.sum + self.gain * error
        bounded = not self._low.angle <= asked <= self._high.angle
        outward = (asked > self._high.angle and error > 0.0) or (asked < self._low.angle and error < 0.0)
        if not outward:
            self.sum += self.gain * error
        if bounded:
            above = asked > self._high.angle
            self._last = self._high if above else self._low
            self.pressure = self.most if above else 0.0
            return Tick(self.pressure, True, False)
        found = self._inverse(asked)
        return Tick(self.pressure, False, not found)

    def _inverse(self, asked: float) -> bool:
        """Newton's method for the pressure, from the nearest known angle; False if it does not converge."""
        pressure, near = min(
            [(self.pressure, self._last), *(one for one in self._path if one[1].state.outcome.ok)],
            key=lambda one: abs(asked - one[1].angle),
        )
        for _ in range(_INVERSIONS):
            left = asked - near.angle
            if abs(left) <= ANGLE_TOLERANCE:
                self.pressure, self._last = pressure, near
                return True
            if not near.slope > 0.0:
                return False
            following = float(np.clip(pressure + left / near.slope, 0.0, self.most))
            # the path continues along dq/dp
            start = near.state.q + near.state.slopes[:, 0] * (following - pressure)
            near = self.model.bend(following, start=start, tolerance=_EQUILIBRIUM)
            pressure = following
            if not near.state.outcome.ok:
                return False
        return False


@dataclass(frozen=True)
class Plant:
    """A simulated actuator. Its pressure supply and its camera are those of [control]."""

    pressure: FloatArray
    """Pressures [Pa], increasing, shape [n]."""
    angle: FloatArray
    """Angle of the full model with the plant's stiffness at these pressures [rad], shape [n]."""


JUDGED_SHARE = 0.5
"""The error is evaluated in this last share of each target's time [-]."""


@dataclass(frozen=True)
class Closed:
    """A run of the closed loop."""

    time: FloatArray
    """Times of the ticks [s], shape [n]."""
    wanted: FloatArray
    """Target angle [rad], shape [n]."""
    measured: FloatArray
    """Measured angle, the input of the controller [rad], shape [n]."""
    angle: FloatArray
    """Angle of the plant [rad], shape [n]."""
    pressure: FloatArray
    """Requested pressure [Pa], shape [n]."""
    wall: FloatArray
    """Wall time from the beginning of each tick to its pressure [s], shape [n]."""
    processor: FloatArray
    """Processor time of the controller in each tick [s], shape [n]. Other programs do not affect it."""
    bounded: BoolArray
    """Ticks at a bound of the pressure, shape [n]."""
    held: BoolArray
    """Ticks in which the model gave no pressure, shape [n]."""
    rate: float
    """Ticks a second [1/s]."""
    real_time: bool = False
    """True if every tick waited for its scheduled time. Its wall time then begins at that time."""

    @property
    def late(self) -> int:
        """Ticks that took longer than their period."""
        return int((self.wall > 1.0 / self.rate).sum())

    def settled_error(self) -> FloatArray:
        """Root mean square of plant minus target angle [rad], over the last half of each target's time."""
        starts = np.flatnonzero(np.diff(self.wanted, prepend=np.nan) != 0.0)
        ends = [*starts[1:], len(self.wanted)]
        errors = []
        for a, b in zip(starts, ends, strict=True):
            part = slice(a + int(JUDGED_SHARE * (b - a)), b)
            errors.append(float(np.sqrt(np.mean((self.angle[part] - self.wanted[part]) ** 2))))
        return np.array(errors)


def run_loop(controller: Controller, plant: Plant, section: ControlSection) -> Closed:
    """Run the closed loop for the target angles of a section. The pressure follows the requested one with the
    plant's lag. The camera measures the angle with noise and a delay of some ticks. In real time, each tick
    waits for its scheduled time, and the wake-up delay is part of its wall time."""
    rng, wanted, rate = np.random.default_rng(section.seed), schedule(section), section.rate
    bend, real_time = PchipInterpolator(plant.pressure, plant.angle), section.real_time
    n, dt = len(wanted), 1.0 / rate
    follow = 1.0 - np.exp(-dt / section.lag) if section.lag > 0.0 else 1.0
    inside = 0.0
    columns = {name: np.zeros(n) for name in ("measured", "angle", "pressure", "wall", "processor")}
    bounded, held = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    begun = perf_counter()
    for k in range(n):
        columns["angle"][k] = bend(inside)
        seen = columns["angle"][max(k - section.delay, 0)] + section.noise * rng.standard_normal()
        due = begun + k * dt
        while real_time and (left := due - perf_counter()) > 0.0:
            sleep(left)
        started, worked = due if real_time else perf_counter(), process_time()
        decided = controller.tick(float(wanted[k]), float(seen))
        columns["wall"][k], columns["processor"][k] = perf_counter() - started, process_time() - worked
        columns["measured"][k], columns["pressure"][k] = seen, decided.pressure
        bounded[k], held[k] = decided.bounded, decided.held
        inside += follow * (decided.pressure - inside)
    time = np.asarray(dt * np.arange(n), dtype=np.float64)
    return Closed(time, wanted, **columns, bounded=bounded, held=held, rate=rate, real_time=real_time)


_PLANT_STEPS = 9
"""Number of pressures at which the plant's bend is simulated."""


def run_control(
    actuator: Actuator, gravities: Mapping[str, FloatArray], section: ControlSection
) -> tuple[dict[str, Closed], dict[str, Reduction]]:
    """Reduce the actuator, simulate the plant, and run the closed loop, for each direction of gravity.

    Raises ValueError if an equilibrium is not found, or if model or plant do not reach a target angle.
    """
    prepared, reductions = {}, {}
    pressures = np.linspace(0.0, section.most, _PLANT_STEPS)
    for name, gravity in gravities.items():
        made = reduce_actuator(
            actuator, gravity, most=section.most, modes=section.modes, tolerance=section.tolerance,
            seen=section.snapshots, within=(max(section.angles), allowed_error(section)),
        )  # fmt: skip
        run = actuator.simulate(gravity, pressures, constants=actuator.constants(section.plant_stiffness))
        run.solution.outcome.require("the plant")
        plant = Plant(pressures, run.angle)
        controller = Controller(made.model, gain=section.gain, most=section.most)
        check_targets(name, made, plant, section, reach=controller.reach)
        prepared[name], reductions[name] = (controller, plant), made
    closed = {name: run_loop(*pair, section) for name, pair in prepared.items()}
    return closed, reductions


def check_targets(
    name: str, made: Reduction, plant: Plant, section: ControlSection, *, reach: tuple[float, float]
) -> None:
    """Check that model and plant reach the target angles, and that the model is accurate up to them.

    ``reach``: angles of the model at pressures 0 and `most` [rad]. Raises ValueError with the range or the
    error.
    """
    ranges = {
        "the model": reach,
        f"the plant, {section.plant_stiffness:g} times as stiff,": (plant.angle.min(), plant.angle.max()),
    }
    for who, (low, high) in ranges.items():
        for angle in section.angles:
            if not low <= angle <= high:
                raise ValueError(
                    f"{name}: {np.degrees(angle):.4g}° is beyond reach: {who} bends from "
                    f"{np.degrees(low):.4g}° to {np.degrees(high):.4g}° up to {1e-5 * section.most:.3g} "
                    "bar; raise control.most, or give an angle inside"
                )
    largest = float(np.abs(section.angles).max())
    error = made.error_up_to(max(section.angles))
    if error > allowed_error(section):
        raise ValueError(
            f"{name}: the reduced model is {np.degrees(error):.3g}° off a bend of "
            f"{np.degrees(largest):.4g}°, more than control.error = {section.error:g} of it: raise "
            "control.modes or control.snapshots, or lower control.tolerance"
        )


def allowed_error(section: ControlSection) -> float:
    """Largest error of the reduced model's bend [rad]."""
    return section.error * float(np.abs(section.angles).max())


def schedule(section: ControlSection) -> FloatArray:
    """Target angle of each tick [rad], shape [n]."""
    return np.repeat(np.array(section.angles), max(1, round(section.hold * section.rate)))


def loop_warnings(
    closed: Mapping[str, Closed], reductions: Mapping[str, Reduction], section: ControlSection
) -> list[str]:
    """Warnings about the results of the loop."""
    warnings = []
    bound = largest_gain(section.delay)
    if section.gain / section.plant_stiffness >= bound:
        warnings.append(
            f"the gain {section.gain:g} on a plant {section.plant_stiffness:g} times as stiff is not below "
            f"{bound * section.plant_stiffness:.3g}, the limit of stability with a delay of {section.delay} "
            "tick(s): lower the gain"
        )
    for name, run in closed.items():
        if run.late:
            warnings.append(
                f"{name}: {run.late} of {len(run.time)} ticks took longer than {1e3 / run.rate:.3g} ms"
            )
        if run.held.any():
            warnings.append(
                f"{name}: in {int(run.held.sum())} ticks the model gave no pressure; the last was held"
            )
        if reductions[name].gap < 0.0:
            warnings.append(
                f"{name}: neighbouring chambers overlap below the largest pressure, which they cannot: the "
                "bends there are not those of the actuator; lower most or widen the gap"
            )
        sample = reductions[name].model.reduced.sample
        if not sample.reached:
            warnings.append(
                f"{name}: the chosen elements leave {sample.residual:.2g} of the forces, "
                "more than the tolerance"
            )
    return warnings
