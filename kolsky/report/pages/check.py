"""Page of a shot before anything is run: what was understood, and what is taken as exact."""

from itertools import groupby

from kolsky.report.figures import figures_of
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page
from kolsky.results.nomenclature import typeset
from kolsky.shot.bars import CheckedBars
from kolsky.shot.records import ShotBase
from kolsky.shot.summary import EXACT, Entry, remarks, summarise

PAGE = "check.html"


def render(shot: ShotBase | CheckedBars) -> str:
    """Return the page as HTML text; see `write_page`."""
    entries = [entry for entry in summarise(shot) if entry.value != EXACT]
    tables = [
        (section, [(entry.name.replace("_", " "), _shown(entry)) for entry in rows])
        for section, rows in groupby(entries, lambda entry: entry.section)
    ]
    return render_page(
        "check.html",
        kind="What was understood of a shot",
        heading=shot.name,
        subject="check",
        figures=draw_figures(figures_of(shot).values(), shot),
        tables=tables,
        remarks=remarks(shot),
        exact=[entry.name for entry in summarise(shot) if entry.value == EXACT],
        inputs=list(shot.inputs.items()),
    )


write_page = page_writer(render)


def _shown(entry: Entry) -> str:
    """Return a value as a page writes it; a word of a file stays as it is."""
    return entry.written() if isinstance(entry.value, str) else typeset(entry.written())
