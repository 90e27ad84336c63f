"""`kolsky identify` and `demo`: one shot, several together, or one by one in processes."""

import shutil
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, as_completed
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from dic.files import scratch
from kolsky.base.apparatus import RelaxationKind
from kolsky.base.errors import InputError, refuse, refused
from kolsky.base.files import usable_folder, write_folder
from kolsky.base.options import ADVANCED, TOGETHER, Option
from kolsky.cli import texts
from kolsky.cli.options import Figures, Out, changed, load, usable
from kolsky.cli.sweep import Workers
from kolsky.cli.terminal import print_result, printing, progress_bars
from kolsky.inverse.settings import JointSettings, Settings

if TYPE_CHECKING:
    from kolsky.inverse.joint_result import JointResult
    from kolsky.shot.records import Shot


def identify_shots(
    paths: Sequence[Path],
    joint: JointSettings,
    settings: "Settings",
    *,
    slow_tests: Path | None,
    relaxation: tuple[RelaxationKind, int] | None,
    out: Path | None,
    figures: Sequence[str],
) -> None:
    """Load the shots, identify them together, write and print."""
    from doe.ledger import LedgerError
    from kolsky import joint_identification
    from kolsky.inverse.parameters import with_relaxation
    from kolsky.inverse.slow_tests import read_slow_tests
    from kolsky.report.result_folder import write_results
    from kolsky.results.joint import to_json
    from kolsky.shot.curve import with_pull
    from kolsky.shot.load import load_shot

    shared = ("free", "held", "hold", "numerics", "refined_mesh", "replicates", "seed")
    with texts.refused(cure="correct the option; `kolsky identify --help` shows each with its range"):
        chosen = replace(joint, **{name: getattr(settings, name) for name in shared})
    require_one_material(paths)
    shots = []
    for path in paths:
        shot = load_shot(path)
        if relaxation is not None:
            shot = with_relaxation(shot, *relaxation)
        shots.append(with_pull(shot, settings.pull))
    slow = () if slow_tests is None else read_slow_tests(slow_tests)
    folder = usable_folder(out or Path("joint"))
    folder.mkdir(parents=True, exist_ok=True)
    cure = "give shots of one material with one set of free parameters"
    joining = refused(shots[0].folder, cure=cure, errors=(ValueError, LedgerError))
    with progress_bars() as progress, joining:
        result = joint_identification.identify_shots(
            shots, chosen, slow=slow, ledger=folder / "joint.sqlite", progress=progress
        )
    write_results(folder, result, formats=figures)
    print_result(
        _result_rows(result),
        to_json(result),
        lines=answer_lines(result),
        files={"report": folder / "joint.html"},
        warnings=result.warnings,
    )


def require_one_material(paths: Sequence[Path]) -> None:
    """Raise InputError if two shot files name a different `material`, or if one cannot be read."""
    from kolsky.studies.rates.rate import declarations

    named = [(file, said.material) for file, said in map(declarations, paths) if said.material is not None]
    for file, material in named[1:]:
        if material != named[0][1]:
            raise InputError(
                file.path,
                f"is {material!r}, but {named[0][0].path} has {named[0][1]!r}: a joint answer is of "
                "one material",
                key="material",
                cure="identify them apart with --each, or correct the name",
            )


def answer_lines(result: "JointResult") -> list[str]:
    """First lines of the answer: shared parameters with 95 % intervals as on the page, and the verdict."""
    from kolsky.inverse.result import Verdict
    from kolsky.report.pages.identification import parameter_row
    from kolsky.results.joint import fits_of
    from kolsky.results.numbers import plain_sentence
    from kolsky.results.printed import plain_symbol

    lines = []
    for name, e in result.estimates.items():
        row = parameter_row(result, name)
        half = "" if e.outcome is Verdict.NOT_SEEN else f" +- {row['U']}"
        line = plain_sentence(f"{plain_symbol(name)} = {row['Value']}{half} {row['Unit']}".rstrip())
        line += f" (95 %, {len(result.shots)} shots)"
        lines.append(line if e.outcome is Verdict.IDENTIFIED else f"{line}: {e.outcome.value.upper()}")
    verdict = f"verdict: {result.verdict}"
    if fits := fits_of(result):
        of, worst = max(fits, key=lambda one: one[1].excess / one[1].limit)
        verdict += f" (largest residual over expected: {worst.excess:.2g} of {of}, {worst.channel})"
    return [*lines, verdict]


def _result_rows(result: "JointResult") -> dict[str, str]:
    """Names and values below the answer: those of the page."""
    from kolsky.report.pages.identification import joint_rows

    rows = joint_rows(result)
    if result.curve is not None:
        c = result.curve
        for strain, factor, sigma in zip(c.strain, c.factor, c.sigma_log, strict=True):
            rows[f"factor at strain {strain:.3f}"] = f"{factor:.4f} +- {2.0 * factor * sigma:.2g} (k = 2)"
    return rows


@dataclass(frozen=True)
class SingleShotJob:
    """The identification of one shot, as given on the command line. It can be pickled."""

    shot: Path
    settings: Settings
    out: Path | None = None
    """Folder of the results; None for the folder `results` of the shot."""
    relaxation: tuple[RelaxationKind, int] | None = None
    """Kind and branches of a relaxation. None: that of the shot."""
    diagnose: bool = False
    """True to test the likeliest causes of misfit."""
    paper: bool = False
    """True to apply the method of Mates et al. too."""
    figures: tuple[str, ...] = ()
    verbose: bool = False
    """True to print every value."""


@dataclass(frozen=True)
class Printout:
    """Printed answer of an identification, see `print_result`. It can be pickled."""

    shot: str
    lines: tuple[str, ...]
    rows: Mapping[str, Any]
    content: Mapping[str, Any]
    warnings: tuple[str, ...]
    page: Path

    def show(self) -> None:
        """Print it."""
        print_result(
            self.rows, self.content, lines=self.lines, files={"report": self.page}, warnings=self.warnings
        )


def _run_job(job: SingleShotJob, *, processes: int = 1) -> Printout:
    """Identify a shot and write its results."""
    from kolsky import identification
    from kolsky.inverse.parameters import with_relaxation
    from kolsky.report.result_folder import PAGE, write_identify_results
    from kolsky.results import printed
    from kolsky.results.printed import fit_line
    from kolsky.results.tables import to_json

    shot, folder = load(job.shot, job.out, forks=processes > 1)
    if job.relaxation is not None:
        shot = with_relaxation(shot, *job.relaxation)
    with usable(shot), progress_bars() as progress:
        result = identification.identify(shot, job.settings, progress=progress)
        if job.diagnose:
            result = identification.diagnose(result, shot, job.settings, progress=progress)
    write_identify_results(folder, result, shot, formats=job.figures, processes=processes)
    rows, content, remarks = paper_answer(shot, job.settings, folder) if job.paper else ({}, {}, [])
    return Printout(
        shot=shot.name,
        lines=(*(printed.answer(e) for e in result.estimates.values()), fit_line(result)),
        rows={**(printed.details(result) if job.verbose else printed.summary(result)), **rows},
        content={**to_json(result), **content},
        warnings=(*result.warnings, *remarks),
        page=folder / PAGE,
    )


def paper_answer(
    shot: "Shot", settings: "Settings", folder: Path
) -> tuple[dict[str, str], dict[str, Any], list[str]]:
    """Write the answer of the paper's method; returns its rows to print, keys of the JSON object, warnings.

    If the method fails, there is a warning and no error.
    """
    from doe.ledger import LedgerError
    from kolsky.shot.curve import with_pull
    from kolsky.studies import paper_method as paper
    from kolsky.studies.paper_method import BOUNDS, paper_method

    given = {name: span for name, span in (settings.free or {}).items() if span and name in BOUNDS}
    try:
        with progress_bars() as progress:
            result = paper_method(
                with_pull(shot, settings.pull),
                bounds=given,
                held=settings.held,
                numerics=settings.numerics,
                refined_mesh=settings.refined_mesh,
                ledger=folder / f"{paper.STEM}.sqlite",
                progress=progress,
            )
    except (ValueError, LedgerError, OSError) as error:
        return {}, {paper.STEM: None}, [f"the paper's method has no answer: {error}"]
    content = paper.to_json(result)
    write_folder(folder, {f"{paper.STEM}.json": content})
    return paper.rows(result), {paper.STEM: content}, paper.paper_warnings(result)


_Answer = Printout | InputError
"""The answer of a shot, or the reason of its failure."""


def identify_each(shots: Sequence[Path], pattern: SingleShotJob, workers: Workers) -> None:
    """Identify every shot as in the pattern, write the results of each, and print all in the shots' order."""
    jobs = [
        replace(pattern, shot=shot, out=out)
        for shot, out in zip(shots, _result_folders(shots, pattern.out), strict=True)
    ]
    if workers.executor is None:
        answers = [_run_or_error(job, processes=2) for job in jobs]
    else:
        numerics = pattern.settings.numerics
        numerics = replace(numerics, threads=workers.threads(numerics.threads))
        settings = replace(pattern.settings, numerics=numerics)
        jobs = [replace(job, settings=settings) for job in jobs]
        with progress_bars() as progress:
            answers = run_jobs(workers.executor, jobs, lambda done: progress("shots", done, len(jobs)))
    printouts = [one for one in answers if isinstance(one, Printout)]
    print_result(
        {"shots identified": f"{len(printouts)} of {len(shots)}"},
        {"shots": [_json_object(shot, one) for shot, one in zip(shots, answers, strict=True)]},
        lines=[f"{one.shot}: {line}" for one in printouts for line in one.lines],
        files={"reports": ", ".join(str(one.page) for one in printouts)},
        warnings=[
            f"{_shot_name(shot)}: {line}"
            for shot, one in zip(shots, answers, strict=True)
            if isinstance(one, Printout)
            for line in one.warnings
        ],
    )
    refuse([problem for one in answers if isinstance(one, InputError) for problem in one.problems])


def run_jobs(
    executor: Callable[[], Any], jobs: Sequence[SingleShotJob], report: Callable[[int], None]
) -> list[_Answer]:
    """Run the jobs by an executor's workers. `report` is called with the number of finished jobs."""
    answers: dict[int, _Answer] = {}
    report(0)
    try:
        with executor() as pool:
            futures = {pool.submit(_in_worker, job): i for i, job in enumerate(jobs)}
            for future in as_completed(futures):
                answers[futures[future]] = future.result()
                report(len(answers))
    except (BrokenExecutor, CancelledError) as error:
        raise texts.refusal(
            f"a worker failed after {len(answers)} of {len(jobs)} shots were identified ({error})",
            cure="take fewer workers or more memory; the results of the identified shots are complete",
        ) from error
    return [answers[i] for i in range(len(jobs))]


def _in_worker(job: SingleShotJob) -> _Answer:
    """The answer of a worker. The worker prints nothing."""
    with printing(quiet=True):
        return _run_or_error(job, processes=1)


def _run_or_error(job: SingleShotJob, *, processes: int) -> _Answer:
    """The answer, or the problem of the shot."""
    try:
        return _run_job(job, processes=processes)
    except InputError as error:
        return error


def _shot_name(shot: Path) -> str:
    """Name of a shot's folder."""
    from kolsky.schema.shot_file import folder_of

    return folder_of(shot).resolve().name


def _result_folders(shots: Sequence[Path], out: Path | None) -> list[Path | None]:
    """Folder of each shot's results. None: the folder `results` of the shot."""
    from kolsky.schema.shot_file import folder_of

    places = [folder_of(shot).resolve() if out is None else out / _shot_name(shot) for shot in shots]
    double = sorted({str(place) for place in places if places.count(place) > 1})
    if double:
        raise texts.refusal(
            f"two shots would write to {double[0]}",
            cure="name each shot once; with --out the names of their folders must differ",
        )
    return [None] * len(shots) if out is None else list(places)


def _json_object(shot: Path, one: _Answer) -> dict[str, Any]:
    """A shot in the object of `--json`."""
    if isinstance(one, Printout):
        return {"folder": str(shot), "report": str(one.page), "answer": one.content, "problem": None}
    return {"folder": str(shot), "report": None, "answer": None, "problem": str(one)}


def identify(
    shots: Annotated[
        list[Path],
        typer.Argument(
            metavar="SHOT...", help="A shot's folder, or its shot.toml; several: identified together."
        ),
    ],
    *,
    settings: Settings,
    hold: Annotated[
        tuple[str, ...],
        Option(
            "Hold a parameter at the shot's value, or at this one (SI or with unit); repeat for more.",
            short="-p/--parameter",
            metavar="NAME[=VALUE]",
        ),
    ] = (),
    method: Annotated[
        Literal["least-squares", "paper"],
        Option(
            "least-squares, or paper: also the method of Mates et al. (factorial over friction and m, "
            "response surface of Phi, simplex); bounds by --free.",
            metavar="WHICH",
            panel=ADVANCED,
        ),
    ] = "least-squares",
    diagnose: Annotated[
        bool,
        Option("Repeat the identification with each of the two likeliest causes corrected.", panel=ADVANCED),
    ] = False,
    relaxation: Annotated[
        tuple[RelaxationKind, int] | None,
        Option(
            "Add a viscoelastic model with free constants: prony, prony:2 or bergstrom_boyce.",
            metavar="KIND",
            show_default="[relaxation] of shot.toml",
            read=texts.relaxation,
            panel=ADVANCED,
        ),
    ] = None,
    each: Annotated[bool, Option("Identify several shots one by one, with a results folder each.")] = False,
    workers: Workers,
    slow_tests: Annotated[
        Path | None,
        Option("Relaxation, ramps, oscillation of the same material.", metavar="TOML", panel=TOGETHER),
    ] = None,
    joint: Annotated[JointSettings, ("curve_nodes", "curve_roughness", "gain_each", "scatter")],
    out: Out = None,
    figures: Figures = (),
    verbose: Annotated[bool, Option("Print every value of the answer.", short="-v")] = False,
) -> None:
    """Identify the stiffness factor m (and more) of a shot, with its k = 2 interval and a report.

    Poisson's ratio and damping are estimated too if the ringing of the force constrains them. With --hold
    poisson --hold damping they keep the shot's values.

    Writes identification.h5, report.html and CSV tables into SHOT/results.

    Several shots of one material, with slow tests if given, are identified together: shared parameters,
    clock and gain of each shot, scatter between shots. The results are joint.json, joint.html, tables and the
    ledger joint.sqlite in the folder joint; the same command continues an interrupted run. With
    --each they are identified one by one, in parallel with --processes.
    """
    values, names = texts.holds("--hold", hold)
    texts.apart("--free", settings.free or {}, "--hold", [*values, *names])
    texts.finer("--refined-mesh", settings.refined_mesh, "--mesh", settings.numerics.mesh)
    settings = replace(settings, held=values, hold=names)
    if settings.bayes:
        texts.installed("--bayes", "emcee", "bayes")
    if not each:
        problem = "is for shots that are identified one by one"
        texts.refuse(changed(workers), problem, cure="give --each, or leave it out")
    if (len(shots) > 1 or slow_tests is not None or joint.curve_nodes > 0) and not each:
        texts.refuse(
            {"--method": method != "least-squares", "--bayes": settings.bayes, "--diagnose": diagnose},
            "is for a single shot",
            cure="leave it out, or identify the shots one by one",
        )
        identify_shots(
            shots, joint, settings, slow_tests=slow_tests, relaxation=relaxation, out=out, figures=figures
        )
        return
    job = SingleShotJob(
        shots[0],
        settings,
        out=out,
        relaxation=relaxation,
        diagnose=diagnose,
        paper=method == "paper",
        figures=figures,
        verbose=verbose,
    )
    if each:
        problem = "is for several shots together"
        given = {"--slow-tests": slow_tests is not None, **changed(joint)}
        texts.refuse(given, problem, cure="leave it out, or leave out --each")
        identify_each(shots, job, workers)
        return
    _print_one(job)


def _print_one(job: SingleShotJob) -> None:
    """Identify one shot in this process and print its answer."""
    from kolsky.report.result_folder import drawing_processes

    _run_job(job, processes=drawing_processes()).show()


DEMO = "open-05"
"""Folder of the shot that comes with the package."""


def demo(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="New folder for the files of the shot.")
    ] = Path(DEMO),
    verbose: Annotated[bool, Option("Print every value of the answer.", short="-v")] = False,
) -> None:
    """Copy the shot that comes with kolsky to a new folder and identify it.

    The shot is synthetic, made by another program: m = 1.12, nu = 0.499, beta = 25 us.
    """
    source = demo_files()
    if folder.exists():
        cure = f"give another folder, or: kolsky identify {folder}"
        raise InputError(folder, "exists already and was not changed", cure=cure)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with scratch(folder.parent) as partial:
        (made := partial / folder.name).mkdir()
        for path in source:
            shutil.copyfile(path, made / path.name)
        made.rename(folder)
    _print_one(SingleShotJob(folder, Settings(), verbose=verbose))


def demo_files() -> list[Path]:
    """Files of the shot that comes with the package, in the source tree or in the installation.

    Raises InputError if the installation lacks them.
    """
    files = sorted((Path(__file__).parents[2] / "runs" / DEMO).glob("*.*"))
    if not files:
        installed = metadata.files("kolsky") or []
        files = sorted(Path(one.locate()) for one in installed if one.parent.name == DEMO)
    if not files or not all(path.is_file() for path in files):
        raise InputError("kolsky", f"was installed without its shot {DEMO}", cure="install it again with pip")
    return files
