"""`kolsky material reference-curve` and `relaxation`: the slow behaviour that a shot's stiffness refers to.

The first turns quasi-static tests into the reference curve; the second puts relaxation, oscillation,
temperature sweeps and shots on one axis of time.
"""

import json
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, HeaderLine, OutFolder

if TYPE_CHECKING:
    from kolsky.base.apparatus import Specimen
    from kolsky.material.end_friction.problem import EndFriction
    from kolsky.material.reference_curve import Pull, ReferenceCurve
    from kolsky.material.uniaxial import Toe
    from kolsky.studies.rate_dependence import SlowDynamics


def _specimen_of(diameter: str | None, length: str | None) -> "Specimen | None":
    """Undeformed size of the specimen, if it is given."""
    from kolsky.base.apparatus import Specimen

    if diameter is None and length is None:
        return None
    if diameter is None or length is None:
        raise InputError(
            texts.COMMAND_LINE,
            "needs both --diameter and --length or neither",
            cure="give both, or leave both out",
        )
    return Specimen(
        diameter=texts.physical("--diameter", diameter, "m", positive=True),
        length=texts.physical("--length", length, "m", positive=True),
        density=0.0,
    )


def _refuse_curve_columns(columns: dict[str, str], size: "Specimen | None") -> None:
    """Refuse columns that make no test."""
    pair = {"strain", "stress"} if "stress" in columns else {"displacement", "force"}
    if (set(columns) & {"strain", "stress", "displacement", "force"}) != pair:
        raise InputError(
            texts.COMMAND_LINE,
            "a test needs --strain and --stress, or --displacement and --force",
            cure="name two columns, or give their numbers",
        )
    if "force" in pair and size is None:
        raise InputError(
            texts.COMMAND_LINE,
            "--displacement and --force need --diameter and --length",
            cure="give the size of the specimen",
        )


def ends_of(text: str, sigma: float) -> "EndFriction | None":
    """ "bonded" or "0.3" as what held the specimen at its ends."""
    from kolsky.material.end_friction.problem import EndFriction

    number = None
    if text not in ("none", "bonded", "rough", "free"):
        try:
            number = float(text)
        except ValueError:
            texts.one_of("--friction", text, ("none", "bonded", "rough", "free", "a number"))
    if number is None and sigma > 0.0:
        raise InputError(
            texts.COMMAND_LINE,
            "--friction-sigma goes with a number as --friction",
            cure="give --friction NUMBER, or leave --friction-sigma out",
        )
    if text == "none":
        return None
    if text in ("bonded", "rough"):
        return EndFriction("bonded" if text == "bonded" else "rough")
    return EndFriction("coulomb", number, sigma)


def _toe_of(text: str) -> "Toe":
    """ "gaussian:0.03:0.12" as a toe."""
    from kolsky.material.uniaxial import Toe

    if text == "none":
        return Toe()
    kind, *ends = text.split(":")
    try:
        if kind not in ("line", "gaussian") or len(ends) != 2:
            raise ValueError
        low, high = (float(end) for end in ends)
    except ValueError:
        raise InputError(
            texts.COMMAND_LINE,
            f"--toe {text!r} cannot be read",
            cure="write none, or line:LOW:HIGH or gaussian:LOW:HIGH with strains, e.g. gaussian:0.03:0.12",
        ) from None
    return Toe("line" if kind == "line" else "gaussian", low, high)


def _units_of(given: list[str], columns: dict[str, str]) -> dict[str, str]:
    """["Load=N"] as units by column."""
    found = {}
    for text in given:
        column, equals, unit = text.rpartition("=")
        if not equals or column not in columns.values():
            raise InputError(
                texts.COMMAND_LINE,
                f"--unit {text!r} names no column that is read",
                cure="write COLUMN=UNIT",
            )
        found[column] = unit
    return found


_CurveColumn = typer.Option(metavar="COLUMN", help="By name or number.", show_default=False)


def reference_curve(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Repeats of one test.")],
    convention: Annotated[
        str, typer.Option(help="Sign of the files' columns: tension-positive or compression-positive.")
    ],
    branch: Annotated[str, typer.Option(help="compression or tension.")],
    strain: Annotated[str, _CurveColumn] = "",
    stress: Annotated[str, _CurveColumn] = "",
    displacement: Annotated[str, _CurveColumn] = "",
    force: Annotated[str, _CurveColumn] = "",
    time: Annotated[str, _CurveColumn] = "",
    bulge: Annotated[
        str,
        typer.Option(
            metavar="COLUMN", help="Radius at mid-height, fitted with the force.", show_default=False
        ),
    ] = "",
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="COLUMN=UNIT", help="Unit of a column; repeat for more.", show_default="found"),
    ] = None,
    header_line: HeaderLine = None,
    diameter: Annotated[str | None, typer.Option(help='Of the specimen, e.g. "9.5 mm".')] = None,
    length: Annotated[str | None, typer.Option(help='Of the specimen, e.g. "6.5 mm".')] = None,
    compliance: Annotated[
        str | None, typer.Option(help='Of machine and load cell, e.g. "0.2 um/N".', show_default="none")
    ] = None,
    toe: Annotated[
        str,
        typer.Option(
            metavar="none|KIND:LOW:HIGH", help="line or gaussian, continued from these strains to zero."
        ),
    ] = "none",
    friction: Annotated[
        str,
        typer.Option(
            help="What held the ends: none, bonded, rough, Coulomb's coefficient, or free (with --bulge)."
        ),
    ] = "none",
    friction_sigma: Annotated[
        float, typer.Option(min=0.0, help="Standard uncertainty of that number.")
    ] = 0.0,
    bulge_sigma: Annotated[str | None, typer.Option(help='Of the radius, e.g. "5 um".')] = None,
    scale_sigma: Annotated[
        str, typer.Option(help="Relative standard uncertainty of force and section, common to all tests.")
    ] = "0 %",
    poisson: Annotated[
        float, typer.Option(min=0.0, max=0.4999, help="Poisson's ratio of the shot, for the friction.")
    ] = 0.499,
    points: Annotated[int, typer.Option(min=8, max=10000, help="Points of the curve.")] = 60,
    last: Annotated[
        float | None,
        typer.Option("--last-strain", help="Where the curve ends.", show_default="the tests' end"),
    ] = None,
    conditioned: Annotated[
        bool,
        typer.Option("--conditioned", help="Also the last loading ramp of each record, as its own curve."),
    ] = False,
    out: Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="The curve.")] = Path("curve.csv"),
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Average quasi-static tests to the curve of the material: toe, machine, scatter, end friction.

    Writes the curve with its uncertainties, E_a over strain and time, and the table for shot.toml.
    """
    formats = texts.figure_formats(figures)
    if out.suffix != ".csv":
        raise InputError(texts.COMMAND_LINE, "is no table", key="--out", value=str(out), allowed="FILE.csv")
    from kolsky.base.files import filling, usable_folder, write_table
    from kolsky.cli.terminal import print_result
    from kolsky.material import reference_curve as curves
    from kolsky.material.end_friction.problem import CorrectionNumerics
    from kolsky.material.reference_curve import (
        BRANCHES,
        CONVENTIONS,
        curve_columns,
        curve_table,
        read_uniaxial_test,
        summary,
        write_modulus,
    )

    folder = usable_folder(out.parent)
    if friction == "free" and not bulge:
        raise InputError(
            texts.COMMAND_LINE,
            "--friction free needs --bulge: the radius at mid-height finds the friction",
            cure="measure the radius at mid-height and give it with --bulge",
        )
    if (bulge != "") != (bulge_sigma is not None):
        raise InputError(texts.COMMAND_LINE, "--bulge and --bulge-sigma belong together", cure="give both")
    size = _specimen_of(diameter, length)
    try:
        treatment = curves.Treatment(
            toe=_toe_of(toe),
            compliance=0.0 if compliance is None else texts.physical("--compliance", compliance, "m/N"),
            scale_sigma=texts.physical("--scale-sigma", scale_sigma, "1"),
            specimen=size,
            ends=ends_of(friction, friction_sigma),
            bulge_sigma=0.0
            if bulge_sigma is None
            else texts.physical("--bulge-sigma", bulge_sigma, "m", positive=True),
            points=points,
            last=last,
            numerics=CorrectionNumerics(poisson=poisson),
        )
    except ValueError as error:
        raise InputError(
            texts.COMMAND_LINE,
            str(error),
            cure="correct the option; `kolsky material reference-curve --help` shows each",
        ) from None
    texts.one_of("--convention", convention, CONVENTIONS)
    texts.one_of("--branch", branch, BRANCHES)
    columns = {
        what: column
        for what, column in (
            ("strain", strain),
            ("stress", stress),
            ("displacement", displacement),
            ("force", force),
            ("time", time),
            ("bulge", bulge),
        )
        if column
    }
    _refuse_curve_columns(columns, size)
    units = _units_of(unit or [], columns)
    tests, hashes = [], {}
    for path in files:
        test, digest = read_uniaxial_test(
            path,
            columns,
            convention=convention,
            branch=branch,
            units=units,
            header_line=header_line,
            specimen=size,
        )
        if str(path) in hashes:
            raise InputError(path, "is named twice", cure="a test counts once")
        hashes[str(path)] = digest
        tests.append(test)
    pulls: tuple[Pull, ...] = ("first", "conditioned") if conditioned else ("first",)
    try:
        found = {pull: curves.reference_curve(tests, treatment, pull=pull) for pull in pulls}
    except ValueError as error:
        raise InputError(
            texts.COMMAND_LINE,
            str(error),
            cure="correct the option; `kolsky material reference-curve --help` shows each",
        ) from error
    names = {"first": out.stem, "conditioned": f"{out.stem}_conditioned"}
    with filling(folder) as partial:
        for pull, made in found.items():
            write_table(partial / f"{names[pull]}.csv", curve_columns(made))
            write_modulus(partial / f"{names[pull]}_modulus.csv", made)
            if formats:
                from kolsky.report.canvas import save_figures

                save_figures(partial / f"{names[pull]}_figures", made, formats=formats)
        other = f"{names['conditioned']}.csv" if conditioned else None
        table = curve_table(out.name, found["first"], other)
        (partial / f"{out.stem}.toml").write_text(table, encoding="utf-8")
    rows: dict[str, Any] = {}
    for pull, made in found.items():
        rows |= _curve_rows(made, f"{pull}: " if conditioned else "")
    said = {"inputs": hashes, "curves": {pull: summary(made) for pull, made in found.items()}}
    print_result(
        rows,
        said if as_json else None,
        rest={"curve": out, "for shot.toml": folder / f"{out.stem}.toml"},
        warnings=list(dict.fromkeys(remark for made in found.values() for remark in made.remarks)),
    )


def _curve_rows(made: "ReferenceCurve", before: str) -> dict[str, Any]:
    """The lines that a terminal gets of a curve; `before` stands before every name."""
    modulus, friction = made.modulus, made.friction
    strain = made.band.strain
    rows: dict[str, Any] = {
        f"{before}tests": len(made.tests),
        f"{before}strains": f"{strain[0]:.4g} to {strain[-1]:.4g}",
        f"{before}mean E_a": f"{modulus.mean / 1e3:.4g} ± {2.0 * modulus.mean_sigma / 1e3:.2g} kPa (k = 2)",
    }
    offsets = [one.offset for one in made.tests]
    if any(offsets):
        rows[f"{before}zero of strain"] = f"{min(offsets):.4g} to {max(offsets):.4g}"
    if friction is not None:
        ratio = friction.ratio
        rows[f"{before}stiffer by end friction"] = f"{ratio.min():.3f} to {ratio.max():.3f} times"
        if friction.coefficient is not None:
            sigma = f" ± {2.0 * friction.sigma:.2g} (k = 2)" if friction.sigma > 0.0 else ""
            rows[f"{before}friction"] = f"{friction.coefficient:.3g}{sigma}"
        best = friction.models[0]
        rows[f"{before}law behind it"] = f"{best.name}, {100.0 * best.misfit:.2g} % from the test (rms)"
        for model in friction.models[1:]:
            if model.weight > 0.01:
                rows[f"{before}or"] = f"{model.name} (weight {model.weight:.2g})"
    return rows


def material_relaxation(
    tests: Annotated[
        Path, typer.Argument(metavar="TESTS.toml", help="List of slow tests: holds, ramps, oscillation.")
    ],
    shots: Annotated[
        list[Path] | None,
        typer.Option("--shot", metavar="SHOT", help="An identified shot to compare with them; repeat."),
    ] = None,
    branches: Annotated[
        int, typer.Option(min=0, max=8, help="Most branches of the Prony series that are tried.")
    ] = 3,
    out: OutFolder = Path("relaxation"),
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Relaxation, oscillation (DMA), temperature sweeps and shots on one axis of time; fit a Prony series.

    Writes relaxation.html, relaxation.json and CSV tables.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    from kolsky.base.files import filling, usable_folder, write_table
    from kolsky.cli.terminal import print_result, since
    from kolsky.inverse.slow_tests import read_slow_list
    from kolsky.report.pages.relaxation import write_page
    from kolsky.studies.rate_dependence import analyse_rate_dependence, summary, tables
    from kolsky.studies.rates.rate import collected_shot

    slow = read_slow_list(tests)
    folder = usable_folder(out)
    rated = [collected_shot(shot, group="all") for shot in shots or ()]
    try:
        found = analyse_rate_dependence(slow, rated, at_most=branches)
    except ValueError as error:
        raise InputError(tests, str(error), cure="correct the list or the tables that it names") from error
    said = {"inputs": dict(slow.files), **summary(found)}
    with filling(folder) as partial:
        for name, table in tables(found).items():
            write_table(partial / f"{name}.csv", table)
        text = json.dumps(said, indent=2, allow_nan=False) + "\n"
        (partial / "relaxation.json").write_text(text, encoding="utf-8")
        write_page(partial / "relaxation.html", found, dict(slow.files))
        if formats:
            from kolsky.report.canvas import save_figures

            save_figures(partial / "figures", found, formats=formats)
    print_result(
        _relaxation_rows(found),
        said if as_json else None,
        rest={"report": folder / "relaxation.html", "wall time": since(started)},
        warnings=found.remarks,
    )


def _relaxation_rows(found: "SlowDynamics") -> dict[str, Any]:
    """The lines that a terminal gets."""
    fit = found.fit
    low, high = fit.interval("factor")
    E, factor = 1e-3 * found.young, float(fit.values[0])
    rows: dict[str, Any] = {
        "verdict": found.verdict.sentence,
        "long-term E": f"{E:.4g} kPa, {E * low / factor:.4g} to {E * high / factor:.4g} (k = 2)",
    }
    for k in range(len(fit.model.series)):
        strength, time = fit.interval(f"strength {k + 1}"), fit.interval(f"time {k + 1}")
        rows[f"branch {k + 1}"] = (
            f"strength {fit.model.series.strengths[k]:.4g} ({strength[0]:.3g} to {strength[1]:.3g}), time"
            f" {fit.model.series.times[k]:.4g} s ({time[0]:.3g} to {time[1]:.3g}), k = 2"
        )
    for name, sweep in found.sweeps.items():
        if sweep.law_holds and sweep.covariance is not None:
            u = sweep.covariance.diagonal() ** 0.5
            rows[f"{name}: WLF"] = (
                f"C1 = {sweep.C1:.4g} ± {2.0 * u[0]:.2g}, C2 = {sweep.C2:.4g} ± {2.0 * u[1]:.2g} K (k = 2) at"
                f" {sweep.sweep.reference - 273.15:.4g} °C"
            )
    for one in found.moduli:
        rows[one.label] = (
            f"E_a {1e-3 * one.modulus.min():.4g} to {1e-3 * one.modulus.max():.4g} kPa, age"
            f" {one.age.min():.3g} to {one.age.max():.3g} s"
        )
    return rows
