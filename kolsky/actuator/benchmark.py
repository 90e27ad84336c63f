"""The loop of a SPEC in every direction of gravity: reduction, plant, run, warnings."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from kolsky.actuator.basis_file import basis_key, read_basis, restored, stored, write_basis
from kolsky.actuator.controller import Controller, Plant, largest_gain
from kolsky.actuator.loop import Closed, run_loop
from kolsky.actuator.model import Actuator
from kolsky.actuator.reduced import Reduction, reduce_actuator
from kolsky.actuator.schema import ControlSection
from kolsky.base.arrays import FloatArray

PLANT_STEPS = 9
"""Pressures at which the plant's own bend is simulated."""


def run_control(
    actuator: Actuator,
    gravities: Mapping[str, FloatArray],
    section: ControlSection,
    *,
    basis: Path | None = None,
) -> tuple[dict[str, Closed], dict[str, Reduction]]:
    """Reduce the actuator, simulate the plant, and close the loop.

    Parameters
    ----------
    actuator, gravities, section
        What SPEC declares.
    basis
        Folder in which the reductions and the plants' bends are kept, and from which they are taken where
        they follow from the same inputs; None: neither.

    Raises
    ------
    ValueError
        If an equilibrium of the model or of the plant is not found.
    InputError
        If a file of the folder is damaged.
    """
    prepared = {name: _prepared(actuator, g, section, name, basis) for name, g in gravities.items()}
    closed = {}
    for name, (made, plant) in prepared.items():
        controller = Controller(made.model, gain=section.gain, most=section.most)
        closed[name] = run_loop(
            controller,
            plant,
            schedule(section),
            rate=section.rate,
            seed=section.seed,
            real_time=section.real_time,
        )
    return closed, {name: made for name, (made, _) in prepared.items()}


def _prepared(
    actuator: Actuator, gravity: FloatArray, section: ControlSection, name: str, basis: Path | None
) -> tuple[Reduction, Plant]:
    """The reduction and the plant of a direction of gravity, from the folder where it has them."""
    key = basis_key(actuator, gravity, section, PLANT_STEPS)
    file = None if basis is None else basis / f"{name}.h5"
    found = None if file is None else read_basis(file, key)
    if found is not None:
        made, pressure, angle = restored(found, actuator, gravity)
        return made, Plant(pressure, angle, section.lag, section.delay, section.noise)
    made = reduce_actuator(
        actuator,
        gravity,
        most=section.most,
        modes=section.modes,
        tolerance=section.tolerance,
        seen=section.snapshots,
    )
    plant = plant_of(actuator, gravity, section)
    if file is not None:
        write_basis(file, stored(key, made, plant))
    return made, plant


def schedule(section: ControlSection) -> FloatArray:
    """Wanted angle of each tick [rad], shape [n]."""
    return np.repeat(np.array(section.angles), max(1, round(section.hold * section.rate)))


def plant_of(actuator: Actuator, gravity: FloatArray, section: ControlSection) -> Plant:
    """The plant: the whole model with its own stiffness, a lag, a delay and noise."""
    pressures = np.linspace(0.0, section.most, PLANT_STEPS)
    solid = actuator.solid.with_parameters(section.plant_stiffness * actuator.solid.parameters())
    run = actuator.simulate(gravity, pressures, solid=solid)
    if not run.solution.outcome.ok:
        raise ValueError(f"the plant: {run.solution.outcome.cause}; {run.solution.outcome.cure}")
    return Plant(pressures, run.angle, section.lag, section.delay, section.noise)


def loop_warnings(
    closed: Mapping[str, Closed], reductions: Mapping[str, Reduction], section: ControlSection
) -> list[str]:
    """What a reader must know before trusting the loop."""
    said = []
    bound = largest_gain(section.delay)
    if section.gain / section.plant_stiffness >= bound:
        said.append(
            f"the gain {section.gain:g} on a plant {section.plant_stiffness:g} times as stiff is not below "
            f"{bound * section.plant_stiffness:.3g}, the limit of stability with a delay of {section.delay} "
            "tick(s): lower the gain"
        )
    for name, run in closed.items():
        if run.late:
            said.append(
                f"{name}: {run.late} of {len(run.time)} ticks took longer than {1e3 / run.rate:.3g} ms"
            )
        if run.held.any():
            said.append(
                f"{name}: in {int(run.held.sum())} ticks the model gave no pressure; the last was held"
            )
        if reductions[name].gap < 0.0:
            said.append(
                f"{name}: neighbouring chambers overlap below the largest pressure, which they cannot: the "
                "bends there are not those of the actuator; lower most or widen the gap"
            )
        sample = reductions[name].model.reduced.sample
        if not sample.reached:
            said.append(
                f"{name}: the chosen elements leave {sample.residual:.2g} of the forces, "
                "more than the tolerance"
            )
    return said
