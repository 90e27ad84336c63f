"""`kolsky plan`: where and when to measure, and the uncertainty of the parameters to expect."""

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.options import Out, ShotPath, Values
from kolsky.inverse.settings import Numerics


def _frame_interval(option: str, text: str) -> float:
    """ "120 kHz" as time between pictures [s]."""
    return 1.0 / texts.physical(option, text, "1/s", positive=True)


def _window(option: str, text: str) -> tuple[float, float]:
    """ "0 ms:1.2 ms" as start and end [s]."""
    ends = text.split(":")
    if len(ends) != 2:
        raise texts.refusal(f"{option} {text!r} cannot be read", cure='write START:END, e.g. "0 ms:1.2 ms"')
    start, end = (texts.physical(option, part, "s") for part in ends)
    return start, end


def _heights(option: str, text: str) -> tuple[int, ...]:
    """ "1,3,5" as numbers of heights."""
    counts = texts.numbers(option, text)
    if not counts or any(count != round(count) or count < 1.0 for count in counts):
        raise texts.refusal(
            "must be whole numbers from 1",
            key=option,
            value=text,
            cure="write them with commas, e.g. --heights 1,3,5",
        )
    return tuple(int(count) for count in counts)


def _without_bounds(text: str) -> str:
    """Name of a free parameter, which has no bounds in a plan."""
    if "=" in text:
        raise texts.refusal(
            f"--free {text!r}: a plan has no bounds",
            cure=f"write --free {text.partition('=')[0]}, and its value with -p",
        )
    return text


@dataclass(frozen=True)
class _Instruments:
    """Changes of the shot's instruments."""

    outline_sigma: Annotated[
        float | None, Option('Noise of an outline point, e.g. "4 um".', unit="m", show_default="the shot's")
    ] = None
    force_sigma: Annotated[
        float | None,
        Option('Noise of the mean force of a bin, e.g. "0.1 N".', unit="N", show_default="the shot's"),
    ] = None
    frame_interval: Annotated[
        float | None,
        Option(
            'Frame rate, e.g. "120 kHz".', name="frame-rate", read=_frame_interval, show_default="the shot's"
        ),
    ] = None
    points: Annotated[
        float | None,
        Option(
            'Independent outline points per height, e.g. "3.6 1/mm".', unit="1/m", show_default="the shot's"
        ),
    ] = None
    clearance: Annotated[
        float | None,
        Option(
            'Heights near a platen that the camera does not see, e.g. "0.3 mm".',
            unit="m",
            show_default="the shot's",
        ),
    ] = None
    window: Annotated[
        tuple[float, float] | None,
        Option(
            'Time window, e.g. "0 ms:1.2 ms".', metavar="START:END", read=_window, show_default="the shot's"
        ),
    ] = None


def plan(
    shot: ShotPath,
    *,
    free: Annotated[
        tuple[str, ...],
        Option(
            "Parameter to be estimated together with the others; repeat for more.",
            metavar="NAME",
            show_default="stiffness_factor, poisson, damping",
        ),
    ] = (),
    parameter: Values,
    instruments: _Instruments,
    rates: Annotated[
        list[float] | None,
        Option(
            "Flyer speeds to compare, relative to the shot's.",
            metavar="FACTORS",
            read=texts.numbers,
            show_default="0.5,1,2",
        ),
    ] = None,
    heights: Annotated[
        tuple[int, ...], Option("Numbers of best heights to choose.", metavar="NUMBERS", read=_heights)
    ] = (1, 2, 3),
    discrepancy: Annotated[
        Literal["mesh", "none"], Option("Model error: the change to a finer mesh (mesh), or none.")
    ] = "mesh",
    reach: Annotated[
        float, Option("Range of the slopes over the parameters' scales.", min=0.001, max=0.5)
    ] = 0.1,
    numerics: Annotated[Numerics, ("mesh", "precision", "device", "threads")],
    out: Out = None,
    figures: Annotated[
        tuple[str, ...],
        Option(
            "Formats of the figures, e.g. pdf,svg; empty: none.", metavar="FORMATS", read=texts.figure_formats
        ),
    ] = ("png",),
) -> None:
    """Predict the uncertainty of a planned test like this shot: where, when and how fast to measure.

    Writes plan.html, plan.h5, plan.json, CSV tables and figures into SHOT/results.
    """
    changes: dict[str, Any] = {name: value for name, value in vars(instruments).items() if value is not None}
    names = tuple(texts.ranges("--free", [_without_bounds(name) for name in free]))
    from kolsky.cli.options import load, usable
    from kolsky.cli.terminal import print_result, progress_bars
    from kolsky.report.result_folder import write_results
    from kolsky.studies.planning import output
    from kolsky.studies.planning import plan as planning
    from kolsky.studies.planning.information import instruments_of

    loaded, folder = load(shot, out)
    with usable(loaded), progress_bars() as progress:
        result = planning.plan(
            loaded,
            names=names or planning.NAMES,
            held=parameter,
            instruments=lambda prepared: replace(instruments_of(prepared), **changes),
            rates=rates or planning.RATES,
            heights=heights,
            reach=reach,
            discrepancy=(0.0, 0.0) if discrepancy == "none" else None,
            numerics=numerics,
            progress=progress,
        )
    write_results(folder, result, formats=figures)
    print_result(
        output.rows(result),
        output.to_json(result),
        files={"folder": folder},
        warnings=[f"{part}: {e.unseen}" for part, e in result.expected.items() if e.unseen],
    )
