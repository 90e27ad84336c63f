"""What the commands do once their options are typed: load, run with a progress bar, write, print."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from kolsky.errors import InputError
from kolsky.shots import Shot, load_shot

STAGES = {
    "design": "design",
    "refinement": "design near the optimum",
    "check": "check on the refined mesh",
    "noise": "replicates of the input noise",
    "simulation": "simulation",
    "sweep": "sweep",
}


@dataclass(frozen=True)
class Arithmetic:
    """Precision, device and threads as given on the command line."""

    precision: str
    device: str
    threads: int | None

    def numerics(self, mesh: tuple[int, int]) -> Any:
        """The solver's numerical choices.

        Raises
        ------
        InputError
            If the precision is unknown or the machine has no such device.
        """
        from explicit.device import select_device
        from kolsky.forward import Numerics

        if self.precision not in ("fp32", "fp64"):
            raise InputError(Path("command line"), f"--precision {self.precision!r}", cure="fp64 or fp32")
        try:
            select_device(self.device)
        except ValueError as error:
            raise InputError(Path("command line"), f"--device: {error}") from None
        return Numerics(
            mesh=mesh,
            precision="fp32" if self.precision == "fp32" else "fp64",
            device=self.device,
            threads=self.threads,
        )


@contextmanager
def _bars() -> Iterator[Any]:
    """A progress bar a stage on stderr; a non-terminal gets no bar."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description:<30}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        tasks: dict[str, Any] = {}

        def report(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = progress.add_task(STAGES.get(stage, stage), total=total)
            progress.update(tasks[stage], completed=done, total=total)

        yield report


@contextmanager
def _usable(shot: Shot) -> Iterator[None]:
    """A shot that cannot be worked with is bad input: one line, exit code 2."""
    try:
        yield
    except ValueError as error:
        raise InputError(shot.folder, str(error)) from error


def identify(
    shot: Path,
    *,
    free: Mapping[str, tuple[float, float] | None],
    held: Mapping[str, float],
    mesh: tuple[int, int],
    refined_mesh: tuple[int, int],
    replicates: int,
    arithmetic: Arithmetic,
    seed: int,
    out: Path | None,
    formats: Sequence[str],
    as_json: bool,
) -> None:
    """`kolsky identify`."""
    if refined_mesh[0] <= mesh[0] or refined_mesh[1] <= mesh[1]:
        raise InputError(
            Path("command line"),
            "--refined-mesh is not finer than --mesh",
            value=f"{refined_mesh[0]}x{refined_mesh[1]} against {mesh[0]}x{mesh[1]}",
            cure="refine both directions, best by 2",
        )
    unknown = sorted(set(formats) - {"pdf", "svg", "png"})
    if unknown:
        raise InputError(Path("command line"), f"--figures {','.join(unknown)}", cure="pdf, svg or png")
    if clash := sorted(set(free) & set(held)):
        raise InputError(
            Path("command line"), f"{clash[0]} is both --free and --parameter", cure="choose one"
        )
    loaded = load_shot(shot)
    numerics = arithmetic.numerics(mesh)
    from kolsky import identify as inverse
    from kolsky import results
    from kolsky.report.canvas import save_figures
    from kolsky.report.page import write_report

    settings = inverse.Settings(
        free=free, held=held, numerics=numerics, refined_mesh=refined_mesh, replicates=replicates, seed=seed
    )
    with _usable(loaded), _bars() as progress:
        found = inverse.identify(loaded, settings, progress=progress)
    folder = _folder(loaded, out)
    results.write_identification(folder / "identification.h5", found)
    results.write_csv(folder, found)
    write_report(folder / "report.html", found)
    if formats:
        save_figures(folder / "figures", found, formats=tuple(formats))
    if as_json:
        print(json.dumps(results.to_json(found), indent=2, allow_nan=False))
        return
    table = Table(title=f"{found.shot}: identified parameters", title_justify="left")
    for heading in ("parameter", "value", "k = 2 interval", "u noise", "u numerical", "verdict"):
        table.add_column(heading)
    for e in found.estimates.values():
        digits = max(0, 1 - int(np.floor(np.log10(e.sigma)))) if e.sigma > 0 else 6
        low, high = e.interval
        table.add_row(
            e.name if e.unit == "1" else f"{e.name} [{e.unit}]",
            f"{e.value:.{digits}f}",
            f"[{low:.{digits}f}, {high:.{digits}f}]",
            f"{e.sigma_noise:.2g}",
            f"{e.sigma_numerical:.2g}",
            e.outcome.value,
        )
    console = Console(soft_wrap=True)
    console.print(table)
    for route in found.routes:
        if route.name != "joint":
            values = ", ".join(f"{name} = {value:.5g}" for name, value in route.parameters.items())
            console.print(f"{route.name:>10}: {values}")
    console.print(f"report: {folder / 'report.html'}", highlight=False)


def simulate(
    shot: Path,
    *,
    parameters: Mapping[str, float],
    mesh: tuple[int, int],
    arithmetic: Arithmetic,
    out: Path | None,
    vtu: bool,
    as_json: bool,
) -> None:
    """`kolsky simulate`."""
    loaded = load_shot(shot)
    numerics = arithmetic.numerics(mesh)
    from kolsky import simulate as forward
    from kolsky.results import jsonable

    with _usable(loaded), _bars() as progress:
        progress("simulation", 0, 1)
        run = forward.simulate(
            loaded, parameters, numerics=numerics, progress=lambda n: progress("simulation", n, 1)
        )
    folder = _folder(loaded, out) / "simulation"
    forward.write_simulation(folder, run)
    if vtu:
        from kolsky.report.vtu import write_vtu

        write_vtu(folder, run.response, run.prepared.forward.mesh(numerics).quads)
    summary = {
        "shot": loaded.name,
        "parameters": run.parameters,
        "outcome": run.response.outcomes[0].name,
        "steps": int(run.response.steps[0]),
        "energy_imbalance": float(run.response.energy.imbalance()[0]),
        "extrapolated_share": float(run.response.extrapolated_share[0]),
        **vars(run.terms),
        "phi_units": "phi_force N, phi_shape 1",
        "folder": str(folder),
    }
    if as_json:
        print(json.dumps(jsonable(summary, "simulation"), indent=2, allow_nan=False))
        return
    table = Table(title=f"{loaded.name}: one simulation", title_justify="left", show_header=False)
    for key, value in summary.items():
        table.add_row(key, f"{value:.6g}" if isinstance(value, float) else str(value))
    Console(soft_wrap=True).print(table)


def sweep(
    shot: Path,
    *,
    bounds: Mapping[str, tuple[float, float]],
    counts: Sequence[int],
    held: Mapping[str, float],
    design: str,
    runs: int,
    mesh: tuple[int, int],
    arithmetic: Arithmetic,
    seed: int,
    out: Path | None,
    as_json: bool,
) -> None:
    """`kolsky sweep`."""
    from doe import full_factorial, latin_hypercube, sobol
    from kolsky.parameters import design_box

    command_line = Path("command line")
    if design not in ("factorial", "lhs", "sobol"):
        raise InputError(command_line, f"--design {design!r}", cure="factorial, lhs or sobol")
    box = design_box(bounds)
    try:
        if design == "factorial":
            points = full_factorial(box, counts)
        else:
            points = (latin_hypercube if design == "lhs" else sobol)(box, runs, rng=seed)
    except ValueError as error:
        raise InputError(command_line, str(error)) from None
    loaded = load_shot(shot)
    numerics = arithmetic.numerics(mesh)
    from kolsky import sweep as factorial
    from kolsky.results import jsonable

    with _usable(loaded), _bars() as progress:
        done = 0

        def report(n: int) -> None:
            nonlocal done
            done += n
            progress("sweep", done, len(points))

        progress("sweep", 0, len(points))
        result = factorial.sweep(loaded, points, held=held, numerics=numerics, progress=report)
    path = factorial.write_sweep(_folder(loaded, out) / "sweep.csv", result)
    table = result.table
    completed = sum(outcome == "COMPLETED" for outcome in table.outcomes)
    phi = table.phi_force / 1000.0 + table.phi_shape / 0.001
    best = int(np.nanargmin(phi)) if completed else None
    summary = {
        "shot": result.shot,
        "runs": len(table.outcomes),
        "completed": completed,
        "smallest_phi": None if best is None else float(phi[best]),
        "at": None if best is None else dict(zip(table.names, table.points[best].tolist(), strict=True)),
        "file": str(path),
    }
    if as_json:
        print(json.dumps(jsonable(summary, "sweep"), indent=2, allow_nan=False))
        return
    shown = Table(title=f"{result.shot}: sweep", title_justify="left", show_header=False)
    for key, value in summary.items():
        shown.add_row(key, str(value))
    Console(soft_wrap=True).print(shown)


def _folder(shot: Shot, out: Path | None) -> Path:
    folder = out or shot.folder / "results"
    folder.mkdir(parents=True, exist_ok=True)
    return folder
