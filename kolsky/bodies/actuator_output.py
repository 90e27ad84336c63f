"""Bends, inversions and runs of the loop as tables of columns (SI) and as JSON types."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from kolsky.base.files import columns_of, jsonable
from kolsky.bodies.actuator_bending import Direction, Inversion, relative_bend
from kolsky.bodies.actuator_control import Closed, Reduction
from kolsky.bodies.actuator_markers import MarkerComparison, StiffnessFit

Tables = dict[str, Mapping[str, Any]]
"""Name of a table -> heading, with the unit -> cells."""


def bend_tables(directions: Sequence[Direction], markers: Sequence[MarkerComparison]) -> Tables:
    """Bends, forces, the base's middle line at the declared pressures, and markers. A table without rows is
    left out."""
    rows = {
        "forces": (
            {
                "gravity": one.name,
                "on": name,
                "pressure (Pa)": float(one.pristine.pressures[k].max()),
                **{f"{axis} (N)": float(x) for axis, x in zip("xyz", force, strict=True)},
            }
            for one in directions
            for name, each in one.forces.items()
            for k, force in enumerate(each)
        ),
        "line": (row for one in directions for row in _line_rows(one)),
        "markers": (
            {
                "gravity": one.gravity,
                "pressure (Pa)": one.pressure,
                "marker": number,
                "x measured (m)": float(seen[0]),
                "z measured (m)": float(seen[1]),
                "x simulated (m)": float(made[0]),
                "z simulated (m)": float(made[1]),
            }
            for one in markers
            for number, (seen, made) in enumerate(zip(one.measured, one.simulated, strict=True), start=1)
        ),
    }
    bend = columns_of(row for one in directions for row in _bend_rows(one))
    others = {name: table for name, each in rows.items() if (table := columns_of(each))}
    return {"bend": bend, **others}


def _bend_rows(one: Direction) -> Iterator[dict[str, Any]]:
    """One row per pressure step."""
    run = one.pristine
    healed = one.healed.angle if one.healed is not None else np.full(len(run.angle), np.nan)
    slopes = run.slopes()
    for k, angle in enumerate(run.angle):
        contact = {}
        if one.touching is not None:
            contact["contact force (N)"] = float(one.touching.force[k])
            contact["contact depth (m)"] = float(one.touching.depth[k])
        yield {
            "gravity": one.name,
            **{f"pressure {j} (Pa)": float(p) for j, p in enumerate(run.pressures[k], start=1)},
            "angle (rad)": float(angle),
            "angle healed (rad)": "" if np.isnan(healed[k]) else float(healed[k]),
            "smallest gap (m)": "" if np.isnan(one.gap[k]) else float(one.gap[k]),
            **contact,
            **{f"slope {j} (rad/Pa)": float(x) for j, x in enumerate(slopes[k], start=1)},
        }


def _line_rows(one: Direction) -> Iterator[dict[str, Any]]:
    """One row per node of the middle line and declared pressure. Empty if the mesh has no such line."""
    run, mesh = one.pristine, one.pristine.solution.model.mesh
    if "line" not in mesh.sets:
        return
    nodes = mesh.nodes("line")
    for k in one.asked:
        places = mesh.points[nodes] + run.solution.displacements[k, nodes]
        for node, place in zip(nodes, places, strict=True):
            yield {
                "gravity": one.name,
                "pressure (Pa)": float(run.pressures[k].max()),
                "node": int(node),
                **{f"{axis} (m)": float(x) for axis, x in zip("xyz", place, strict=True)},
            }


def bends_json(directions: Sequence[Direction], inputs: Mapping[str, str]) -> dict[str, Any]:
    """Bends at the declared pressures as JSON types, SI."""
    whole = {}
    for one in directions:
        run = one.pristine
        whole[one.name] = {
            "pressure_Pa": run.pressures[one.asked],
            "angle_rad": run.angle[one.asked],
            "slope_rad_per_Pa": run.slopes()[one.asked],
            "contact_force_N": None if one.touching is None else one.touching.force[one.asked],
            "contact_depth_m": None if one.touching is None else one.touching.depth[one.asked],
            "outside_force_N": {name: each[one.asked] for name, each in one.forces.items()},
            "angle_healed_rad": None if one.healed is None else one.healed.angle[one.asked],
            "healed_over_pristine_less_1": None if one.healed is None else relative_bend(one),
        }
    return {"bends": jsonable(whole, "bends"), "inputs": dict(inputs)}


def inversions_json(found: Mapping[str, Sequence[Inversion]], inputs: Mapping[str, str]) -> dict[str, Any]:
    """Inversions of every direction of gravity as JSON types, SI."""
    whole = {
        name: [
            {
                "wanted_rad": one.angle,
                "found_rad": None if np.isnan(one.found) else one.found,
                "pressures_Pa": None if np.isnan(one.pressures).any() else one.pressures,
                "slopes_rad_per_Pa": None if np.isnan(one.slope).any() else one.slope,
                "ended": one.ended.value,
                "equilibria": one.equilibria,
            }
            for one in each
        ]
        for name, each in found.items()
    }
    return {"found": jsonable(whole, "found"), "inputs": dict(inputs)}


def loop_json(
    closed: Mapping[str, Closed], reductions: Mapping[str, Reduction], inputs: Mapping[str, str]
) -> dict[str, Any]:
    """Runs of the loop as JSON types, SI."""
    whole = {}
    for name, run in closed.items():
        made = reductions[name]
        whole[name] = {
            "ticks": len(run.time),
            "rate_Hz": run.rate,
            "wall_median_s": float(np.median(run.wall)),
            "wall_99_9_s": float(np.quantile(run.wall, 0.999)),
            "wall_worst_s": float(run.wall.max()),
            "processor_median_s": float(np.median(run.processor)),
            "processor_worst_s": float(run.processor.max()),
            "late_ticks": run.late,
            "ticks_at_bound": int(run.bounded.sum()),
            "ticks_held": int(run.held.sum()),
            "settled_error_rad": run.settled_error(),
            "modes": made.model.reduced.modes,
            "elements": len(made.model.reduced.sample.cells),
            "elements_of_all": len(made.model.reduced.model.mesh.cells),
            "sampling_residual": made.model.reduced.sample.residual,
            "largest_error_of_the_reduction_rad": made.largest_error,
        }
    return {"runs": jsonable(whole, "runs"), "inputs": dict(inputs)}


def markers_json(compared: Sequence[MarkerComparison], stiffness: StiffnessFit | None) -> dict[str, Any]:
    """Markers and the factor of stiffness fitted to them as JSON types, SI."""
    rows = [
        {
            "gravity": one.gravity,
            "pressure_Pa": one.pressure,
            "rmse_m": one.rmse,
            "sigma_m": one.sigma,
            "explained": one.explained,
            "measured_angle_rad": one.measured_angle,
        }
        for one in compared
    ]
    fit = None
    if stiffness is not None:
        fit = {
            "factor": stiffness.factor,
            "sigma": stiffness.sigma,
            "interval_95": [stiffness.low, stiffness.high],
            "chi2": stiffness.chi2,
            "degrees_of_freedom": stiffness.degrees,
            "explained": stiffness.explained,
            "converged": stiffness.converged,
        }
    return {"markers": jsonable(rows, "markers"), "stiffness": jsonable(fit, "stiffness")}


def loop_columns(run: Closed) -> dict[str, Any]:
    """Every tick of a run of the loop."""
    return {
        "time (s)": run.time,
        "wanted (rad)": run.wanted,
        "measured (rad)": run.measured,
        "plant (rad)": run.angle,
        "pressure (Pa)": run.pressure,
        "wall time (s)": run.wall,
        "processor time (s)": run.processor,
        "at a bound": run.bounded.astype(int),
        "held": run.held.astype(int),
    }
