"""What the commands do once their options are typed: load, run with a progress bar, write, print.

Standard output holds the answer, with `--json` exactly one object; all else goes to standard error.
"""

import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from kolsky import options, printed
from kolsky.errors import InputError
from kolsky.outfolder import filling, usable_folder
from kolsky.pictures import Seen
from kolsky.progress import bars, paced
from kolsky.shots import Measured, Shot, folder_of, load_shot
from kolsky.sweeprecords import DesignExtras, Records


@dataclass(frozen=True)
class Arithmetic:
    """Precision, device, threads, the end of the data and the element as given on the command line."""

    precision: str
    device: str
    threads: int | None
    past_data: str = "continue"
    element: str = "one_point"
    hourglass: str = "stiffness"
    nearly_incompressible: bool = False

    def numerics(self, mesh: tuple[int, int]) -> Any:
        """The solver's numerical choices.

        Raises
        ------
        InputError
            If the precision, the element or the hourglass control is unknown, or the machine has no such
            device.
        """
        from explicit.device import select_device
        from explicit.elements import ELEMENTS
        from explicit.incompressible import COMPRESSIBLE
        from kolsky.forward import Numerics

        options.one_of("--precision", self.precision, ("fp64", "fp32"))
        options.one_of("--past-data", self.past_data, ("continue", "stop"))
        options.one_of("--element", self.element, tuple(ELEMENTS))
        options.one_of("--hourglass", self.hourglass, ("stiffness", "viscous"))
        try:
            select_device(self.device)
        except ValueError as error:
            raise InputError(options.COMMAND_LINE, f"--device: {error}") from None
        return Numerics(
            mesh=mesh,
            precision="fp32" if self.precision == "fp32" else "fp64",
            device=self.device,
            threads=self.threads,
            past_data="stop" if self.past_data == "stop" else "continue",
            element=self.element,
            hourglass_form="viscous" if self.hourglass == "viscous" else "stiffness",
            compressible=COMPRESSIBLE if self.nearly_incompressible else None,
        )


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
    started = perf_counter()
    options.finer("--refined-mesh", refined_mesh, "--mesh", mesh)
    for name in formats:
        options.one_of("--figures", name, ("pdf", "svg", "png"))
    options.apart("--free", free, "--parameter", held)
    loaded, folder = _load(shot, out)
    numerics = arithmetic.numerics(mesh)
    from kolsky import identify as inverse
    from kolsky.results_text import to_json
    from kolsky.settings import Settings

    settings = Settings(
        free=free, held=held, numerics=numerics, refined_mesh=refined_mesh, replicates=replicates, seed=seed
    )
    with _usable(loaded), bars() as progress:
        found = inverse.identify(loaded, settings, progress=progress)
    write_identified(folder, found, formats)
    tell(
        [printed.answer(e) for e in found.estimates.values()],
        printed.details(found),
        to_json(found) if as_json else None,
        rest={"report": folder / "report.html", "wall time": _since(started)},
        warnings=found.warnings,
    )


def write_identified(folder: Path, found: Any, formats: Sequence[str] = ()) -> None:
    """Write what `kolsky identify` leaves: result, tables, report and, if asked for, figures."""
    from kolsky.report.canvas import save_figures
    from kolsky.report.page import write_report
    from kolsky.results_text import write_csv
    from kolsky.results_write import write_identification

    with filling(folder) as partial:
        write_identification(partial / "identification.h5", found)
        write_csv(partial, found)
        write_report(partial / "report.html", found)
        if formats:
            save_figures(partial / "figures", found, formats=tuple(formats))


def simulate(
    shot: Path,
    *,
    parameters: Mapping[str, float],
    mesh: tuple[int, int],
    arithmetic: Arithmetic,
    out: Path | None,
    vtu: bool,
    as_json: bool,
) -> bool:
    """`kolsky simulate`; returns whether the run completed."""
    started = perf_counter()
    if vtu and arithmetic.nearly_incompressible:
        raise InputError(
            options.COMMAND_LINE,
            "--vtu and --nearly-incompressible exclude each other: meshes with different nodes have no "
            "common deformed one",
            cure="leave one out",
        )
    loaded, folder = _load(shot, out, "simulation")
    numerics = arithmetic.numerics(mesh)
    from kolsky import cautions
    from kolsky import simulate as forward
    from kolsky.results_text import jsonable, worst_imbalance

    with _usable(loaded), bars() as progress:
        progress("simulation", 0, 1)
        run = forward.simulate(
            loaded, parameters, numerics=numerics, progress=lambda n: progress("simulation", n, 1)
        )
    with filling(folder) as partial:
        forward.write_simulation(partial, run)
        if vtu:
            from kolsky.report.vtu import write_vtu

            write_vtu(partial, run.response, run.prepared.forward.mesh(numerics).quads)
    share, ending = float(run.response.extrapolated_share[0]), run.response.ending(0)
    warnings = [
        *([] if ending.outcome.ok else [f"the simulation ended {ending.sentence}"]),
        *cautions.past_curve(share, float(run.response.largest_strain_measure[0]), run.prepared.checks),
        *cautions.hourglass(run.response),
        *cautions.sliding(loaded.interface, list(parameters)),
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
    said = jsonable({**summary, "warnings": warnings}, "simulation") if as_json else None
    tell([], summary, said, rest={"wall time": _since(started)}, warnings=warnings)
    return ending.outcome.ok


def sweep(
    shot: Path,
    *,
    bounds: Mapping[str, tuple[float, float]],
    counts: Sequence[int],
    held: Mapping[str, float],
    design: str,
    runs: int,
    extra: DesignExtras,
    mesh: tuple[int, int],
    arithmetic: Arithmetic,
    seed: int,
    records: Records,
    out: Path | None,
    as_json: bool,
) -> None:
    """`kolsky sweep`."""
    started = perf_counter()
    chosen = _design(design, bounds, counts, runs, seed, extra)
    options.apart("--points" if extra.points else "--vary", chosen.box.names, "--parameter", held)
    points = records.part(chosen)
    loaded, folder = _load(shot, out)
    numerics = arithmetic.numerics(mesh)
    ledger = records.place(folder)
    import numpy as np

    from kolsky import cautions, misfit
    from kolsky import sweep as factorial
    from kolsky.results_text import failed_runs, jsonable

    with _usable(loaded), records.usable(), paced() as progress:
        result = factorial.sweep(
            loaded,
            points,
            held=held,
            numerics=numerics,
            ledger=ledger,
            merge=records.merge,
            retry=records.retry,
            progress=progress,
        )
    with filling(folder) as partial:
        factorial.write_sweep(partial / f"{records.stem}.csv", result)
    table = result.table
    completed = len(table.outcomes) - len(table.lost)
    phi = table.phi_force / misfit.SCALE_FORCE + table.phi_shape / misfit.SCALE_SHAPE  # Eq. (M.5)
    seen = bool(np.isfinite(phi).any())
    best = int(np.nanargmin(phi if seen else table.phi_force)) if completed else None
    summary = {
        "shot": result.shot,
        "runs": len(table.outcomes),
        "completed": completed,
        "smallest_phi": float(phi[best]) if best is not None and seen else None,
        **({} if seen or best is None else {"smallest_phi_force": float(table.phi_force[best])}),
        "at": None if best is None else dict(zip(table.names, table.points[best].tolist(), strict=True)),
        "file": str(folder / f"{records.stem}.csv"),
        **({} if ledger is None else {"ledger": str(ledger)}),
    }
    failed = {"failed_runs": failed_runs(table)}
    warnings = [
        *cautions.lost_runs(table),
        *cautions.sliding(loaded.interface, [*table.names, *held]),
    ]
    said = jsonable({**summary, **failed, "warnings": warnings}, "sweep") if as_json else None
    tell([], summary, said, rest={"wall time": _since(started)}, warnings=warnings)


def _failure(ending: Any) -> dict[str, Any]:
    """When, where and why a run ended."""
    r, y = ending.place
    return {
        "end_time": ending.time,
        "element": ending.element,
        "element_place": {"R": r, "Y": y},
        "cause": ending.outcome.cause,
        "cure": ending.outcome.cure,
    }


def _design(
    kind: str,
    bounds: Mapping[str, tuple[float, float]],
    counts: Sequence[int],
    runs: int,
    seed: int,
    extra: DesignExtras,
) -> Any:
    from kolsky.parameters import design_box

    extra.check(kind)
    if extra.points is not None:
        from kolsky.designfile import read_design

        return read_design(extra.points)
    from doe import DESIGNS

    box = design_box(bounds)
    try:
        match kind:
            case "factorial":
                return DESIGNS["full_factorial"](box, counts)
            case "fractional":
                return DESIGNS["fractional_factorial"](box, extra.generators)
            case "composite" | "box-behnken":
                return DESIGNS["central_composite" if kind == "composite" else "box_behnken"](box)
            case _:
                random = {"lhs": "latin_hypercube", "d-optimal": "d_optimal"}.get(kind, kind)
                return DESIGNS[random](box, runs, rng=seed)
    except ValueError as error:
        raise InputError(options.COMMAND_LINE, f"--design {kind}: {error}") from None


def _load(shot: Path, out: Path | None, *inside: str) -> tuple[Shot, Path]:
    """The shot, and the folder its results go to: refused now if unusable, not after the work."""
    place = out or folder_of(shot) / "results"

    def measure(seen: Seen) -> Measured:
        from kolsky.measure import measured

        with bars() as progress:
            return measured(seen, usable_folder(place), progress=progress)

    loaded = load_shot(shot, measure=measure)
    return loaded, usable_folder(place.joinpath(*inside))


@contextmanager
def _usable(shot: Shot) -> Iterator[None]:
    """A shot that cannot be worked with is bad input: one line, exit code 2."""
    try:
        yield
    except ValueError as error:
        raise InputError(shot.folder, str(error)) from error


def tell(
    answers: list[str],
    rows: Mapping[str, Any],
    said: Any,
    *,
    rest: Mapping[str, Any],
    warnings: Iterable[str],
) -> None:
    """The answer on stdout, as lines or as one JSON object; with JSON, the rest goes to stderr."""
    if said is None:
        print("\n".join([*answers, *printed.columns({**rows, **rest})]))
    else:
        print(json.dumps(said, indent=2, allow_nan=False))
        print("\n".join(printed.columns(rest)), file=sys.stderr)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)


def _since(started: float) -> str:
    return f"{perf_counter() - started:.1f} s"
