"""`kolsky material fit` and `healing`: laws fitted to homogeneous tests, healing efficiencies."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from kolsky.base.apparatus import Specimen
from kolsky.base.errors import InputError
from kolsky.base.files import columns_of, jsonable, usable_folder, write_folder
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.options import Figures, OutFolder
from kolsky.cli.terminal import print_result, progress_bars
from kolsky.material.fits.columns import Columns
from kolsky.report.figures_alone import figure_files

if TYPE_CHECKING:
    from kolsky.material.end_friction.problem import ModelFit
    from kolsky.material.fits.compare import Comparison
    from kolsky.material.fits.homogeneous import Mode
    from kolsky.material.fits.homogeneous_test import HomogeneousTest
    from kolsky.material.fits.properties import Healing


_DEFAULT_LAWS = ("neo_hookean", "reduced_polynomial", "yeoh", "mooney_rivlin_2", "ogden1")
"""Default laws if none is named. A single compression test may determine them."""

_POINTS = 40
"""Largest number of points of the mean curve for the comparison with the simulated cylinder."""
_SAME_SIZE = 1e-3
"""Relative difference up to which two sizes of one specimen are equal [-]. One of them has fewer digits."""


def size_of(option: str, text: str) -> Specimen:
    """ "9.5 mm x 6.5 mm" as the undeformed size of a cylinder."""
    diameter, cross, length = text.partition(" x ")
    if not cross:
        raise texts.unreadable(option, text, '"9.5 mm x 6.5 mm"')
    return Specimen(
        diameter=texts.physical(option, diameter, "m", positive=True),
        length=texts.physical(option, length, "m", positive=True),
        density=0.0,
    )


def with_size(columns: Columns, size: Specimen) -> Columns:
    """The columns with the size of a cylinder. A size declared with the columns must agree."""
    for option, given, declared, unit in (
        ("--length", columns.length, size.length, "m"),
        ("--area or --diameter", columns.section, size.area, "m^2"),
    ):
        if given is not None and abs(given / declared - 1.0) > _SAME_SIZE:
            raise texts.refusal(
                f"{option} gives {given:.6g} {unit}, --specimen {declared:.6g} {unit}",
                cure=f"leave {option} out: the size of --specimen is taken",
            )
    return replace(columns, length=size.length, area=size.area, diameter=None)


def _fit_cylinder_with_friction(
    tests: Sequence["HomogeneousTest"],
    *,
    size: Specimen,
    ends: str,
    laws: tuple[str, ...],
    poisson: float | None,
    hashes: dict[str, str],
    folder: Path,
    taken: Sequence[str],
) -> None:
    """Fit laws to repeats of a compression test with bonded or frictional ends; write and print constants."""
    import numpy as np

    from kolsky.cli.material_curves import ends_of
    from kolsky.material.end_friction.correct import fit_specimen
    from kolsky.material.end_friction.problem import ASSUMED_POISSON_SIGMA, CorrectionNumerics
    from kolsky.material.fits.homogeneous import Mode
    from kolsky.material.reference_curve import FEWEST_POINTS, Treatment, model_summary, reference_curve
    from kolsky.material.uniaxial import UniaxialTest, noise_about_curve

    contact = ends_of(ends, 0.0)
    if contact is None or ends == "free":
        raise texts.refusal("--specimen needs --ends", cure="write bonded, rough or Coulomb's coefficient")
    for test in tests:
        if test.mode is not Mode.UNIAXIAL or test.strain.min() > -1e-9:
            raise texts.refusal(f"{test.name} is not a compression test", cure="leave it out")
    numerics = CorrectionNumerics(poisson_sigma=ASSUMED_POISSON_SIGMA)
    if poisson is not None:
        numerics = CorrectionNumerics(poisson=poisson)
    compressed = [UniaxialTest(t.name, -t.strain, -t.stress, compression=True) for t in tests]
    with texts.refused(cure="correct the option; `--help` shows each with its unit"):
        # With more points than readings, chords between readings would deviate from a curved line.
        points = min(_POINTS, *(int(np.count_nonzero(t.strain)) for t in tests))
        mean = reference_curve(compressed, Treatment(points=max(FEWEST_POINTS, points)))
        band = mean.band
        if len(tests) == 1:
            noise = noise_about_curve(compressed[0].strain, compressed[0].stress, band.strain)
            band = replace(band, noise=noise)
        fits = fit_specimen(band, size, contact, laws or _DEFAULT_LAWS, numerics=numerics)
    ratio = {"value": numerics.poisson, "sigma": numerics.poisson_sigma}
    content = {"inputs": hashes, "ends": ends, "poisson": ratio, "laws": [model_summary(one) for one in fits]}
    fitted = [one for one in fits if not one.reason]
    curves: dict[str, list[Any]] = {
        "nominal strain (1)": mean.band.strain.tolist(),
        "apparent nominal stress (Pa)": mean.band.stress.tolist(),
    }
    curves |= {f"{one.name} without end friction (Pa)": np.asarray(one.stress).tolist() for one in fitted}
    tables = {"specimen_constants": columns_of(_constant_rows(fitted)), "specimen_curves": curves}
    write_folder(folder, {"specimen.json": content}, tables)
    print_result(
        {},
        content,
        lines=[
            *taken,
            *_cylinder_lines(fitted),
            f"  Poisson's ratio {numerics.poisson:.6g} ± {2.0 * numerics.poisson_sigma:.2g} "
            + ("(declared)" if poisson is not None else "(assumed, k = 2; --poisson declares it)"),
        ],
        files={"constants": folder / "specimen_constants.csv"},
        warnings=[
            *mean.remarks,
            *(f"{one.name} has no fit: {one.reason}" for one in fits if one.reason),
            *(one.remark for one in fits if one.remark),
        ],
    )


def _constant_rows(fitted: Sequence["ModelFit"]) -> Iterator[dict[str, Any]]:
    for one in fitted:
        for name, value in one.constants.items():
            yield {
                "law": one.name,
                "constant": name,
                "value (SI)": value,
                "u (SI)": one.sigma[name] if math.isfinite(one.sigma[name]) else "",
                "determined": "no" if name in one.not_determined else "yes",
                "weight of the law": one.weight,
                "misfit (rms)": one.misfit,
            }


def _cylinder_lines(fitted: Sequence["ModelFit"]) -> list[str]:
    """Laws with their constants and the strongest correlation, for a terminal."""
    import numpy as np

    lines = []
    for one in fitted:
        lines.append(f"{one.name}: {100.0 * one.misfit:.2g} % from the test (rms), weight {one.weight:.2g}")
        for name, value in one.constants.items():
            half = 2.0 * one.sigma[name]
            if name in one.not_determined:
                ends = f"{value - half:.3g} to {value + half:.3g} (SI, k = 2)"
                ends = ends if np.isfinite(half) else f"the force does not change with it at {value:.3g} (SI)"
                lines.append(f"  {name} is not determined by this test: {ends}")
            else:
                lines.append(f"  {name} = {value:.5g} ± {half:.2g} (SI, k = 2)")
        off = np.abs(np.triu(one.correlation, 1))
        if off.size > 1 and off.max() > 0.0:
            i, j = np.unravel_index(int(np.argmax(off)), off.shape)
            names = list(one.constants)
            lines.append(f"  correlation of {names[i]} and {names[j]}: {one.correlation[i, j]:+.3f}")
    return lines


def poisson_of(option: str, text: str) -> float | Literal["free"]:
    """ "0.44" as a ratio, "free" as a fitted ratio."""
    if text == "free":
        return "free"
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 <= value <= 0.49999:
        raise texts.refusal("is not a ratio", key=option, value=text, allowed="0 to 0.49999, or free")
    return value


def read_tests(
    files: Sequence[str], columns: Columns, *, mean: int = 0
) -> "tuple[tuple[HomogeneousTest, ...], dict[str, str], tuple[str, ...]]":
    """The tests, the hashes of their files by path, and the columns that were chosen by default.

    ``files``: "MODE:FILE", or a file of a uniaxial test. ``mean``: strains at which the files of a mode are
    averaged. 0 keeps each file as a test with all its points.
    """
    from kolsky.material.fits.homogeneous_test import (
        means_by_mode,
        read_homogeneous_test,
        with_recognised_columns,
        with_unique_names,
    )

    hashes: dict[str, str] = {}
    tests: list[HomogeneousTest] = []
    taken: list[str] = []
    for text in files:
        mode, path = _mode_and_path(text)
        complete, words = with_recognised_columns(path, columns)
        taken += [words] if words else []
        _refuse_columns(path, mode, complete)
        test, hashes[str(path)] = read_homogeneous_test(path, complete, mode=mode)
        tests.append(test)
    if mean:
        with texts.refused("--mean: ", cure="give two files or more of one kind of test"):
            tests = means_by_mode(tests, mean)
    return with_unique_names(tests), hashes, tuple(taken)


def _mode_and_path(text: str) -> "tuple[Mode, Path]":
    """ "planar:FILE" as a mode and a file. A file without a mode is uniaxial."""
    from kolsky.material.fits.homogeneous import Mode, mode_named

    head, colon, path = text.partition(":")
    if colon and path:
        try:
            return mode_named(head), Path(path)
        except ValueError:
            # The part before the colon is a drive of Windows, or a mode that does not exist. Only a drive
            # belongs to a file.
            if len(head) > 1 and not Path(text).exists():
                raise texts.refusal(
                    "is not a mode of deformation",
                    key=text,
                    allowed=", ".join(mode.value.replace(" ", "-") for mode in Mode)
                    + ", then a colon and FILE",
                ) from None
    return Mode.UNIAXIAL, Path(text)


def _refuse_columns(path: Path, mode: "Mode", columns: Columns) -> None:
    """Reject columns that are not enough for a test, or that contradict each other."""
    from kolsky.material.fits.homogeneous import Mode
    from kolsky.material.fits.homogeneous_test import CONVENTIONS
    from kolsky.readers.measured_tables import column_names

    texts.one_of("--convention", columns.convention, CONVENTIONS)
    if columns.stretch and columns.strain:
        raise texts.refusal("--stretch and --strain exclude each other", cure="leave one out")
    if (columns.force != "") != (columns.displacement != ""):
        raise texts.refusal("--force and --displacement belong together", cure="name both")
    if columns.force:
        if mode is not Mode.UNIAXIAL or columns.section is None or columns.length is None:
            raise texts.refusal(
                f"{path}: --force and --displacement are of uniaxial tests; they need --length, and --area or"
                " --diameter",
                cure="give the specimen's undeformed size",
            )
        return
    if not columns.stress or not (columns.stretch or columns.strain):
        columns_of_file = ", ".join(column_names(path, columns.layout))
        raise InputError(
            path,
            f"the columns of the test are not named; the file has the columns of numbers {columns_of_file}",
            cure="name stress and deformation, or give their numbers: --stress COLUMN, and --stretch COLUMN "
            "or --strain COLUMN",
        )
    if mode is Mode.SIMPLE_SHEAR and columns.stretch:
        raise texts.refusal(
            f"{path}: simple shear has no stretch", cure="name the amount of shear with --strain"
        )


def material_fit(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="MODE:FILE...",
            help="Tests of one material: uniaxial:FILE, equibiaxial:FILE, planar:FILE or simple-shear:FILE "
            "(a FILE alone is uniaxial).",
        ),
    ],
    *,
    columns: Columns,
    mean: Annotated[
        int, Option("Average the files of a mode at this number of strains; 0: fit every point.", min=0)
    ] = 0,
    laws: Annotated[str, Option("Laws to try.", metavar="NAMES", show_default="all")] = "",
    weighting: Annotated[
        Literal["absolute", "relative", "sigma"], Option("absolute, relative or sigma.")
    ] = "absolute",
    free_bounds: Annotated[bool, Option("Allow constants with which an energy can become negative.")] = False,
    poisson: Annotated[
        float | Literal["free"] | None,
        Option(
            "Poisson's ratio at rest, or free (with --lateral).",
            metavar="RATIO",
            show_default="incompressible",
            read=poisson_of,
        ),
    ] = None,
    specimen: Annotated[
        Specimen | None,
        Option(
            'Inverse finite elements on a compressed cylinder, e.g. "9.5 mm x 6.5 mm"; needs --ends.',
            metavar="DIAMETER x LENGTH",
            read=size_of,
        ),
    ] = None,
    ends: Annotated[str, Option("Contact at its ends: bonded, rough, or Coulomb's coefficient.")] = "",
    starts: Annotated[int, Option("Starts of each search that are refined.", min=1, max=1000)] = 12,
    seed: Annotated[int, Option("Seed of the starts.", min=0)] = 1,
    out: OutFolder = Path("material"),
    figures: Figures = (),
) -> None:
    """Fit laws to homogeneous tests and compare them: errors, constants, limits of stability.

    Several tests are fitted at once. Writes material.html, material.json and CSV tables.
    """
    from kolsky.material.fits.compare import candidates, compare_laws
    from kolsky.material.fits.search import Weighting
    from kolsky.material.fits.tables import as_json as to_json
    from kolsky.material.fits.tables import remarks, tables
    from kolsky.report.pages.material import render_fits

    with texts.refused("--laws: ", cure="`kolsky material fit --help` lists the laws"):
        chosen = candidates(texts.listed(laws))
    free_poisson = poisson == "free"
    if free_poisson and not columns.lateral:
        raise texts.refusal("--poisson free needs --lateral", cure="name its column")
    ratio = None if isinstance(poisson, str) else poisson
    folder = usable_folder(out)
    if specimen is not None:
        columns = with_size(columns, specimen)
        texts.refuse(
            {
                "--figures": bool(figures),
                "--mean": mean > 0,
                "--weighting": weighting != "absolute",
                "--free-bounds": free_bounds,
                "--poisson free": free_poisson,
                "--lateral": bool(columns.lateral),
            },
            "does not go with --specimen",
            cure="leave it out: repeats are averaged, all laws start from one curve and are free of bounds",
        )
    tests, hashes, taken = read_tests(files, columns, mean=mean)
    if specimen is not None:
        _fit_cylinder_with_friction(
            tests,
            size=specimen,
            ends=ends,
            laws=texts.listed(laws),
            poisson=ratio,
            hashes=hashes,
            folder=folder,
            taken=taken,
        )
        return
    texts.refuse({"--ends": bool(ends)}, "goes with --specimen", cure="give the cylinder's size")
    if weighting == "sigma" and any(test.sigma is None for test in tests):
        raise texts.refusal(
            "--weighting sigma needs tests with a scatter",
            cure="give repeats and --mean, or weight absolute or relative",
        )
    with progress_bars() as progress:
        comparison = compare_laws(
            chosen,
            tests,
            weighting=Weighting(weighting),
            bounded=not free_bounds,
            poisson=ratio,
            free_poisson=free_poisson,
            starts=starts,
            seed=seed,
            progress=lambda done: progress("laws", done, len(chosen)),
        )
    if all(row.fit is None for row in comparison.rows):
        reasons = "; ".join(row.reason for row in comparison.rows)
        raise texts.refusal(f"no law can be fitted: {reasons}", cure="give more points or more kinds of test")
    content, warnings = to_json(comparison, hashes), remarks(comparison)
    written: dict[str, Any] = {
        "material.json": content,
        "material.html": render_fits(comparison, hashes, warnings),
    }
    write_folder(folder, written | figure_files(figures, comparison), tables(comparison))
    print_result(
        {},
        content,
        lines=[*taken, *_lines(comparison)],
        files={"report": folder / "material.html"},
        warnings=warnings,
    )


def _lines(comparison: "Comparison") -> list[str]:
    """The tables of laws, least AIC first, and of the constants of the best one."""
    from kolsky.report.pages.material import constant_rows, law_rows
    from kolsky.results.numbers import table_lines

    lines, best = table_lines(law_rows(comparison)), comparison.best
    if best is not None and best.fit is not None:
        f = best.fit
        lines += ["", "least BIC of those determined and stable over the data:"]
        lines += table_lines(constant_rows(best, f))
        if f.poisson is not None:
            half = f" ± {2.0 * f.sigma['poisson']:.2g} (k = 2)" if "poisson" in f.free else ""
            lines.append(
                f"  Poisson's ratio {f.poisson:.4g}{half}, K = {f.bulk_modulus:.4g} Pa, D1 = {f.D1:.4g} 1/Pa"
            )
    return lines


TENSILE = Columns(convention="tension-positive")


def material_healing(
    undamaged: Annotated[list[str], Option("Tensile test of an undamaged specimen; repeat.", metavar="FILE")],
    healed: Annotated[list[str], Option("Tensile test of a healed specimen; repeat.", metavar="FILE")],
    *,
    columns: Columns = TENSILE,
    law: Annotated[str, Option("Law whose constants are compared.")] = "neo_hookean",
    poisson: Annotated[
        float | None,
        Option("Poisson's ratio at rest.", metavar="RATIO", show_default="incompressible", read=poisson_of),
    ] = None,
    out: OutFolder = Path("healing"),
) -> None:
    """Healing efficiencies of modulus, constants, fracture stress and strain, with their uncertainties.

    Writes healing.json and healing.csv, and healing_specimens.csv with every specimen's properties.
    """
    from explicit.materials import LAWS
    from kolsky.material.fits.properties import healing

    texts.one_of("--law", law, tuple(LAWS))
    texts.refuse({"--poisson free": poisson == "free"}, "needs a lateral strain", cure="give a number")
    folder = usable_folder(out)
    groups = [read_tests(files, columns) for files in (undamaged, healed)]
    repeated = set(groups[0][1]) & set(groups[1][1])
    if repeated:
        raise InputError(sorted(repeated)[0], "is named as undamaged and as healed", cure="name it once")
    with texts.refused(cure="correct the option; `kolsky material healing --help` shows each"):
        result = healing(groups[0][0], groups[1][0], law=law, poisson=poisson)
    content: dict[str, Any] = {
        "inputs": {"undamaged": groups[0][1], "healed": groups[1][1]},
        "law": law,
        "properties": {
            name: {**jsonable(asdict(row), name), "unit": result.units[name]}
            for name, row in result.rows.items()
        },
        "specimens": {"undamaged": result.undamaged, "healed": result.healed},
        "remarks": list(result.remarks),
    }
    each = (
        {"group": group, "specimen": specimen, "property": name, "value (SI)": value}
        for group, specimens in content["specimens"].items()
        for specimen, values in specimens.items()
        for name, value in values.items()
    )
    tables = {"healing": columns_of(_healing_rows(result)), "healing_specimens": columns_of(each)}
    write_folder(folder, {"healing.json": content}, tables)
    print_result(
        {},
        content,
        lines=[*groups[0][2], *groups[1][2], *_material_healing_lines(result)],
        files={"table": folder / "healing.csv"},
        warnings=result.remarks,
    )


def _healing_rows(result: "Healing") -> Iterator[dict[str, Any]]:
    for name, row in result.rows.items():
        cells = {
            "property": name,
            "unit": result.units[name],
            "undamaged": row.undamaged.value,
            "u undamaged": row.undamaged.sigma,
            "healed": row.healed.value,
            "u healed": row.healed.sigma,
            "healing efficiency (1)": row.efficiency.value,
            "u efficiency (1)": row.efficiency.sigma,
        }
        yield jsonable(cells, name)


def _material_healing_lines(result: "Healing") -> list[str]:
    """The table for a terminal."""
    lines = [f"{'property':<24}{'undamaged':>12}{'healed':>12}  efficiency"]
    for name, row in result.rows.items():
        u = row.efficiency.sigma
        spread = f" ± {200.0 * u:.2g} % (k = 2)" if math.isfinite(u) else " %, scatter unknown"
        lines.append(
            f"{name:<24}{row.undamaged.value:>12.4g}{row.healed.value:>12.4g}"
            f"  {100.0 * row.efficiency.value:.4g}{spread}  [{result.units[name]}]"
        )
    return lines
