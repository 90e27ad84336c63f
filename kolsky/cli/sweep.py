"""`kolsky sweep`: choose the points, run those that no ledger holds, write a row a run and a page.

The design, the ledger and the workers (processes, or a Dask scheduler) are described by the options; the
workers serve `kolsky budget` and `kolsky identify --each` too.
"""

import asyncio
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.base.process import process_pool
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, Mesh, Numbers, Out, ShotPath, SolverOptions

if TYPE_CHECKING:
    from doe import Box, Design
    from doe.box import Constraint
    from doe.designs import DesignKind


def sweep(
    shot: ShotPath,
    *,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="NAME=LOW:HIGH[:LEVELS]",
            help="A parameter to vary; repeat for more. LEVELS belong to a factorial.",
            show_default="friction=0:2 and stiffness_factor=0.75:1.25, 10 levels each",
        ),
    ] = None,
    parameter: Numbers = None,
    design: Annotated[
        str,
        typer.Option(
            help="factorial, fractional, composite, box-behnken or csv; with --runs points lhs, maximin, "
            "sobol, halton or d-optimal."
        ),
    ] = "factorial",
    runs: Annotated[
        int, typer.Option(min=2, max=1_000_000, help="Points of a design that takes any number.")
    ] = 64,
    generators: Annotated[
        str, typer.Option(metavar="WORDS", help='Of a fractional design, a word a parameter, e.g. "a b ab".')
    ] = "",
    points: Annotated[
        Path | None, typer.Option(metavar="CSV", help="File of a csv design; columns NAME (UNIT).")
    ] = None,
    mesh: Mesh = "16x22",
    solver: SolverOptions,
    seed: Annotated[int, typer.Option(min=0, help="Seed of a random design.")] = 1,
    log: Annotated[
        list[str] | None,
        typer.Option("--log", metavar="NAME", help="Spread this parameter evenly in its logarithm; repeat."),
    ] = None,
    where: Annotated[
        list[str] | None,
        typer.Option(
            "--where",
            metavar="INEQUALITY",
            help='Leave out points that violate it, e.g. "friction <= 2 * stiffness_factor" (SI); repeat.',
        ),
    ] = None,
    workers: "Workers",
    ledger: Annotated[
        str,
        typer.Option(
            help="File that stores every run, so that none is repeated; or none.",
            show_default="sweep.sqlite among the results",
        ),
    ] = "",
    retry: Annotated[bool, typer.Option("--retry", help="Repeat runs that failed before.")] = False,
    shard: Annotated[
        str, typer.Option(metavar="I/N", help="Run the I-th of N parts of the design.", show_default="all")
    ] = "1/1",
    merge: Annotated[
        list[Path] | None,
        typer.Option("--merge", metavar="LEDGER", help="Use the runs of another ledger too; repeat."),
    ] = None,
    out: Out = None,
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Run a design of experiments over a shot's parameters; writes sweep.csv, a row a run, and sweep.html."""
    started = perf_counter()

    choice = DesignChoice.of(
        design,
        vary or [],
        runs=runs,
        seed=seed,
        generators=generators,
        points=points,
        logarithmic=tuple(log or ()),
        where=tuple(where or ()),
    )
    held = texts.values("--parameter", parameter or [])
    elements = texts.mesh("--mesh", mesh)
    records = Records(ledger, retry=retry, shard=texts.shard("--shard", shard), merge=tuple(merge or ()))
    formats = texts.figure_formats(figures)
    chosen = choice.design()
    texts.apart("--points" if points else "--vary", chosen.box.names, "--parameter", held)
    part = records.part(chosen)
    from kolsky.cli.options import load, usable
    from kolsky.cli.terminal import print_result, since, sweep_progress

    loaded, folder = load(shot, out)
    numerics = replace(solver, threads=workers.threads(solver.threads)).numerics(elements)
    place = records.place(folder)
    from kolsky.base.files import jsonable
    from kolsky.report.result_folder import write_sweep_results
    from kolsky.results.tables import failed_runs
    from kolsky.studies import sweep as sweeping
    from kolsky.studies.sweep_analysis import analyse_sweep, surface_optimum
    from kolsky.uncertainty.warnings import lost_runs, rerun_advice, sliding_warning

    with usable(loaded), records.usable(), workers.executor() as executor, sweep_progress() as progress:
        result = sweeping.sweep(
            loaded,
            part,
            held=held,
            numerics=numerics,
            ledger=place,
            merge=records.merge,
            retry=records.retry,
            executor=executor,
            progress=progress,
        )
    warnings = [
        *rerun_advice(result.damaged),
        *lost_runs(result.table),
        *sliding_warning(loaded.interface, [*result.table.names, *held]),
    ]
    analysis = analyse_sweep(result.shot, chosen.box, result.table)
    write_sweep_results(folder, result, analysis, name=records.stem, warnings=warnings, formats=formats)
    summary = {
        "shot": result.shot,
        **sweeping.counts(result),
        **({"left_out_by_constraints": chosen.settings["refused"]} if where else {}),
        **sweeping.least_misfit(result),
        **surface_optimum(analysis),
        "file": str(folder / f"{records.stem}.csv"),
        "page": str(folder / f"{records.stem}.html"),
        **({} if place is None else {"ledger": str(place)}),
    }
    failed = {"failed_runs": failed_runs(result.table)}
    said = jsonable({**summary, **failed, "warnings": warnings}, "sweep") if as_json else None
    print_result(summary, said, rest={"wall time": since(started)}, warnings=warnings)


_DEFAULT_BOUNDS = {"friction": (0.0, 2.0), "stiffness_factor": (0.75, 1.25)}
"""Bounds of a sweep whose `--vary` says nothing."""
_DEFAULT_LEVELS = 10
"""Levels of each parameter then."""


@dataclass(frozen=True)
class DesignChoice:
    """A design of experiments and its region, as given on the command line."""

    kind: str
    """Name of a `doe.designs.DesignKind` at a command line."""
    bounds: Mapping[str, tuple[float, float]]
    """Bounds by name, SI; empty where a file names the parameters."""
    levels: Sequence[int] = ()
    """Levels of a full factorial."""
    runs: int = 64
    """Points of a design that takes any number."""
    seed: int = 1
    """Seed of a random design."""
    generators: str = ""
    """Words of a fractional factorial."""
    points: Path | None = None
    """File of a design somebody else chose."""
    logarithmic: tuple[str, ...] = ()
    """Parameters whose points are spread evenly in their logarithm."""
    where: tuple[str, ...] = ()
    """Constraints as in `doe.box.Constraint`."""

    @classmethod
    def of(cls, kind: str, vary: Sequence[str], **more: Any) -> "DesignChoice":
        """The choice from the texts of `--design` and `--vary`; the other fields as they are.

        Raises InputError if there is no such design, or a text cannot be read.
        """
        from doe.designs import DESIGNS, design_kind

        texts.one_of("--design", kind, tuple(design.option for design in DESIGNS.values()))
        needs = design_kind(kind).needs
        if "points" in needs:
            texts.none("--vary", vary, f"--design {kind}, whose file names the parameters")
            return cls(kind, {}, **more)
        if "levels" in needs:
            bounds, counts = (
                texts.levels("--vary", vary)
                if vary
                else (_DEFAULT_BOUNDS, [_DEFAULT_LEVELS] * len(_DEFAULT_BOUNDS))
            )
            return cls(kind, bounds, counts, **more)
        return cls(kind, texts.spans("--vary", vary) if vary else _DEFAULT_BOUNDS, **more)

    def design(self) -> "Design":
        """The points.

        A point that breaks a constraint is left out and counted; a design that chooses among candidates
        has only those that meet them.

        Raises InputError if options do not go together, or the design cannot be made of them.
        """
        from doe.designs import DESIGNS, design_kind
        from doe.designs.optimal import keep

        kind = design_kind(self.kind)
        for option, given, need in (
            ("--generators", bool(self.generators), "generators"),
            ("--points", self.points is not None, "points"),
        ):
            if given != (need in kind.needs):
                kinds = [other.option for other in DESIGNS.values() if need in other.needs]
                raise InputError(
                    texts.COMMAND_LINE,
                    f"{option} and --design {' or '.join(kinds)} need each other",
                    cure="give both, or neither",
                )
        if self.points is not None and self.logarithmic:
            raise InputError(
                texts.COMMAND_LINE, "--log has no effect on points from a file", cure="leave it out"
            )
        if self.points is not None:
            from kolsky.studies.sweep import read_design

            chosen = read_design(self.points)
            constraints = self._constraints(chosen.box)
        else:
            box = self._box()
            constraints = self._constraints(box)
            chosen = self._chosen(kind, box, constraints)
        try:
            return keep(chosen, *constraints) if constraints else chosen
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE, f"--where: {error}", cure="relax it, or take more runs"
            ) from None

    def _box(self) -> "Box":
        from doe import Box
        from kolsky.inverse.parameters import design_box

        linear = design_box(self.bounds)
        bounds = dict(zip(linear.names, zip(linear.lower, linear.upper, strict=True), strict=True))
        try:
            return Box.of(bounds, logarithmic=self.logarithmic)
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE, f"--log: {error}", cure="leave it out for a parameter that may be 0"
            ) from None

    def _constraints(self, box: "Box") -> "list[Constraint]":
        from doe.box import Constraint

        made = []
        for text in self.where:
            try:
                made.append(Constraint(text, box.names))
            except ValueError as error:
                raise InputError(
                    texts.COMMAND_LINE,
                    f"--where {error}",
                    cure="write an inequality of varied parameters in SI, e.g. "
                    '"friction <= stiffness_factor"',
                ) from None
        return made

    def _chosen(self, kind: "DesignKind", box: "Box", constraints: "list[Constraint]") -> "Design":
        candidates = None
        try:
            if "candidates" in kind.needs and constraints:
                from doe.designs.optimal import grid

                candidates = grid(box)
                for constraint in constraints:
                    candidates = candidates[constraint(candidates)]
            return kind.make(
                box,
                levels=self.levels,
                runs=self.runs,
                rng=self.seed,
                generators=self.generators,
                candidates=candidates,
            )
        except ValueError as error:
            raise InputError(
                texts.COMMAND_LINE,
                f"--design {self.kind}: {error}",
                cure="`kolsky sweep --help` shows what each design needs",
            ) from None


@dataclass(frozen=True)
class Records:
    """The ledger of a sweep as given on the command line."""

    ledger: str = ""
    """The file, "none", or empty for the one among the results."""
    retry: bool = False
    """True to run again those runs that did not complete."""
    shard: tuple[int, int] = (1, 1)
    """Part of the design to run, and number of parts."""
    merge: tuple[Path, ...] = ()
    """Ledgers to take over."""

    @property
    def stem(self) -> str:
        """Name of this part's files: parts run side by side, each with its own."""
        part, parts = self.shard
        return "sweep" if parts == 1 else f"sweep-{part}of{parts}"

    def place(self, folder: Path) -> Path | None:
        """The ledger's file; None if there is to be none.

        Raises InputError if a file is to be merged into itself, or ledgers are to be merged into none.
        """
        if self.ledger == "none":
            if self.merge:
                raise InputError(texts.COMMAND_LINE, "--merge needs a ledger", cure="leave out --ledger none")
            return None
        path = Path(self.ledger) if self.ledger else folder / f"{self.stem}.sqlite"
        for other in self.merge:
            if other.resolve() == path.resolve():
                raise InputError(other, "is to be merged into itself", cure="leave out that --merge")
        return path

    def part(self, design: "Design") -> "Design":
        """The points of a design that this part runs.

        Raises InputError if there are more parts than points.
        """
        if self.shard == (1, 1):
            return design
        from doe import Design
        from doe.ledger import shard

        try:
            rows = shard(len(design), *self.shard)
        except ValueError as error:
            raise InputError(texts.COMMAND_LINE, f"--shard: {error}", cure="take fewer parts") from None
        return Design(design.points[rows], design.box, design.kind, design.settings)

    @contextmanager
    def usable(self) -> Iterator[None]:
        """A ledger that cannot be used is bad input: one line, exit code 2."""
        from doe.ledger import LedgerError

        try:
            yield
        except (LedgerError, OSError) as error:
            cure = "give another place with --ledger FILE, or --ledger none; --merge takes ledgers only"
            raise InputError(texts.COMMAND_LINE, f"--ledger: {error}", cure=cure) from error


@dataclass(frozen=True)
class Workers:
    """Processes that work in parallel; see `kolsky.cli.options.with_settings`."""

    processes: Annotated[
        int | None, typer.Option(min=1, help="Number of parallel processes.", show_default="none")
    ] = None
    dask: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Dask scheduler to use: its address or scheduler file.")
    ] = ""

    @contextmanager
    def executor(self) -> Iterator[Any]:
        """The maker of the executor (`doe.ledger.ExecutorFactory`); None where this process does the work.

        Raises InputError if both kinds are asked for, Dask is not installed, or its scheduler does not
        answer.
        """
        if self.dask and self.processes is not None:
            raise InputError(
                texts.COMMAND_LINE, "--dask and --processes exclude each other", cure="choose one"
            )
        if self.dask:
            with dask_client(self.dask) as cluster:
                yield cluster.get_executor
        elif self.processes is not None:
            yield partial(process_pool, self.processes)
        else:
            yield None

    def threads(self, given: int | None) -> int | None:
        """Threads of each worker: what was given, or the cores shared out among the processes."""
        if given is not None or self.processes is None:
            return given
        return max(1, (os.cpu_count() or 1) // self.processes)


SCHEDULER_FILE = 1_000_000
"""Largest scheduler file that is read [bytes]."""
SCHEDULER_PATIENCE = 5.0
"""Time that a Dask scheduler has to answer [s]."""
_SCHEDULER_START = "start one with `dask scheduler` and give its address or its scheduler file"


def dask_client(named: str) -> Any:
    """A client of the scheduler at an address or in a scheduler file, which the caller closes.

    Raises InputError if Dask is not installed, or no scheduler answers within `PATIENCE`.
    """
    try:
        from distributed import Client
    except ImportError:
        cure = "pip install 'kolsky[cluster]'"
        raise InputError(texts.COMMAND_LINE, "--dask needs the package distributed", cure=cure) from None
    address = _address_in_file(Path(named)) if _is_scheduler_file(named) else named
    try:
        # A client of something that takes connections and says nothing would wait for ever.
        kind = asyncio.run(asyncio.wait_for(_kind(address), SCHEDULER_PATIENCE))
        if kind != "Scheduler":
            raise ValueError(f"a {kind} is there")
        return Client(address, timeout=SCHEDULER_PATIENCE, set_as_default=False)
    except Exception as error:  # of the network, or whatever the answer of another program leads to
        said = " ".join(str(error).split()) or f"nothing within {SCHEDULER_PATIENCE:g} s"
        problem = f"--dask {named}: no scheduler answers ({said})"
        raise InputError(texts.COMMAND_LINE, problem, cure=_SCHEDULER_START) from error


async def _kind(address: str) -> str:
    """What answers at an address: "Scheduler", "Worker"."""
    from distributed import Security
    from distributed.comm import connect

    comm = await connect(address, timeout=SCHEDULER_PATIENCE, **Security().get_connection_args("client"))
    try:
        await comm.write({"op": "identity", "reply": True})
        answer = await comm.read()
    finally:
        comm.abort()
    return str(answer["type"])


def _address_in_file(path: Path) -> str:
    """The address that a scheduler file holds."""
    cure = "give the file that `dask scheduler --scheduler-file` writes"
    if path.stat().st_size > SCHEDULER_FILE:
        raise InputError(
            path,
            f"has {path.stat().st_size} bytes",
            allowed=f"a scheduler file, of at most {SCHEDULER_FILE} bytes",
            cure=cure,
        )
    try:
        return str(json.loads(path.read_text("utf-8"))["address"])
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        problem = f"is no scheduler file ({type(error).__name__}: {error})"
        raise InputError(path, problem, allowed="JSON with an address", cure=cure) from error


def _is_scheduler_file(text: str) -> bool:
    """Whether a text names a file; an address may be longer than any name."""
    try:
        return Path(text).is_file()
    except (OSError, ValueError):
        return False
