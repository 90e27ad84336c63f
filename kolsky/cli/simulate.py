"""`kolsky simulate`: one simulation of a shot, compared with its data."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from kolsky.base.files import filling, jsonable, write_table
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.options import Out, ShotPath, Values, Vtu, changed, load, usable
from kolsky.cli.terminal import print_result, progress_bars
from kolsky.inverse.settings import Numerics


def simulate(
    shot: ShotPath,
    *,
    parameter: Values,
    numerics: Numerics,
    out: Out = None,
    slow: Annotated[
        bool, Option("Simulate the quasi-static test instead, as slow as --error requires.")
    ] = False,
    strain: Annotated[
        float | None,
        Option(
            "Last nominal compression of --slow.",
            metavar="SHARE",
            unit="1",
            positive=True,
            show_default="where the shot ends",
        ),
    ] = None,
    error: Annotated[
        float | None,
        Option(
            "Error of the force, for --slow.", metavar="SHARE", unit="1", positive=True, show_default="0.2 %"
        ),
    ] = None,
    vtu: Vtu = False,
) -> None:
    """Simulate a shot once, e.g. -p stiffness_factor=1.1, and compare it with the data.

    A failed run is written up to its end; the exit code is then 1. With --slow the specimen is compressed
    without inertia: slow.csv has force, stress and radius over the strain.
    """
    if slow:
        unused = [name for name in parameter if name not in SLOW_PARAMETERS]
        texts.refuse(
            {
                **{f"--parameter {name}": True for name in unused},
                **changed(replace(numerics, mesh=Numerics.mesh, threads=None)),
                "--vtu": vtu,
            },
            "has no effect with --slow",
            cure=f"leave it out; of the parameters a slow test reads {', '.join(SLOW_PARAMETERS)}",
        )
        if strain is not None and strain >= 1.0:
            raise texts.refusal("is not allowed", key="--strain", value=strain, allowed="< 100 %")
        _simulate_slow_test(shot, out, parameter, numerics, strain, 2e-3 if error is None else error)
        return
    given = {"--strain": strain is not None, "--error": error is not None}
    texts.refuse(given, "needs --slow", cure="add --slow")
    if vtu and numerics.compressible is not None:
        raise texts.refusal(
            "--vtu and --nearly-incompressible exclude each other: meshes with different nodes have no "
            "common deformed one",
            cure="leave one out",
        )
    from kolsky.inverse import simulate as simulation
    from kolsky.inverse.result import worst_imbalance
    from kolsky.uncertainty.warnings import (
        folded_warning,
        hourglass_warning,
        past_curve_warning,
        sliding_warning,
    )

    loaded, folder = load(shot, out, "simulation", device=numerics.device)
    with usable(loaded), progress_bars() as progress:
        progress("simulation", 0, 1)
        run = simulation.simulate(
            loaded, parameter, numerics=numerics, progress=lambda n: progress("simulation", n, 1)
        )
    with filling(folder) as partial:
        simulation.write_simulation(partial, run)
        if vtu:
            from kolsky.inverse.parameters import PARAMETERS
            from kolsky.report.paraview import write_vtu
            from kolsky.report.scene.scene_data import solid_of

            values = {name: PARAMETERS[name].held(loaded) for name in ("stiffness_factor", "poisson")}
            solid = solid_of(loaded.curve, {**values, **parameter})
            write_vtu(partial, run.response, run.prepared.forward.mesh(numerics), solid)
    share, ending = float(run.response.extrapolated_share[0]), run.response.ending(0)
    warnings = [
        *([] if ending.outcome.ok else [f"the simulation ended {ending.sentence}"]),
        *past_curve_warning(share, float(run.response.largest_strain_measure[0]), run.prepared.checks),
        *hourglass_warning(run.response),
        *folded_warning(run.response, run.prepared.forward.mesh(numerics), loaded.interface, list(parameter)),
        *sliding_warning(loaded.interface, list(parameter)),
    ]
    summary = {
        "shot": loaded.name,
        "parameters": run.parameters,
        "outcome": ending.outcome.name,
        **({} if ending.outcome.ok else _failure(ending)),
        "steps": int(run.response.steps[0]),
        "energy_imbalance": worst_imbalance(run.response),
        "artificial_energy": float(run.response.energy.artificial_share()[0]),
        "extrapolated_share": share,
        **({} if run.terms is None else {**vars(run.terms), "phi_units": "phi_force N, phi_shape 1"}),
        "folder": str(folder),
    }
    print_result(summary, jsonable({**summary, "warnings": warnings}, "simulation"), warnings=warnings)
    if not ending.outcome.ok:
        raise typer.Exit(1)


def _failure(ending: Any) -> dict[str, Any]:
    """Time, place and reason of a run's end."""
    r, y = ending.place
    return {
        "end_time": ending.time,
        "element": ending.element,
        "element_place": {"R": r, "Y": y},
        "cause": ending.outcome.cause,
        "cure": ending.outcome.cure,
    }


SLOW_PARAMETERS = ("stiffness_factor", "friction", "poisson")
"""Parameters of a slow test."""


def _simulate_slow_test(
    shot: Path,
    out: Path | None,
    parameters: Mapping[str, float],
    numerics: Numerics,
    last: float | None,
    error: float,
) -> None:
    """The quasi-static test of a shot's specimen. It has a last strain and an error of the force."""
    from kolsky.inverse import simulate as slow

    loaded, folder = load(shot, out, "simulation")
    with usable(loaded):
        result = slow.slow_test_of(
            loaded, parameters, last=last, error=error, mesh=numerics.mesh, threads=numerics.threads
        )
    with filling(folder) as partial:
        write_table(partial / "slow.csv", result.columns)
    warnings = slow.slow_test_warnings(result)
    summary = {
        "shot": loaded.name,
        **({"parameters": dict(parameters)} if parameters else {}),
        "last_strain": float(result.strain[-1]),
        "last_force": float(result.force[-1]),
        "error": result.errors[-1],
        "duration": f"{result.durations[-1]:.0f} passages of a wave, after "
        f"{len(result.durations) - 1} shorter",
        "kinetic_share": result.test.kinetic_share,
        "face_difference": result.test.face_difference,
        "extrapolated_share": result.test.past_data,
        "file": str(folder / "slow.csv"),
    }
    content = {**summary, "durations": result.durations, "errors": result.errors, "warnings": warnings}
    print_result(summary, jsonable(content, "slow"), warnings=warnings)
