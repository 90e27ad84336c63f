"""`kolsky material fit`: laws fitted to homogeneous tests, compared, written and printed."""

import json
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from kolsky.base.errors import InputError
from kolsky.base.files import filling, replacing, usable_folder, write_table
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.cli.work.materialfiles import Columns, read_tests
from kolsky.cli.work.parts import since, tell
from kolsky.material.fits.compare import Comparison, candidates, compare_laws
from kolsky.material.fits.fit import FitOutcome
from kolsky.material.fits.residuals import Weighting
from kolsky.material.fits.tables import as_json as to_json
from kolsky.material.fits.tables import failure, tables
from kolsky.report.formats import FIGURES

__all__ = ["Columns", "fit_laws"]

CORRELATED = 1.0
"""Durbin-Watson number below which residuals follow each other too closely to count as independent."""


def fit_laws(
    files: Sequence[str],
    *,
    columns: Columns,
    mean: int,
    laws: Sequence[str],
    weighting: str,
    bounded: bool,
    poisson: float | None,
    starts: int,
    seed: int,
    out: Path,
    formats: Sequence[str],
    as_json: bool,
) -> None:
    """Read, fit, write and print.

    Parameters
    ----------
    files, columns, mean
        See `kolsky.cli.work.materialfiles.read_tests`.
    laws
        Names of laws, all if there are none.
    weighting, bounded, poisson, starts, seed
        See `kolsky.material.fits.fit.fit_law`.
    out
        Where results go.
    formats
        Also save each figure, in these formats.
    as_json
        Print one JSON object instead of a table.

    Raises
    ------
    InputError
        If a file or option cannot be used, no law can be fitted, or results cannot be written.
    """
    started = perf_counter()
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    options.one_of("--weighting", weighting, tuple(kind.value for kind in Weighting))
    try:
        tried = candidates(laws)
    except ValueError as error:
        raise InputError(options.COMMAND_LINE, f"--laws: {error}") from None
    folder = usable_folder(out)
    tests, hashes = read_tests(files, columns, mean=mean)
    if weighting == "sigma" and any(test.sigma is None for test in tests):
        raise InputError(
            options.COMMAND_LINE,
            "--weighting sigma needs tests with a scatter",
            cure="give repeats and --mean, or weight absolute or relative",
        )
    with bars() as progress:
        found = compare_laws(
            tried,
            tests,
            weighting=Weighting(weighting),
            bounded=bounded,
            poisson=poisson,
            starts=starts,
            seed=seed,
            progress=lambda done: progress("laws", done, len(tried)),
        )
    if all(row.fit is None for row in found.rows):
        reasons = "; ".join(row.reason for row in found.rows)
        raise InputError(options.COMMAND_LINE, f"no law can be fitted: {reasons}")
    said = to_json(found, hashes)
    from kolsky.report.canvas import save_figures
    from kolsky.report.figures import MATERIALS
    from kolsky.report.pages.material import write_page

    with filling(folder) as partial:
        for name, table in tables(found).items():
            write_table(partial / f"{name}.csv", table)
        with replacing(partial / "material.json") as file:
            file.write_text(json.dumps(said, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        write_page(partial / "material.html", found, hashes, remarks(found))
        if formats:
            save_figures(partial / "figures", found, formats=tuple(formats), registry=MATERIALS)
    tell(
        _lines(found),
        {},
        said if as_json else None,
        rest={"report": folder / "material.html", "wall time": since(started)},
        warnings=remarks(found),
    )


def remarks(found: Comparison) -> list[str]:
    """What to know before using the numbers."""
    said = [f"{row.candidate.name} has no fit: {row.reason}" for row in found.rows if row.fit is None]
    best = found.best
    if best is None or best.fit is None:
        return [*said, "no law is determined by these tests and stable over them"]
    first = found.rows[0]
    if first is not best:
        why = "is not stable over the data" if not first.stable else "has a higher BIC"
        if first.fit is not None and first.fit.outcome is FitOutcome.NOT_DETERMINED:
            why = "has constants that the data do not tell apart"
        said.append(f"{first.candidate.name} has the least AIC, but {why}")
    if best.fit.durbin_watson < CORRELATED:
        said.append(
            f"residuals of {best.candidate.name} follow each other (Durbin-Watson "
            f"{best.fit.durbin_watson:.2g}): it misses the curve's shape, and the u of its constants, which "
            "take every point as new, are too small"
        )
    first_failure = best.first_failure
    if first_failure is not None:
        said.append(f"{best.candidate.name} beyond the data: {first_failure}")
    return said


def _lines(found: Comparison) -> list[str]:
    """The table for a terminal of 80 columns and more, least AIC first."""
    best = found.best
    lines = [f"{'':2}{'law':<19}{'E0 (kPa)':>9}{'RMSE (kPa)':>11}{'R2':>9}{'AIC':>9}  stability"]
    for row in found.rows:
        f = row.fit
        if f is None:
            continue
        mark = "*" if row is best else "?" if f.outcome is FitOutcome.NOT_DETERMINED else " "
        lines.append(
            f"{mark} {row.candidate.name:<19}{1e-3 * f.youngs_modulus:>9.4g}{1e-3 * f.rmse:>11.4g}"
            f"{f.r_squared:>9.5f}{f.aic:>9.1f}  {failure(row)}"
        )
    lines.append("* least BIC of those determined and stable over the data; ? constants not determined")
    if best is not None and best.fit is not None:
        for spec in best.fit.law.PARAMETERS:
            if spec.name in best.fit.free:
                value, u = best.fit.values[spec.name], best.fit.sigma[spec.name]
                unit = "" if spec.unit == "1" else f" {spec.unit}"
                lines.append(f"  {spec.name} = {value:.5g} ± {2.0 * u:.2g}{unit} (k = 2)")
    return lines
