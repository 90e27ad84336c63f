"""`kolsky sweep` and `budget`: many simulations of one shot, stored in ledgers; their designs and workers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dic.processes import cores
from kolsky.base.errors import InputError, refused
from kolsky.base.files import jsonable, usable_folder
from kolsky.base.options import ADVANCED, Option
from kolsky.base.process import process_pool
from kolsky.cli import texts
from kolsky.cli.options import Figures, Out, ShotPath, Values, load, usable
from kolsky.cli.terminal import print_result, sweep_progress
from kolsky.inverse.settings import Numerics, Settings

if TYPE_CHECKING:
    from doe import Box, Design
    from doe.box import Constraint
    from doe.designs import DesignKind
    from doe.ledger import ExecutorFactory
    from kolsky.base.apparatus import Interface


_NUMERICS = Numerics(mesh=(16, 22))


def sweep(
    shot: ShotPath,
    *,
    choice: "DesignChoice",
    parameter: Values,
    numerics: Numerics = _NUMERICS,
    workers: "Workers",
    records: "Records",
    out: Out = None,
    figures: Figures = (),
) -> None:
    """Run a design of experiments over a shot's parameters; writes sweep.csv, with every run, and a page."""
    chosen = choice.design()
    texts.apart("--points" if choice.points else "--vary", chosen.box.names, "--parameter", parameter)
    part = records.part(chosen)

    loaded, folder = load(shot, out)
    if (vary := choice.vary_of(loaded.interface)) != choice.vary:
        chosen = replace(choice, vary=vary).design()
        part = records.part(chosen)
    numerics = replace(numerics, threads=workers.threads(numerics.threads))
    place = records.place(folder)
    from doe.ledger import LedgerError
    from kolsky.report.result_folder import write_sweep_results
    from kolsky.results.tables import failed_runs
    from kolsky.studies import sweep as sweeping
    from kolsky.studies.sweep_analysis import analyse_sweep, forces_along, surface_optimum
    from kolsky.uncertainty.warnings import lost_runs, rerun_advice, sliding_warning

    cure = "give another place with --ledger FILE, or --ledger none; --merge takes ledgers only"
    usable_ledger = texts.refused("--ledger: ", cure=cure, errors=(LedgerError, OSError))
    with usable(loaded), usable_ledger, sweep_progress() as progress:
        result = sweeping.sweep(
            loaded,
            part,
            held=parameter,
            numerics=numerics,
            ledger=place,
            merge=records.merge,
            retry=records.retry,
            executor=workers.executor,
            progress=progress,
        )
    warnings = [
        *rerun_advice(result.damaged),
        *lost_runs(result.table),
        *sliding_warning(loaded.interface, [*result.table.names, *parameter]),
    ]
    with usable(loaded):
        forces = forces_along(loaded, result, numerics)
    analysis = replace(analyse_sweep(result.shot, chosen.box, result.table), forces=forces)
    write_sweep_results(folder, result, analysis, name=records.stem, warnings=warnings, formats=figures)
    summary = {"shot": result.shot, **sweeping.counts(result)}
    if choice.where:
        summary["left_out_by_constraints"] = chosen.settings["refused"]
    summary |= {**sweeping.least_misfit(result), **surface_optimum(analysis)}
    if forces is not None:
        summary["fewest_time_steps"] = int(forces.steps.min())
        summary["most_time_steps"] = int(forces.steps.max())
    summary["file"] = str(folder / f"{records.stem}.csv")
    summary["page"] = str(folder / f"{records.stem}.html")
    if place is not None:
        summary["ledger"] = str(place)
    failed = {"failed_runs": failed_runs(result.table)}
    print_result(summary, jsonable({**summary, **failed, "warnings": warnings}, "sweep"), warnings=warnings)


_DEFAULT_BOUNDS = {"friction": (0.0, 2.0), "stiffness_factor": (0.75, 1.25)}
"""Bounds of a sweep without `--vary`."""
_DEFAULT_LEVELS, _LEVELS_ALONE = 10, 16
"""Levels of each of several parameters, and of a single parameter, as in Mates et al. (2012)."""


@dataclass(frozen=True)
class DesignChoice:
    """A design of experiments and its region."""

    vary: Annotated[
        tuple[str, ...],
        Option(
            "A parameter to vary; repeat for more. LEVELS belong to a factorial.",
            metavar="NAME=LOW:HIGH[:LEVELS]",
            show_default="friction=0:2 and stiffness_factor=0.75:1.25, 10 levels each; "
            "the second alone, 16 levels, where nothing slides",
        ),
    ] = ()
    kind: Annotated[
        str,
        Option(
            "factorial, fractional, composite, box-behnken or csv; with --runs points lhs, maximin, "
            "sobol, halton or d-optimal.",
            name="design",
        ),
    ] = "factorial"
    """Name of a `doe.designs.DesignKind` on the command line."""
    runs: Annotated[
        int, Option("Number of points, for a design that takes any number.", min=2, max=1_000_000)
    ] = 64
    generators: Annotated[
        str, Option('For a fractional design: a word for each parameter, e.g. "a b ab".', metavar="WORDS")
    ] = ""
    points: Annotated[Path | None, Option("File of a csv design; columns NAME (UNIT).", metavar="CSV")] = None
    seed: Annotated[int, Option("Seed of a random design.", min=0)] = 1
    log: Annotated[
        tuple[str, ...],
        Option("Vary this parameter evenly in its logarithm; repeat for more.", metavar="NAME"),
    ] = ()
    where: Annotated[
        tuple[str, ...],
        Option(
            'Leave out points that violate it, e.g. "friction <= 2 * stiffness_factor" (SI); repeat.',
            metavar="INEQUALITY",
        ),
    ] = ()
    """Constraints as in `doe.box.Constraint`."""

    def vary_of(self, interface: "Interface") -> tuple[str, ...]:
        """The parameters to vary; by default not friction if no surface of the shot slides."""
        from explicit.contact import contact_law

        slides = any(contact_law(law).needs_friction for law in (interface.faces, interface.side))
        if self.vary or self.points is not None or self.generators or slides:
            return self.vary
        from doe.designs import DESIGNS

        levels = f":{_LEVELS_ALONE}" if "levels" in DESIGNS[self.kind].needs else ""
        return (f"stiffness_factor=0.75:1.25{levels}",)

    def design(self) -> "Design":
        """The points. Those that break a constraint are left out and counted.

        Raises InputError if options do not fit together, or if they do not give a design.
        """
        from doe.designs import DESIGNS
        from doe.designs.optimal import keep

        kind = DESIGNS[texts.one_of("--design", self.kind, tuple(DESIGNS))]
        if "points" in kind.needs:
            problem = f"excludes --design {self.kind}, whose file names the parameters"
            texts.refuse({"--vary": bool(self.vary)}, problem, cure="leave out --vary")
        for option, given, need in (
            ("--generators", bool(self.generators), "generators"),
            ("--points", self.points is not None, "points"),
        ):
            if given != (need in kind.needs):
                kinds = [name for name, other in DESIGNS.items() if need in other.needs]
                raise texts.refusal(
                    f"{option} and --design {' or '.join(kinds)} need each other",
                    cure="give both, or neither",
                )
        if self.points is not None and self.log:
            raise texts.refusal("--log has no effect on points from a file", cure="leave it out")
        if self.points is not None:
            from kolsky.studies.sweep import read_design

            chosen = read_design(self.points)
            constraints = self._constraints(chosen.box)
        else:
            box, levels = self._region(kind)
            constraints = self._constraints(box)
            chosen = self._chosen(kind, box, levels, constraints)
        with texts.refused("--where: ", cure="relax it, or take more runs"):
            return keep(chosen, *constraints) if constraints else chosen

    def _region(self, kind: "DesignKind") -> "tuple[Box, list[int]]":
        """The box, and the levels of a full factorial."""
        from doe import Box
        from kolsky.inverse.parameters import design_box

        if "levels" in kind.needs and self.vary:
            bounds, levels = texts.levels("--vary", self.vary)
        else:
            bounds = texts.spans("--vary", self.vary) if self.vary else _DEFAULT_BOUNDS
            levels = [_DEFAULT_LEVELS] * len(bounds) if "levels" in kind.needs else []
        linear = design_box(bounds)
        ends = dict(zip(linear.names, zip(linear.lower, linear.upper, strict=True), strict=True))
        with texts.refused("--log: ", cure="leave it out for a parameter that may be 0"):
            return Box.of(ends, logarithmic=self.log), levels

    def _constraints(self, box: "Box") -> "list[Constraint]":
        from doe.box import Constraint

        cure = 'write an inequality of varied parameters in SI, e.g. "friction <= stiffness_factor"'
        with texts.refused("--where ", cure=cure):
            return [Constraint(text, box.names) for text in self.where]

    def _chosen(
        self, kind: "DesignKind", box: "Box", levels: Sequence[int], constraints: "list[Constraint]"
    ) -> "Design":
        candidates = None
        cure = "`kolsky sweep --help` shows what each design needs"
        with texts.refused(f"--design {self.kind}: ", cure=cure):
            if "candidates" in kind.needs and constraints:
                from doe.designs.optimal import grid

                candidates = grid(box)
                for constraint in constraints:
                    candidates = candidates[constraint(candidates)]
            return kind.make(
                box,
                levels=levels,
                runs=self.runs,
                rng=self.seed,
                generators=self.generators,
                candidates=candidates,
            )


@dataclass(frozen=True)
class Records:
    """The ledger of a sweep."""

    ledger: Annotated[
        str,
        Option(
            "File that stores every run, so that none is repeated; or none.",
            show_default="sweep.sqlite among the results",
        ),
    ] = ""
    retry: Annotated[bool, Option("Repeat runs that failed before.")] = False
    shard: Annotated[
        tuple[int, int],
        Option("Run the I-th of N parts of the design.", metavar="I/N", read=texts.shard, show_default="all"),
    ] = (1, 1)
    merge: Annotated[
        tuple[Path, ...], Option("Also use the runs of another ledger; repeat for more.", metavar="LEDGER")
    ] = ()

    @property
    def stem(self) -> str:
        """Name of this part's files."""
        part, parts = self.shard
        return "sweep" if parts == 1 else f"sweep-{part}of{parts}"

    def place(self, folder: Path) -> Path | None:
        """The ledger's file. None if no ledger is requested."""
        if self.ledger == "none":
            if self.merge:
                raise texts.refusal("--merge needs a ledger", cure="leave out --ledger none")
            return None
        path = Path(self.ledger) if self.ledger else folder / f"{self.stem}.sqlite"
        for other in self.merge:
            if other.resolve() == path.resolve():
                raise InputError(other, "cannot be merged into itself", cure="leave out that --merge")
        return path

    def part(self, design: "Design") -> "Design":
        """The points of a design that this part runs."""
        if self.shard == (1, 1):
            return design
        from doe import Design
        from doe.ledger import shard

        with texts.refused("--shard: ", cure="take fewer parts"):
            rows = shard(len(design), *self.shard)
        return Design(design.points[rows], design.box, design.kind, design.settings)


@dataclass(frozen=True)
class Workers:
    """Processes that work in parallel; see `kolsky.cli.options.with_settings`."""

    processes: Annotated[
        int | None, Option("Number of parallel processes.", min=1, show_default="none", panel=ADVANCED)
    ] = None

    @property
    def executor(self) -> "ExecutorFactory | None":
        """The maker of the executor. None if this process does the work."""
        return None if self.processes is None else partial(process_pool, self.processes)

    def threads(self, given: int | None) -> int | None:
        """Threads of each worker: the given number, or the cores divided among the processes."""
        if given is not None or self.processes is None:
            return given
        return max(1, cores() // self.processes)


_SETTINGS = Settings(numerics=Numerics(mesh=(16, 22)), refined_mesh=(32, 44), replicates=0)
"""Coarser than that of an identification, because a budget consists of many differences."""


_rates = texts.checked_numbers("the slowest and the fastest rate, e.g. 100,1000", lambda x: len(x) == 2)


def budget(
    test: Annotated[
        Path, typer.Argument(metavar="SHOT_OR_SPEC", help="A shot's folder, or a specification's file.")
    ],
    *,
    size: Annotated[
        tuple[str, ...],
        Option(
            'A source of error, e.g. "imperfections.length=0.3 %"; repeat. Without any: those of the '
            "specification's table budget, those that the shot declares, or typical ones.",
            metavar="KEY=SIGMA",
        ),
    ] = (),
    free: Annotated[
        str,
        Option(
            "Free parameters of the budget.",
            metavar="NAMES",
            show_default="the stiffness factor, others free as in identify",
        ),
    ] = "",
    draws: Annotated[int, Option("Random draws of the noise only.", min=4)] = 16,
    together: Annotated[int, Option("Random draws of all errors together.", min=0)] = 32,
    settings: Annotated[Settings, ("numerics", "refined_mesh")] = _SETTINGS,
    truth_mesh: Annotated[
        tuple[int, int] | None,
        Option("Mesh of the true run.", metavar="NRxNY", show_default="the specification's"),
    ] = None,
    workers: Workers,
    retry: Annotated[bool, Option("Repeat realisations that failed before.")] = False,
    slope: Annotated[
        float | None, Option("Plan a campaign for this expanded uncertainty of the rate slope per decade.")
    ] = None,
    rates: Annotated[
        tuple[float, ...],
        Option("Nominal strain rates of the campaign [1/s].", metavar="LOW,HIGH", read=_rates),
    ] = (200.0, 1000.0),
    scatter: Annotated[
        float, Option("Standard deviation of the stiffness from specimen to specimen.", min=0.0)
    ] = 0.0,
    out: Annotated[
        Path | None, Option("Where results go.", metavar="FOLDER", show_default="the test's results")
    ] = None,
    figures: Figures = (),
) -> None:
    """Budget the errors of a test; writes budget.csv and budget.html, and stores realisations in a ledger."""
    from doe.ledger import LedgerError
    from kolsky.report.pages.studies import budget_rows, budget_warnings
    from kolsky.report.result_folder import write_budget_results
    from kolsky.studies.budget import budget as budgets
    from kolsky.studies.budget.realisation import factors_of, usual_sizes
    from kolsky.studies.budget.records import facts, plan_campaign, shot_sigma
    from kolsky.virtual.specification import read_specification

    folder = usable_folder(out or (test if test.is_dir() else test.parent) / "results")
    series = read_specification(_specification(test, folder))
    shot = series.shot(series.numbers[0])
    quantities = shot.quantities
    if truth_mesh is not None:
        finer = quantities.truth.model_copy(update={"mesh": truth_mesh})
        quantities = quantities.model_copy(update={"truth": finer})
    sizes = dict(part.partition("=")[::2] for part in size) or series.declared.budget or usual_sizes()
    numerics = replace(settings.numerics, threads=workers.threads(settings.numerics.threads))
    settings = replace(settings, numerics=numerics)
    if free:
        settings = replace(settings, free=dict.fromkeys(texts.listed(free)))
    cure = "correct the specification, or take more draws"
    with refused(test, cure=cure, errors=(ValueError, LedgerError)):
        factors = factors_of({key: texts.plain_or_text(value) for key, value in sizes.items()})
        with sweep_progress() as progress:
            budgeted = budgets.budget(
                quantities,
                factors,
                settings=settings,
                folder=shot.folder,
                draws=draws,
                together=together,
                ledger=folder / "budget.sqlite",
                retry=retry,
                executor=workers.executor,
                progress=progress,
            )
    campaign, unplanned = None, ""
    if slope is not None:
        try:
            campaign = plan_campaign(rates[0], rates[1], slope, shot_sigma(budgeted[0], scatter))
        except ValueError as error:
            unplanned = str(error)
    write_budget_results(folder, budgeted, campaign, formats=figures)
    if unplanned:
        raise InputError(
            test,
            f"no campaign can be planned, and {folder / 'budget.html'} has none: {unplanned}",
            cure="budget more factors, or leave --rates out",
        )
    summary = {**budget_rows(budgeted[0], campaign), "page": str(folder / "budget.html")}
    how = {
        "mesh": numerics.mesh, "refined_mesh": settings.refined_mesh, "truth_mesh": quantities.truth.mesh,
        "draws": draws, "together": together,
    }  # fmt: skip
    entries = [facts(one, campaign) for one in budgeted]
    content = jsonable({"made_with": how, "budgets": entries}, "budget")
    print_result(summary, content, warnings=budget_warnings(budgeted[0]))


def _specification(test: Path, folder: Path) -> Path:
    """The specification's file. One is written for a shot."""
    if test.suffix == ".toml" and test.name != "shot.toml":
        return test
    if test.is_dir() and not (test / "shot.toml").exists():
        return test
    from kolsky.results.hdf5 import read_identification
    from kolsky.shot.load import load_shot
    from kolsky.virtual.shot_file import specification_of

    shot = load_shot(test)
    stored = shot.folder / "results" / "identification.h5"
    answer = (
        {name: one.value for name, one in read_identification(stored).estimates.items()}
        if stored.exists()
        else {}
    )
    folder.mkdir(parents=True, exist_ok=True)
    return specification_of(shot, folder, answer=answer)
