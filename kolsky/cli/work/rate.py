"""`kolsky rate`: several identified shots to their stiffness against strain rate."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from kolsky.base.errors import InputError
from kolsky.base.files import filling, usable_folder
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.cli.work.parts import tell
from kolsky.report import numbers
from kolsky.report.formats import FIGURES
from kolsky.report.printed import plain
from kolsky.shot.records import Shot
from kolsky.studies.rates.collect import result_of
from kolsky.studies.rates.output import summary, write_csv, write_hdf5
from kolsky.studies.rates.rate import Identify
from kolsky.studies.rates.rate import rate as compared
from kolsky.studies.rates.records import GroupRates, RateReport


def rate(
    shots: Sequence[Path],
    *,
    group: str,
    strains: Sequence[float],
    shared: float,
    identify: bool,
    out: Path,
    formats: Sequence[str],
    as_json: bool,
) -> None:
    """Collect, compare, write and print.

    Parameters
    ----------
    shots
        Shots' folders, or their shot.toml files.
    group
        Key of the shot files to group by; "" takes `group` or `material` where a shot has it.
    strains
        Nominal compressive strains of the tables.
    shared
        Relative standard uncertainty common to all stiffness factors.
    identify
        Identify shots that have no result yet, with the default settings.
    out
        Where results go.
    formats
        Also save the figures, in these formats.
    as_json
        Print one JSON object instead of a table.

    Raises
    ------
    InputError
        If a shot has no result or cannot be used, two have one name, or results cannot be written.
    """
    started = perf_counter()
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    folder = usable_folder(out)
    with bars() as progress:
        try:
            report = compared(
                shots,
                group=group,
                strains=strains,
                shared=shared,
                identify=_identified(progress) if identify else None,
                progress=progress,
            )
        except ValueError as error:
            raise InputError(options.COMMAND_LINE, str(error)) from error
    _write(folder, report, formats)
    rows = {k: v for g in report.groups for k, v in _rows(g, several=len(report.groups) > 1).items()}
    tell(
        [],
        rows,
        summary(report) if as_json else None,
        rest={
            "result": folder / "rates.h5",
            "page": folder / "rates.html",
            "wall time": f"{perf_counter() - started:.1f} s",
        },
        warnings=[remark for g in report.groups for remark in g.remarks],
    )


def _write(folder: Path, report: RateReport, formats: Sequence[str]) -> None:
    from kolsky.report.canvas import save_figures
    from kolsky.report.pages.rates import figures_of, write_page

    with filling(folder) as partial:
        write_hdf5(partial / "rates.h5", report)
        write_csv(partial, report)
        write_page(partial / "rates.html", report)
        if formats:
            for index, group in enumerate(report.groups):
                registry = figures_of(report, index)
                save_figures(partial / "figures", group, formats=tuple(formats), registry=registry)


def _identified(progress: Any) -> Identify:
    """How a shot without a result gets one, with the files that `kolsky identify` writes."""

    def identify(shot: Path, loaded: Shot) -> Any:
        from kolsky.cli.work.identify import write_identified
        from kolsky.identification import identify as inverse

        folder = usable_folder(result_of(shot).parent)
        try:
            found = inverse(loaded, progress=progress)
        except ValueError as error:
            raise InputError(loaded.folder, str(error)) from error
        write_identified(folder, found, loaded, shot)
        return found

    return identify


def _rows(group: GroupRates, *, several: bool) -> dict[str, str]:
    """The lines that a terminal gets of one group."""
    prefix = f"{group.name}: " if several else ""
    rows = {f"{prefix}shots": f"{len(group.counted)} of {len(group.shots)} counted"}
    for shot in group.shots:
        value, U = numbers.measured(shot.m, 2.0 * shot.sigma)
        rows[f"{prefix}{shot.name}"] = (
            f"m = {plain(value)} ± {plain(U)} (k = 2) at {shot.history.nominal_rate:.4g} 1/s"
        )
    if group.pooled is not None:
        low, high = group.pooled.interval
        value, half = numbers.measured(group.pooled.mean, 0.5 * (high - low))
        rows[f"{prefix}mean m"] = f"{plain(value)} ± {plain(half)} (95 %)"
        rows[f"{prefix}scatter between shots"] = f"{group.pooled.fit.between:.2g}"
        rows[f"{prefix}U = 2s"] = f"{2.0 * group.pooled.scatter:.2g}"
    line = group.slope
    if line is not None:
        rows[f"{prefix}slope"] = line.verdict.value
        for number, reason in enumerate(line.reasons, start=1):
            rows[f"{prefix}because {number}"] = reason
        if line.fit is not None:
            low, high = line.fit.interval(1)
            said = "would show" if line.reasons else "line"
            middle = float(line.fit.coefficients[1])
            rows[f"{prefix}{said}"] = f"{middle:.3g} per decade, 95 % {low:.3g} to {high:.3g}"
    if group.long_lever is not None:
        lever = group.long_lever
        rows[f"{prefix}from quasi-static"] = (
            f"{lever.slope:.2g} per decade, 95 % {lever.interval[0]:.2g} to {lever.interval[1]:.2g}"
        )
    return rows
