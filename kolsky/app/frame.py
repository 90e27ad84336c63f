"""Common parts of all pages: head line, colours, addresses of shots, result files."""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast
from urllib.parse import urlencode

import cv2
import numpy as np
from fastapi import Response
from nicegui import app, run, ui

from dic.images import Pictures
from kolsky.base.errors import InputError
from kolsky.pictures.regions import png_of

BLUE, ORANGE, RED, INK, SOFT, RULE, BAND = (
    "#0072b2", "#d55e00", "#a63c00", "#1a1a1a", "#5c5c5c", "#c9c9c9", "#d5e6f0",
)  # fmt: skip
"""Colours of the report."""
ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><rect width="16" height="16" rx="3" '
    f'fill="{BLUE}"/><path d="M2 12h4l2-8 2 8h4" stroke="white" stroke-width="1.6" fill="none"/></svg>'
)
STYLE = files("kolsky.app").joinpath("app.css").read_text("utf-8")
VIEWS = {"setup": "Set up", "pictures": "Pictures", "run": "Run", "look": "Look"}
"""Views of one shot: address -> name."""


P = ParamSpec("P")
T = TypeVar("T")


async def in_thread(act: Callable[P, T], *given: P.args, **named: P.kwargs) -> T:
    """Run a long function in a thread and return its result. The page stays responsive."""
    return cast(T, await run.io_bound(act, *given, **named))


async def opened(words: str, read: Callable[P, T], *given: P.args, **named: P.kwargs) -> T:
    """Result of a function that reads files, in a thread. The page shows ``words`` until it is there."""
    waiting = note(words)
    await ui.context.client.connected()
    try:
        return await in_thread(read, *given, **named)
    finally:
        waiting.delete()


class NoShot(ValueError):
    """An address that does not belong to a folder of the tree."""


def folder_at(root: Path, name: str) -> Path:
    """The folder of a shot by its name in an address. Only folders inside the root are allowed."""
    folder = (root / name).resolve()
    if not folder.is_relative_to(root) or not folder.is_dir():
        raise NoShot(f"there is no folder {name!r} below {root}")
    return folder


def address(view: str, shot: str = "", **more: str) -> str:
    """Address of a view of a shot."""
    words = {**({"shot": shot} if shot else {}), **more}
    return f"/{view}" + (f"?{urlencode(words)}" if words else "")


BETWEEN = "|"
"""Separator of shots in an address. Not all systems allow it in folder names."""


def comparison(*shots: str) -> str:
    """Address of the view that compares shots."""
    return address("compare", shots=BETWEEN.join(shots))


def beside(shot: str, folder: Path) -> str:
    """Name in an address for a folder in the parent folder of a shot."""
    return f"{shot.rpartition('/')[0]}/{folder.name}".lstrip("/")


@contextmanager
def framed(title: str, *, view: str, shot: str | None = None) -> Iterator[None]:
    """A page with the head line. Elements created inside the context are its content.

    If the shot does not exist or cannot be read, the page shows the reason.
    """
    ui.add_css(STYLE)
    ui.colors(primary=BLUE, negative=RED)
    ui.page_title(f"{title} - kolsky")
    with ui.header(), ui.row().classes("head").props('role=navigation aria-label="Views"'):
        _link("Shots", "/", current=view == "shots")
        _link("Compare", "/compare", current=view == "compare")
        if shot is not None:
            ui.label(shot).classes("name")
            for one, words in VIEWS.items():
                _link(words, address(one, shot), current=view == one)
    heading(title, 1)
    try:
        yield
    except (NoShot, InputError) as error:
        note(str(error), "caution")


def _link(words: str, target: str, *, current: bool) -> None:
    ui.link(words, target).classes("here" if current else "").props("aria-current=page" if current else "")


def heading(words: str, level: int = 2) -> None:
    """A heading."""
    with ui.element(f"h{level}"):
        ui.label(words)


def note(words: str, kind: str = "soft") -> ui.label:
    """A line of text: "soft" or "caution"."""
    return ui.label(words).classes(kind)


def fold(title: str, *, opened: bool = False) -> ui.expansion:
    """A part of a page that can be folded."""
    return ui.expansion(title, value=opened).classes("w-full").props(f'dense aria-label="{title}"')


def choice(options: Any, value: Any, label: str, *, width: str = "w-full") -> ui.select:
    """A list from which a value is chosen."""
    return ui.select(options, value=value, label=label).classes(width).props("dense outlined")


def on_entry(field: ui.input, act: Callable[..., object]) -> None:
    """Call a function when a text was entered: the field is left, or Enter is pressed."""
    for event in ("blur", "keydown.enter"):
        field.on(event, act)


def data_uri(png: bytes) -> str:
    """A PNG as a data URI."""
    return f"data:image/png;base64,{b64encode(png).decode()}"


def source_of(pictures: Pictures, k: int, widest: int | None = None) -> str:
    """A picture of a series as an image source, at most ``widest`` [px]. Empty if it cannot be read."""
    png = png_of(pictures, k)
    if isinstance(png, str):
        return ""
    grey = None if widest is None else cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE)
    if grey is not None and widest is not None and grey.shape[1] > widest:
        rows = round(grey.shape[0] * widest / grey.shape[1])
        small = cv2.resize(grey, (widest, rows), interpolation=cv2.INTER_AREA)
        png = cv2.imencode(".png", small)[1].tobytes()
    return data_uri(png)


def camera(i: int, what: str = "Picture of", **events: Any) -> ui.interactive_image:
    """The place of a camera's picture, with its name. ``events``: options of `ui.interactive_image`."""
    with ui.column().classes("w-full gap-1"):
        ui.label(f"Camera {i}").classes("soft")
        image = ui.interactive_image(sanitize=False, **events).classes("w-full").mark(f"camera-{i}")
        described(image, f"{what} camera {i}")
    return image


def described(image: ui.interactive_image, words: str) -> None:
    """Describe an image for screen readers. The element has no property for it."""
    ui.run_javascript(f"getHtmlElement({image.id}).querySelector('img').alt = '{words}'")


class Player:
    """Button, slider and label of the times of a test."""

    def __init__(
        self,
        count: int,
        show: Callable[[int], None],
        *,
        words: str,
        every: float,
        first: int = 0,
        step: int = 1,
    ) -> None:
        """Build the row.

        ``count``: number of times. ``show``: called with the number of the chosen time. ``words``: quantity
        of the slider. ``every``: interval of the playback [s]. ``first``: number of the first time. ``step``:
        numbers from picture to picture.
        """
        self.last, self.step = count - 1, step
        with ui.row().classes("w-full items-center no-wrap gap-3"):
            self.button = ui.button(icon="play_arrow", on_click=self._toggle)
            self.button.props('flat dense aria-label="Play"')
            self.slider = ui.slider(min=0, max=max(self.last, 1), value=first)
            self.slider.props(f'aria-label="{words}"').mark(words.lower())
            self.slider.on_value_change(lambda change: show(min(int(change.value), self.last)))
            self.now = ui.label().classes("soft whitespace-nowrap")
        self.timer = ui.timer(every, self._next, active=False)

    def _toggle(self) -> None:
        self.timer.active = not self.timer.active
        self.button.props(f"icon={'pause' if self.timer.active else 'play_arrow'}")
        if self.timer.active and self.slider.value >= self.last:
            self.slider.value = 0

    def _next(self) -> None:
        if self.slider.value >= self.last:
            self._toggle()
            return
        self.slider.value = min(self.slider.value + self.step, self.last)


def serve_files(root: Path) -> None:
    """Serve the result pages in a shot's folder, in a sandbox. A foreign page cannot act for the user."""

    def result_page(shot: str, name: str) -> Response:
        try:
            path = (folder_at(root, shot) / "results" / name).resolve()
        except NoShot as error:
            return Response(str(error), 404)
        if not path.is_relative_to(root) or path.suffix != ".html" or not path.is_file():
            return Response("there is no such page", 404)
        return Response(
            path.read_bytes(),
            media_type="text/html; charset=utf-8",
            headers={"content-security-policy": "sandbox allow-scripts; default-src 'none'; img-src data:; "
                     "style-src 'unsafe-inline'; script-src 'unsafe-inline'; font-src data:"},
        )  # fmt: skip

    app.get("/result")(result_page)


def plain(values: Any) -> list[float | None]:
    """Numbers for a plot, with seven digits. Numbers that are not finite are gaps."""
    return [float(f"{v:.7g}") if math.isfinite(v) else None for v in map(float, values)]


def points(x: Any, y: Any) -> list[list[float | None]]:
    """Pairs for a plot."""
    return [[a, b] for a, b in zip(plain(x), plain(y), strict=True)]


def axis(name: str, **more: Any) -> dict[str, Any]:
    """A value axis with its quantity and unit."""
    return {
        "type": "value",
        "name": name,
        "nameLocation": "middle",
        "nameTextStyle": {"color": INK},
        "axisLabel": {"color": SOFT, "hideOverlap": True},
        "splitLine": {"show": False},
        "axisLine": {"show": True, "lineStyle": {"color": INK}},
        "axisTick": {"show": True},
        "scale": True,
        **more,
    }


def chart(
    x: str, y: str, series: Sequence[dict[str, Any]], *, words: str, legend: bool = True, **more: Any
) -> ui.echart:
    """A plot of lines and points. ``x``, ``y``: axis names. ``words``: description for screen readers."""
    plot = ui.echart(
        {
            "animation": False,
            "grid": {"left": 62, "right": 18, "top": 34 if legend else 14, "bottom": 46},
            "legend": {"show": legend, "top": 0, "left": 50, "textStyle": {"color": INK}, "itemHeight": 8},
            "tooltip": {"trigger": "axis", "confine": True},
            "xAxis": axis(x, nameGap=28),
            "yAxis": axis(y, nameGap=46),
            "series": list(series),
            **more,
        }
    ).classes("plot")
    return plot.props(f'role=img aria-label="{words}"')


def line(name: str, data: list[Any], colour: str, **more: Any) -> dict[str, Any]:
    """A line of a plot."""
    look = {"lineStyle": {"color": colour, "width": 1.6}, "itemStyle": {"color": colour}}
    return {"name": name, "type": "line", "showSymbol": False, "data": data, **look, **more}


def dots(name: str, data: list[Any], colour: str, size: float = 3.0, **more: Any) -> dict[str, Any]:
    """Points of a plot."""
    look = {"symbolSize": size, "itemStyle": {"color": colour}}
    return {"name": name, "type": "scatter", "data": data, **look, **more}


def mark_at(series: dict[str, Any], x: float) -> None:
    """Mark a place along x in a plot, by a vertical line of one of its series."""
    series["markLine"] = {
        "silent": True, "symbol": "none", "animation": False, "label": {"show": False},
        "lineStyle": {"color": BLUE, "type": "solid"}, "data": [{"xAxis": float(f"{x:.6g}")}],
    }  # fmt: skip


def band(name: str, x: Any, low: Any, high: Any) -> list[dict[str, Any]]:
    """A band between two curves. It is an invisible lower part with its width stacked on top."""
    common = {
        "type": "line", "stack": name, "stackStrategy": "all", "symbol": "none", "silent": True,
        "lineStyle": {"width": 0},
    }  # fmt: skip
    width = [b - a for a, b in zip(map(float, low), map(float, high), strict=True)]
    look = {"areaStyle": {"color": BAND, "opacity": 1}, "itemStyle": {"color": BAND}}
    return [
        {**common, "name": "", "data": points(x, low), "tooltip": {"show": False}},
        {**common, "name": name, "data": points(x, width), **look},
    ]
