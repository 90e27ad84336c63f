"""`kolsky wavespeed`: c0 and the gauges' relative gain from a shot with the bars together."""

from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, Out, ShotPath


def wavespeed(shot: ShotPath, out: Out = None, figures: Figures = "", as_json: AsJson = False) -> None:
    """Find the bars' wave speed and the gauges' relative gain from a shot with the bars together.

    Needs the tables bars, recorders and gauges in shot.toml, no specimen. Writes wavespeed.csv into
    SHOT/results.
    """
    formats = texts.figure_formats(figures)
    from kolsky.base.files import filling, usable_folder
    from kolsky.cli.terminal import print_result
    from kolsky.shot.bars_together import summary, wave_speed_of, write_residual
    from kolsky.shot.schema.reading import folder_of

    name, found, notes = wave_speed_of(shot)
    folder = usable_folder(out or folder_of(shot) / "results")
    with filling(folder) as partial:
        write_residual(partial / "wavespeed.csv", found)
        if formats:
            from kolsky.report.canvas import save_figures

            save_figures(partial / "figures", found, formats=formats)
    print_result(
        {
            "shot": name,
            "wave speed c0": f"{found.wave_speed:.2f} ± {2.0 * found.wave_speed_sigma:.2f} m/s (k = 2)",
            "gain, transmission over incident": f"{found.gain:.5f} ± {2.0 * found.gain_sigma:.5f} (k = 2)",
            "residual, rms of peak": f"{100.0 * found.rms:.2f} %",
            "residual, largest of peak": f"{100.0 * found.largest:.2f} %",
            "plain shift, rms": f"{100.0 * found.plain_rms:.2f} % at {found.plain_wave_speed:.1f} m/s",
            "by Poisson's ratio": f"{found.by_poisson:.3g} m/s per unit",
            "by distance": f"{found.wave_speed / found.distance * 1e-3:.3g} m/s per mm",
        },
        {"shot": name, **summary(found), "remarks": list(notes)} if as_json else None,
        rest={"residual": folder / "wavespeed.csv"},
        warnings=notes,
    )
