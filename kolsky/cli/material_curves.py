"""`kolsky material reference-curve` and `relaxation`: the slow behaviour that a shot refers to."""

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError, refused
from kolsky.base.files import usable_folder, write_folder
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.options import Figures, OutFolder
from kolsky.cli.terminal import print_result
from kolsky.material.fits.columns import Columns
from kolsky.report.figures_alone import figure_files

if TYPE_CHECKING:
    from kolsky.base.apparatus import Specimen
    from kolsky.material.end_friction.problem import EndFriction
    from kolsky.material.reference_curve import Pull, ReferenceCurve
    from kolsky.material.uniaxial import Toe
    from kolsky.studies.rate_dependence import SlowDynamics
    from kolsky.studies.rate_models import ModelComparison


_COLUMNS = (
    "convention", "strain", "stress", "displacement", "force", "length", "diameter", "layout",
)  # fmt: skip
"""Options of a quasi-static test, of those of a homogeneous one."""


def _given(columns: Columns, time: str, bulge: str) -> dict[str, str]:
    """Declared columns by quantity. Raises InputError if they are not a test."""
    names = ("strain", "stress", "displacement", "force")
    given = {name: column for name in names if (column := getattr(columns, name))}
    pair = {"strain", "stress"} if columns.stress else {"displacement", "force"}
    if set(given) != pair:
        raise texts.refusal(
            "a test needs --strain and --stress, or --displacement and --force",
            cure="name two columns, or give their numbers",
        )
    if "force" in pair and columns.length is None:
        raise texts.refusal(
            "--displacement and --force need --diameter and --length", cure="give the size of the specimen"
        )
    return given | {name: column for name, column in (("time", time), ("bulge", bulge)) if column}


def _specimen_of(diameter: float | None, length: float | None) -> "Specimen | None":
    """Undeformed size of the specimen, if given."""
    from kolsky.base.apparatus import Specimen

    if diameter is None and length is None:
        return None
    if diameter is None or length is None:
        raise texts.refusal(
            "needs both --diameter and --length or neither", cure="give both, or leave both out"
        )
    return Specimen(diameter=diameter, length=length, density=0.0)


def ends_of(text: str, sigma: float) -> "EndFriction | None":
    """ "bonded" or "0.3" as contact at the ends of the specimen."""
    from kolsky.material.end_friction.problem import EndFriction

    number = None
    if text not in ("none", "bonded", "rough", "free"):
        try:
            number = float(text)
        except ValueError:
            texts.one_of("--friction", text, ("none", "bonded", "rough", "free", "a number"))
    if number is None and sigma > 0.0:
        raise texts.refusal(
            "--friction-sigma goes with a number as --friction",
            cure="give --friction NUMBER, or leave --friction-sigma out",
        )
    if text == "none":
        return None
    if text in ("bonded", "rough"):
        return EndFriction("bonded" if text == "bonded" else "rough")
    return EndFriction("coulomb", number, sigma)


def _toe_of(option: str, text: str) -> "Toe":
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
        expected = "none, or line:LOW:HIGH or gaussian:LOW:HIGH with strains, e.g. gaussian:0.03:0.12"
        raise texts.unreadable(option, text, expected) from None
    return Toe("line" if kind == "line" else "gaussian", low, high)


def _units_of(given: Sequence[str], columns: dict[str, str]) -> dict[str, str]:
    """["Load=N"] as units by column."""
    units = {}
    for text in given:
        column, equals, unit = text.rpartition("=")
        if not equals or column not in columns.values():
            raise texts.refusal(f"--unit {text!r} names no column that is read", cure="write COLUMN=UNIT")
        units[column] = unit
    return units


def reference_curve(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Repeats of one test.")],
    branch: Annotated[str, Option("compression or tension.")],
    *,
    columns: Annotated[Columns, _COLUMNS],
    time: Annotated[str, Option("The time.", metavar="COLUMN")] = "",
    bulge: Annotated[str, Option("The radius at mid-height, fitted with the force.", metavar="COLUMN")] = "",
    unit: Annotated[
        tuple[str, ...],
        Option("Unit of a column; repeat for more.", metavar="COLUMN=UNIT", show_default="found in the file"),
    ] = (),
    compliance: Annotated[
        float | None,
        Option('Compliance of machine and load cell, e.g. "0.2 um/N".', unit="m/N", show_default="none"),
    ] = None,
    toe: Annotated[
        Any,
        Option(
            "line or gaussian, continued from these strains to zero.",
            metavar="none|KIND:LOW:HIGH",
            read=_toe_of,
            show_default="none",
        ),
    ] = None,
    friction: Annotated[
        str,
        Option("Contact at the ends: none, bonded, rough, Coulomb's coefficient, or free (with --bulge)."),
    ] = "none",
    friction_sigma: Annotated[float, Option("Standard uncertainty of that coefficient.", min=0.0)] = 0.0,
    bulge_sigma: Annotated[
        float | None, Option('Standard deviation of the radius, e.g. "5 um".', unit="m", positive=True)
    ] = None,
    scale_sigma: Annotated[
        float,
        Option(
            "Relative standard uncertainty of force and section, common to all tests.",
            unit="1",
            show_default="0 %",
        ),
    ] = 0.0,
    poisson: Annotated[
        float, Option("Poisson's ratio of the shot, for the friction.", min=0.0, max=0.4999)
    ] = 0.499,
    points: Annotated[int, Option("Points of the curve.", min=8, max=10000)] = 60,
    last: Annotated[
        float | None,
        Option("Largest strain of the curve.", name="last-strain", show_default="the tests' end"),
    ] = None,
    conditioned: Annotated[
        bool, Option("Also write a curve of the last loading ramp of each record.")
    ] = False,
    out: Annotated[Path, Option("File of the curve.", metavar="FILE.csv")] = Path("curve.csv"),
    figures: Figures = (),
) -> None:
    """Average quasi-static tests to the curve of the material: toe, machine, scatter, end friction.

    Writes the curve with its uncertainties, E_a over strain and time, and the table for shot.toml.
    """
    if out.suffix != ".csv":
        raise texts.refusal("is not a table", key="--out", value=str(out), allowed="FILE.csv")
    from kolsky.material import reference_curve as curves
    from kolsky.material.end_friction.problem import CorrectionNumerics
    from kolsky.material.fits.homogeneous_test import CONVENTIONS
    from kolsky.material.uniaxial import Toe

    folder = usable_folder(out.parent)
    if friction == "free" and not bulge:
        raise texts.refusal(
            "--friction free needs --bulge: the radius at mid-height finds the friction",
            cure="measure the radius at mid-height and give it with --bulge",
        )
    if (bulge != "") != (bulge_sigma is not None):
        raise texts.refusal("--bulge and --bulge-sigma belong together", cure="give both")
    size = _specimen_of(columns.diameter, columns.length)
    cure = "correct the option; `kolsky material reference-curve --help` shows each"
    with texts.refused(cure=cure):
        treatment = curves.Treatment(
            toe=toe or Toe(),
            compliance=compliance or 0.0,
            scale_sigma=scale_sigma,
            specimen=size,
            ends=ends_of(friction, friction_sigma),
            bulge_sigma=bulge_sigma or 0.0,
            points=points,
            last=last,
            numerics=CorrectionNumerics(poisson=poisson),
        )
    texts.one_of("--convention", columns.convention, CONVENTIONS)
    texts.one_of("--branch", branch, curves.BRANCHES)
    given = _given(columns, time, bulge)
    units = _units_of(unit, given)
    tests, hashes = [], {}
    for path in files:
        test, digest = curves.read_uniaxial_test(
            path,
            given,
            convention=columns.convention,
            branch=branch,
            units=units,
            layout=columns.layout,
            specimen=size,
        )
        if str(path) in hashes:
            raise InputError(path, "is named twice", cure="name every test once")
        hashes[str(path)] = digest
        tests.append(test)
    pulls: tuple[Pull, ...] = ("first", "conditioned") if conditioned else ("first",)
    with texts.refused(cure=cure):
        made = {pull: curves.reference_curve(tests, treatment, pull=pull) for pull in pulls}
    names = {"first": out.stem, "conditioned": f"{out.stem}_conditioned"}
    other = f"{names['conditioned']}.csv" if conditioned else None
    first = made["first"]
    table = curves.curve_table(out.name, first.band, compression=first.compression, conditioned=other)
    written: dict[str, Any] = {f"{out.stem}.toml": table}
    tables: dict[str, Any] = {}
    for pull, curve in made.items():
        name = names[pull]
        tables |= {name: curves.curve_columns(curve), f"{name}_modulus": curves.modulus_columns(curve)}
        written |= figure_files(figures, curve, name=f"{name}_figures")
    write_folder(folder, written, tables)
    rows: dict[str, Any] = {}
    for pull, curve in made.items():
        rows |= _curve_rows(curve, f"{pull}: " if conditioned else "")
    content: dict[str, Any] = {
        "inputs": hashes,
        "curves": {pull: curves.summary(curve) for pull, curve in made.items()},
    }
    if conditioned:
        with texts.refused(cure=cure):
            ratio, sigma = curves.softening(made["first"], made["conditioned"])
        content["softening"] = {"value": ratio, "sigma": sigma if isfinite(sigma) else None}
        doubt = f"± {2.0 * sigma:.2g} (k = 2)" if isfinite(sigma) else "(one specimen: no interval)"
        rows["conditioned / first stress"] = f"{ratio:.4g} {doubt}, each specimen with itself"
    print_result(
        rows,
        content,
        files={"curve": out, "for shot.toml": folder / f"{out.stem}.toml"},
        warnings=list(dict.fromkeys(remark for curve in made.values() for remark in curve.remarks)),
    )


def _curve_rows(made: "ReferenceCurve", before: str) -> dict[str, Any]:
    """Printed rows of a curve. Every name begins with `before`."""
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
        tuple[Path, ...],
        Option("An identified shot to compare with them; repeat.", name="shot", metavar="SHOT"),
    ] = (),
    branches: Annotated[int, Option("Most branches of the Prony series.", min=0, max=8)] = 3,
    out: OutFolder = Path("relaxation"),
    figures: Figures = (),
) -> None:
    """Fit a Prony series; compare relaxation, oscillation (DMA), temperature sweeps and shots over time.

    Compares elastic, Prony and Bergstrom-Boyce models by AICc and BIC, and states which the data choose.
    Writes relaxation.html, relaxation.json and CSV tables.
    """
    from kolsky.inverse.slow_tests import read_slow_list
    from kolsky.report.pages.material import render_relaxation
    from kolsky.studies.rate_dependence import analyse_rate_dependence, summary, tables
    from kolsky.studies.rates.rate import collected_shot

    slow = read_slow_list(tests)
    folder = usable_folder(out)
    rated = [collected_shot(shot, group="all") for shot in shots]
    with refused(tests, cure="correct the list or the tables that it names"):
        result = analyse_rate_dependence(slow, rated, at_most=branches)
    content = {"inputs": dict(slow.files), **summary(result)}
    files = {"relaxation.json": content, "relaxation.html": render_relaxation(result, dict(slow.files))}
    write_folder(folder, files | figure_files(figures, result), tables(result))
    print_result(
        _relaxation_rows(result),
        content,
        files={"report": folder / "relaxation.html"},
        warnings=result.remarks,
    )


def _comparison_rows(found: "ModelComparison") -> dict[str, str]:
    """Printed rows of a comparison of models."""
    from kolsky.studies.rate_models import comparison_table

    table = comparison_table(found)
    rows = {"model": found.sentence}
    for k, name in enumerate(table["model"]):
        doubt = f", {table['doubt'][k]}" if table["doubt"][k] else ""
        rows[f"  {name}"] = (
            f"{table['parameters'][k]} parameters, AICc {table['AICc over the least (1)'][k]:+.1f}, BIC"
            f" {table['BIC over the least (1)'][k]:+.1f}, weight {table['weight (1)'][k]:.2g}{doubt}"
        )
    return {**rows, **{f"  {name}": f"not compared: {why}" for name, why in found.left_out.items()}}


def _relaxation_rows(result: "SlowDynamics") -> dict[str, Any]:
    """Printed rows."""
    from kolsky.report.pages.material import relaxation_tables
    from kolsky.results.numbers import row_lines

    fit = result.fit
    low, high = fit.interval("factor")
    E, factor = 1e-3 * result.young, float(fit.values[0])
    rows: dict[str, Any] = {
        "verdict": result.sentence,
        **_comparison_rows(result.comparison),
        "long-term E": f"{E:.4g} kPa, {E * low / factor:.4g} to {E * high / factor:.4g} (k = 2)",
    }
    for table in relaxation_tables(result).values():
        rows |= row_lines(table)
    return rows
