"""Change of "prediction minus data" by a step of an input. Some inputs need runs, others only the data.

All directions, and the Jacobian by the free parameters, come from runs on the surrogate's mesh. With
different meshes, their ringing would not cancel. Parameters and curves share one batch. A change of the mesh,
of its mass, or of unnamed friction has a separate batch. No run is needed for a scale, a zero, a clock or a
position of a measurement.

A wrong input changes the prediction. The free parameters absorb a part of this change, which shifts the
optimum. The rest remains in the residual:

    shift = -G c,    rest = c + J shift,    visible share = |rest / sigma|^2 / |c / sigma|^2

with the direction c, the Jacobian J and the least-squares map G (`Objective.gain`). If the share is near
zero, the data cannot reveal an error of the input.

An error that the residual shows also changes the weights: the discrepancies grow, and a channel that
disagrees counts less. The shift by a declared uncertainty is therefore that of a repeated identification of
the linear model, with the discrepancies estimated again (`InputDirections.repeated_shift`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import floor, log10
from typing import Any

import numpy as np

from explicit import Response
from explicit.materials import MaterialLaw
from explicit.model import scale_of
from kolsky.bars.signals.transducers import ForceBins
from kolsky.base.arrays import FloatArray
from kolsky.base.records import MaterialCurve
from kolsky.inverse.forward import Forward, material_law
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Observations, predict
from kolsky.inverse.parameters import PARAMETERS, has_effect
from kolsky.inverse.runner import Runner
from kolsky.inverse.work import Launch, run_side_by_side
from kolsky.shot.input_records import CLOCK, OFFSET, Input
from kolsky.shot.inputs import INPUTS
from kolsky.shot.records import ForceChannel, Shot


def outline_follows(change: FloatArray, step: float, diameter: float, n_force: int) -> FloatArray:
    """Change of prediction minus data by a larger diameter, if the diameter defines the outline's axis.

    If the axis lies the declared radius behind the undeformed surface, it moves back with a larger radius.
    Every measured Z then increases as the model's outline does; only the effect of strain remains.
    ``change``: of the prediction only, [k]. ``step``: relative increase of the diameter [m]. ``n_force``:
    entries of the force.
    """
    found = change.copy()
    found[n_force:] -= 0.5 * step * diameter
    return found


def height_follows(shot: Shot, step: float) -> float:
    """Error of the outline's heights for a relative error `step` of the length [m].

    If the length is partly measured in the pictures, a part of the height error is correlated with that of
    the length (`kolsky.pictures.specimen_length`). The rest is independent, in the direction of the heights.
    """
    found = shot.length_by_pictures
    return 0.0 if found is None else found.y_per_length * step * shot.specimen.length


SHARES = {"stiffness_factor": 0.003}
"""Step of a free parameter that is not an input, divided by its scale (`explicit.model.scale_of`) [-]."""
SHARE = 0.05
"""Reference change of the other inputs [-]."""
PERCENT = 0.01
"""Reference change of a scale (relative) and of friction [-]."""
WEIGHINGS = 2
"""Iterations of discrepancies and shift. In `runs/open-05` a third changes no shift above a hundredth of the
standard uncertainty by more than 1 %."""
ROUNDING = 1e-9
"""Rounding tolerance for a logarithm that is a whole number."""


def parameter_step(name: str, value: float) -> float:
    """Step of a parameter from a value, in its unit."""
    own = PARAMETERS[name].scale
    scale = scale_of(name, value) if own is None else own(value)
    share = INPUTS[name].step if name in INPUTS else 0.0
    return (share or SHARES.get(name, SHARE)) * scale


def _step(one: Input, shot: Shot, objective: Objective) -> float:
    """Step of an input, in its unit or relative."""
    if one.parameter:
        return parameter_step(one.parameter, PARAMETERS[one.parameter].held(shot))
    if one.unit == "N":
        return one.step * float(abs(objective.data[: objective.n_force]).max())
    return one.step


def plain_amount(key: str, value: float) -> float:
    """Reference change of an input, in its unit or relative: 1 %, 1 us, 10 um, or 0.01.

    For Poisson's ratio ``value``, it is the largest power of ten not above a hundredth of its distance from
    1/2.
    """
    one = INPUTS[key]
    if one.relative:
        return PERCENT
    if key == "poisson":
        return 10.0 ** floor(log10(one.step * (0.5 - value)) + ROUNDING)
    return {"s": CLOCK, "m": OFFSET}.get(one.unit, PERCENT)


def no_part(key: str, *, free: Iterable[str], held: Iterable[str], shot: Shot, seen: Observations) -> str:
    """The reason why an input has no separate effect on this shot's answer. Empty if it has one."""
    if key in free:
        return "free, found from the data"
    laws = {shot.interface.faces, shot.interface.side}
    one = INPUTS[key]
    if one.parameter and key not in held and not has_effect(PARAMETERS[key], laws):
        return f"no effect: {PARAMETERS[key].without}"
    if one.needs == "force channel" and not isinstance(shot.force, ForceChannel):
        return "no effect: the force is from the bar's waves"
    if one.needs == "outline" and not seen.has_shape:
        return "no effect: no outline was measured"
    return ""


@dataclass(frozen=True)
class ModelAtOptimum:
    """The run at the optimum, used for inputs that need no separate run.

    The effect of a scale or a clock on the data is computed from the model's force and outline. They have no
    noise, and ring as the Jacobian does; see `kolsky.shot.input_records.Model`.
    """

    objective: Objective
    observations: Observations
    reference: Response
    """The run at the optimum. Its times include `CLOCK` before and after each frame."""

    def change(self, *, transmitted: Any = 0.0, force: Any = 0.0, outline: Any = 0.0) -> FloatArray:
        """A change of prediction minus data, [k], by the transmitted force, all forces and the outline."""
        n, change = self.objective.n_force, np.zeros(len(self.objective.data))
        change[:n], change[n:] = force, outline
        change[: len(self.observations.bins.mean)] += transmitted
        return change

    def transmitted(self) -> FloatArray:
        """The transmitted force in its bins [N], shape [n]."""
        return self._seen()[: len(self.observations.bins.mean)]

    def higher(self, step: float) -> FloatArray:
        """Change of the prediction if the outline points are higher by a step [m], shape [k]."""
        y = self.observations.centre_line.y
        return np.asarray(0.5 * (self._seen(y=y + step) - self._seen(y=y - step)))

    def heights_with_length(self, shot: Shot, step: float) -> FloatArray:
        """Change of prediction minus data by heights that grow with the length (`height_follows`), [k]."""
        heights = height_follows(shot, step)
        if heights == 0.0 or not self.objective.counted.any():
            return np.zeros(len(self.objective.data))
        return self.higher(heights)

    def force_rate(self) -> FloatArray:
        """Time derivative of the model's (noise-free) force in each bin [N/s], shape [n_bins]."""

        def rate(bins: ForceBins, which: str) -> FloatArray:
            run = self.reference
            force = run.force_transmission if which == "transmission" else run.force_flyer
            at = np.interp(bins.edges, run.force_times, force[0])
            return np.asarray(np.diff(at) / np.diff(bins.edges))

        return self.observations.of_forces(rate)

    def outline_rate(self) -> FloatArray:
        """Time derivative of the radius at each counted point's height [m/s], shape [n_counted]."""
        time = self.observations.centre_line.time
        first, last = self.reference.surface_times[0], self.reference.surface_times[-1]
        before, after = (np.maximum(time - CLOCK, first), np.minimum(time + CLOCK, last))
        up, down = self._seen(time=after), self._seen(time=before)
        return np.asarray((up - down)[self.objective.n_force :] / (after - before)[self.objective.counted])

    def _seen(self, y: FloatArray | None = None, time: FloatArray | None = None) -> FloatArray:
        """The predicted data vector with the outline taken at other heights or times."""
        line = self.observations.centre_line
        line = replace(line, y=line.y if y is None else y, time=line.time if time is None else time)
        seen = replace(self.observations, centre_line=line)
        return np.asarray(self.objective.vectors(predict(self.reference, seen))[0])


class RunLost(ValueError):
    """A run with a changed input did not complete."""


@dataclass(frozen=True)
class MovedRuns:
    """Runs with changed parameters, curves and specimens, all on the surrogate's mesh."""

    runner: Runner
    x: FloatArray
    """The optimum in SI, shape [d]."""
    objective: Objective
    steps: Mapping[str, float]
    """Key -> step of each input to be changed."""

    @property
    def forward(self) -> Forward:
        """The shot prepared to run, with surface output also shortly before and after each frame."""
        forward = self.runner.forward
        frames = self.runner.problem.observations.frame_times
        if not frames.size:
            return forward
        first, last = forward.sampling.surface_times[[0, -1]]
        close = np.concatenate([frames - CLOCK, frames, frames + CLOCK])
        close = close[(close >= first) & (close <= last)]
        return replace(forward, sampling=replace(forward.sampling, surface_times=np.unique(close)))

    @property
    def point(self) -> dict[str, float]:
        """The optimum and the held parameters, by name."""
        return self.runner.at(self.x, self.runner.problem.numerics.mesh)

    @property
    def named(self) -> tuple[str, ...]:
        """Inputs in the common batch: parameters with no other effect than their value when named."""
        held = self.runner.problem.settings.held
        return tuple(
            key
            for key in self.steps
            if key in PARAMETERS and (PARAMETERS[key].changed is None or key in held)
        )

    @cached_property
    def rows(self) -> dict[tuple[str, int], int]:
        """Row of the common batch by name and sign. ("", 0) is the optimum."""
        keys = [("", 0)] + [(name, sign) for name in self.runner.problem.box.names for sign in (1, -1)]
        for key in self.named:
            value = self.value(key)
            low, high = PARAMETERS[key].allowed
            keys += [(key, sign) for sign in (1, -1) if low <= value + sign * self.steps[key] <= high]
        keys += [("curve_scale", sign) for sign in (1, -1) if "curve_scale" in self.steps]
        return {key: row for row, key in enumerate(keys)}

    def value(self, key: str) -> float:
        """The value of a parameter that is not free."""
        return self.runner.problem.settings.held.get(key, PARAMETERS[key].held(self.forward.shot))

    @property
    def common(self) -> Response:
        """The common batch."""
        return self._responses[""]

    @cached_property
    def _responses(self) -> dict[str, Response]:
        """The common batch, and the batch of each changed shot by key and sign, run in parallel."""
        keys, numerics = {"": self._common}, self.runner.problem.numerics
        for key, step in self.steps.items():
            if self._is_alone(key):
                for sign in (1, -1):
                    changed = self._changed(key, sign * step)
                    if changed is not None:
                        forward = replace(self.forward, shot=changed)
                        keys[f"{key}{sign:+d}"] = Launch(forward, self.point, numerics)
        return dict(zip(keys, run_side_by_side(list(keys.values())), strict=True))

    @property
    def _common(self) -> Launch:
        point = {**self.point, **{key: self.value(key) for key in self.named}}
        columns = {name: np.full(len(self.rows), value) for name, value in point.items()}
        material = np.zeros(len(self.rows), dtype=np.int64)
        forward, low, high = self.forward, *self._design
        for (key, sign), row in self.rows.items():
            if key == "curve_scale":
                material[row] = 1 if sign > 0 else 2
            elif key in self.runner.problem.box.names:
                i = self.runner.problem.box.names.index(key)
                columns[key][row] = (high if sign > 0 else low)[i]
            elif key:
                columns[key][row] += sign * self.steps[key]
        if "curve_scale" in self.steps:
            curve, step = forward.shot.curve, self.steps["curve_scale"]
            forward = replace(
                forward, laws=(forward.laws[0], *(_scaled_law(curve, 1.0 + s * step) for s in (1.0, -1.0)))
            )
        return Launch(forward, columns, self.runner.problem.numerics, material=material)

    @property
    def _design(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper ends of the central differences by the free parameters, shape [d] each."""
        lower, upper = np.array(self.runner.problem.box.lower), np.array(self.runner.problem.box.upper)
        # where the surrogate's mesh responds like the refined mesh at the optimum
        x = self.runner.solver_values(self.x[None], self.runner.problem.numerics.mesh)[0]
        values = zip(self.runner.problem.box.names, x.tolist(), strict=True)
        step = np.array([parameter_step(name, value) for name, value in values])
        return np.maximum(x - step, lower), np.minimum(x + step, upper)

    def reference_and_jacobian(self) -> tuple[Response, FloatArray]:
        """The run at the optimum, and the Jacobian of the data vector, shape [k, d]."""
        down, up = self._design
        try:
            slopes = [
                (self._vector((name, 1)) - self._vector((name, -1))) / (up - down)[i]
                for i, name in enumerate(self.runner.problem.box.names)
            ]
            self._vector(("", 0))
        except RunLost as lost:
            raise ValueError(f"beside the optimum, {lost}") from None
        return self.common.select([0]), np.nan_to_num(np.array(slopes)).T

    def change(self, key: str, step: float) -> FloatArray:
        """Change of the predicted data vector, [k]: a central difference if both signs are possible.

        Raises RunLost if a run with the changed input did not complete.
        """
        up, down = self.moved(key, 1, step), self.moved(key, -1, step)
        if up is not None and down is not None:
            return np.asarray(0.5 * (up - down))
        centre = self.moved("", 0, 0.0)
        assert centre is not None
        if up is not None:
            return np.asarray(up - centre)
        assert down is not None  # a range is wider than one step on one side at least
        return np.asarray(centre - down)

    def moved(self, key: str, sign: int, step: float) -> FloatArray | None:
        """The predicted data vector with an input increased or decreased; None if not allowed."""
        if self._is_alone(key):
            if step != self.steps[key]:
                raise ValueError(f"{key} was moved by {self.steps[key]:.6g}, not by {step:.6g}")
            response = self._responses.get(f"{key}{sign:+d}")
            return None if response is None else self._seen(response, 0, key)
        return self._vector((key, sign)) if (key, sign) in self.rows else None

    def _is_alone(self, key: str) -> bool:
        """True if an input needs a separate model."""
        one = INPUTS.get(key)
        if one is None or one.seen is not None:
            return False
        return one.key not in self.named if one.parameter else one.applied is not None

    def _changed(self, key: str, step: float) -> Shot | None:
        """The shot with an input changed by a step; None if the value is not allowed."""
        one, shot = INPUTS[key], self.forward.shot
        if not one.parameter:
            assert one.applied is not None  # else it is seen without a run, or joins the common batch
            return one.applied(shot, 1.0 + step if one.relative else step)
        p, value = PARAMETERS[key], self.value(key) + step
        if not p.allowed[0] <= value <= p.allowed[1]:
            return None
        assert p.changed is not None  # else it joins the common batch
        return p.changed(shot, value)

    def _vector(self, key: tuple[str, int]) -> FloatArray:
        return self._seen(self.common, self.rows[key], key[0])

    def _seen(self, response: Response, row: int, key: str) -> FloatArray:
        if not response.outcomes[row].ok:
            raise RunLost(f"the run with a changed {key or 'nothing'} ended {response.describe(row)}")
        prediction = predict(response.select([row]), self.objective.observations)
        return np.asarray(self.objective.vectors(prediction)[0])


def _scaled_law(curve: MaterialCurve, factor: float) -> MaterialLaw:
    """The law of a curve with all stresses multiplied."""
    if curve.law is not None:
        return curve.law.scaled(factor)
    return material_law(replace(curve, stress=factor * curve.stress))


@dataclass(frozen=True)
class InputDirection:
    """One input, and the change of the data vector by a step of it."""

    key: str
    """Its key of `kolsky.shot.inputs.INPUTS`."""
    step: float
    """Its increase, in its unit or relative."""
    change: FloatArray
    """Change of prediction minus data by the step, shape [k]; zero at outline points that are not reached."""
    value: float
    """Its declared value in SI; NaN for a scale or an offset without a value."""

    @property
    def slope(self) -> FloatArray:
        """Change of prediction minus data for one unit of it, shape [k]."""
        return self.change / self.step


@dataclass(frozen=True)
class InputDirections:
    """The directions of all inputs at an optimum, and the Jacobian by the free parameters."""

    names: tuple[str, ...]
    """Free parameters, length d."""
    objective: Objective
    vector: FloatArray
    """Predicted data vector at the optimum on the refined mesh, shape [k]."""
    jacobian: FloatArray
    """Derivative of the data vector by the free parameters, on the surrogate's mesh, shape [k, d]."""
    directions: tuple[InputDirection, ...]
    absent: Mapping[str, str] = field(default_factory=dict)
    """Key -> reason why an input has no direction: it is free, has no effect, or its run did not complete."""

    def __getitem__(self, key: str) -> InputDirection:
        """The direction of an input. Raises KeyError with the reason if it has none."""
        for one in self.directions:
            if one.key == key:
                return one
        raise KeyError(f"{key}: {self.absent.get(key, 'no such input')}")

    @property
    def keys(self) -> tuple[str, ...]:
        """Inputs that have a direction."""
        return tuple(one.key for one in self.directions)

    @cached_property
    def gain(self) -> FloatArray:
        """Linear map from data minus prediction to the shift of the optimum, shape [d, k]."""
        return self.objective.gain(self.jacobian)

    def shift(self, key: str) -> FloatArray:
        """Change of the optimum by the input's step, in SI, shape [d]."""
        # The map is from data minus prediction, hence the sign.
        return np.asarray(-self.gain @ self[key].change)

    def repeated_shift(self, key: str, step: float) -> FloatArray:
        """Change of the optimum, in SI, [d], if the identification is repeated with an input changed.

        The weights are those of the new residual, with its own discrepancies.
        """
        change, weighed = step * self[key].slope, self.objective
        shift = -self.gain @ change
        for _ in range(WEIGHINGS):
            weighed = weighed.with_discrepancy(self.vector + change + self.jacobian @ shift)
            shift = -weighed.gain(self.jacobian) @ change
        return np.asarray(shift)

    def rest(self, key: str) -> FloatArray:
        """Change of the residual by the step after the free parameters are refitted, shape [k]."""
        return np.asarray(self[key].change + self.jacobian @ self.shift(key))

    def visible(self, key: str) -> float:
        """Share of the direction that remains in the residual, 0 to 1, in weighted squares [-]."""
        whitened = self.objective.whitened
        whole = float(np.sum(whitened(self[key].change) ** 2))
        return float(np.sum(whitened(self.rest(key)) ** 2)) / whole if whole > 0.0 else 0.0

    def likeness(self, one: str, other: str) -> float:
        """Cosine of the residual changes by two inputs; near +-1 the data cannot distinguish them.

        It is zero if one of them leaves no residual.
        """
        a, b = self.objective.whitened(self.rest(one)), self.objective.whitened(self.rest(other))
        size = float(np.linalg.norm(a) * np.linalg.norm(b))
        return float(a @ b) / size if size > 0.0 else 0.0


def input_directions(
    runner: Runner, x: FloatArray, objective: Objective, vector: FloatArray
) -> InputDirections:
    """The change of the data vector by every input with an effect on the answer.

    ``x``: the optimum in SI, shape [d]. ``objective``: with its discrepancies. ``vector``: predicted data
    vector there on the refined mesh, shape [k]. Raises ValueError if the run at the optimum, a run for the
    Jacobian, or one of an input that is declared uncertain does not complete.
    """
    shot, box, held = runner.problem.shot, runner.problem.box, runner.problem.settings.held
    absent = {
        key: why
        for key, one in INPUTS.items()
        if one.step
        and (why := no_part(key, free=box.names, held=held, shot=shot, seen=runner.problem.observations))
    }
    wanted = {
        key: _step(one, shot, objective) for key, one in INPUTS.items() if one.step and key not in absent
    }
    runner.work.progress("inputs", 0, len(wanted))
    batch = MovedRuns(runner, x, objective, wanted)
    reference, jacobian = batch.reference_and_jacobian()
    model = ModelAtOptimum(objective, runner.problem.observations, reference)
    found = []
    for done, (key, step) in enumerate(wanted.items()):
        seen = INPUTS[key].seen
        if seen is not None:
            change = seen(model, step)
        else:
            try:
                change = batch.change(key, step)
            except RunLost as lost:
                if shot.uncertainty.get(key):
                    raise ValueError(
                        f"{lost}; the answer's uncertainty needs it: remove {key} from [uncertainty]"
                    ) from None
                absent[key] = str(lost)
                continue
            if key == "specimen_diameter" and shot.axis_by_radius:
                change = outline_follows(change, step, shot.specimen.diameter, objective.n_force)
            if key == "specimen_length":
                change = change + model.heights_with_length(shot, step)
        one, value = INPUTS[key], float("nan")
        if key in PARAMETERS:
            value = held.get(key, PARAMETERS[key].held(shot))
        elif one.specimen:
            value = float(getattr(shot.specimen, one.specimen))
        found.append(InputDirection(key, step, np.nan_to_num(change), value))
        runner.work.progress("inputs", done + 1, len(wanted))
    runner.work.progress("inputs", len(wanted), len(wanted))
    return InputDirections(box.names, objective, vector, jacobian, tuple(found), absent)


def declared_changes(directions: InputDirections, uncertainty: Mapping[str, float]) -> FloatArray:
    """Changes by the declared standard uncertainties in quadrature, shape [n, k]."""
    keys = [key for key, sigma in uncertainty.items() if sigma > 0.0 and key in directions.keys]
    return in_quadrature([uncertainty[key] * directions[key].slope for key in keys])


def in_quadrature(rows: list[FloatArray]) -> FloatArray:
    """Changes scaled by root n, shape [n, k]. Their mean square is then the sum of the squares."""
    return np.asarray(np.sqrt(len(rows)) * np.array(rows))
