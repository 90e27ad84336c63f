"""`kolsky waves`: from the bar signals of a shot to curves, files and a page."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from kolsky.commands import options
from kolsky.commands.parts import tell
from kolsky.errors import InputError
from kolsky.outfolder import filling, usable_folder
from kolsky.progress import bars
from kolsky.report.formats import FIGURES
from kolsky.shotfiles.bars import AnyFile
from kolsky.shotfiles.reading import read_declared
from kolsky.shots import find_shot_file, folder_of, load_shot
from kolsky.shots.bars import load_waves
from kolsky.waves.chain import analyse
from kolsky.waves.output import summary, write_csv, write_hdf5
from kolsky.waves.result import FlyerResult, ReducedTest, WavesResult


def waves(shot: Path, *, out: Path | None, formats: Sequence[str], as_json: bool) -> None:
    """Reduce, write and print.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    out
        Where results go; by default the folder "results" of the shot.
    formats
        Also save the figure alone, in these formats.
    as_json
        Print one JSON object instead of a table.

    Raises
    ------
    InputError
        If the shot or its files cannot be used, or results cannot be written.
    """
    started = perf_counter()
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    place = out or folder_of(shot) / "results"
    result = _reduced(shot, usable_folder(place))
    folder = usable_folder(place)
    from kolsky.report.canvas import save_figures
    from kolsky.report.wavespage import answers, figures_of, quantity, write_page

    with filling(folder) as partial:
        write_hdf5(partial / "waves.h5", result)
        write_csv(partial, result)
        write_page(partial / "waves.html", result)
        if formats:
            save_figures(partial / "figures", result, formats=tuple(formats), registry=figures_of(result))
    rows = {
        "shot": result.name,
        **{
            row["name"]: f"{row['value']} ± {row['U']} {row['unit']}".rstrip() + " (k = 2)"
            for row in answers(result)
        },
        "balanced": "never"
        if result.reduction.balanced is None
        else "{:.4g} to {:.4g} µs".format(*(1e6 * t for t in result.reduction.balanced)),
        **_own(result),
        **{name: quantity(value, unit) for name, (value, unit) in result.facts.items()},
    }
    tell(
        [],
        rows,
        summary(result) if as_json else None,
        rest={
            "result": folder / "waves.h5",
            "page": folder / "waves.html",
            "wall time": f"{perf_counter() - started:.1f} s",
        },
        warnings=result.remarks,
    )


def _reduced(shot: Path, folder: Path) -> ReducedTest:
    """The test by its bars' gauges or, if it has none, by its flyer."""
    content = read_declared(find_shot_file(shot), lambda content: AnyFile)[0].content
    with bars() as progress:
        try:
            if "gauges" in content:
                return analyse(load_waves(shot), progress=progress)
            from kolsky.flyer.classical import analyse_flyer
            from kolsky.measure import measured
            from kolsky.shots.flyer import load_flyer_test

            loaded = load_shot(shot, measure=lambda seen: measured(seen, folder, progress=progress))
            return analyse_flyer(load_flyer_test(shot, loaded), progress=progress)
        except ValueError as error:
            raise InputError(folder_of(shot), str(error)) from error


def _own(result: ReducedTest) -> dict[str, str]:
    """Rows of one kind of test."""
    if isinstance(result, WavesResult):
        return {"windows": f"by {result.windows.source}"}
    assert isinstance(result, FlyerResult)  # there is no third kind
    rows = {
        name: "not found: " + how if at is None else f"{1e3 * at:.4f} ms"
        for name, at, _, how in result.events
        if name != "end of symmetry"
    }
    return {**rows, "validity": result.validity, "clocks": result.synchronisation or "no incident transducer"}
