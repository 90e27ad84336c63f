"""The view of a shot's pictures: both cameras over time, regions, quality of subsets, measured fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path

import numpy as np
from nicegui import events, ui

from dic.bodies.region import Region
from dic.images import PictureError, Pictures
from dic.images.quality import SpeckleQuality, grey_noise, speckle_quality
from kolsky.app import frame
from kolsky.app.calibration import CalibrationView
from kolsky.app.fields import FieldsView
from kolsky.base.errors import InputError
from kolsky.pictures.calibration import has_calibration_pictures
from kolsky.pictures.correlation import key_of
from kolsky.pictures.dic_file import stored_key
from kolsky.pictures.measurement import read_measurement
from kolsky.pictures.picture_set import PictureSet
from kolsky.pictures.regions import Drawable, Session
from kolsky.schema.pictures import find_measurement_file
from kolsky.schema.shot_file import SHOT_FILE
from kolsky.shot.dic import open_region_session, regions_in_pictures
from kolsky.shot.load import load_pictures
from kolsky.shot.measured_points import MeasuredPoints, read_measured_points
from kolsky.shot.optical_data import RESULT_FILE

MOST_AVERAGED = 8
"""Maximum number of frames at rest that are used to evaluate the speckles."""
GRAB = 0.02
"""Distance from a corner within which a click grabs it, relative to the picture's width."""
BINS = 64
MODES = {
    "draw": "adds or moves a corner of a region",
    "subset": "shows what a subset there can measure",
    "follow": "follows the point there through time",
}
"""Effect of a click on a picture. In camera 1 a click can only follow a point."""


@dataclass
class OpenPictures:
    """The pictures of a shot or of a measurement, with the session in which regions are drawn."""

    session: Session
    series: Sequence[Pictures]
    """Pictures of one camera or two."""
    static: int
    """Number of frames at rest."""
    subset: int
    """Side of the subsets [px]."""
    surfaces: tuple[MeasuredPoints, ...] = ()
    """Surfaces measured by `kolsky dic`. Empty if the command has not run."""
    remark: str = ""
    """Reason why there are none, or why they may be out of date."""
    shot: PictureSet | None = None
    """The pictures of a shot. Its regions can be detected in them."""


def open_all(folder: Path) -> OpenPictures:
    """Open the pictures of a folder. Raises InputError if it has no pictures, or if they cannot be used."""
    session = open_region_session(folder)
    if (path := find_measurement_file(folder)) is not None:
        measurement = read_measurement(path)
        dic = measurement.declared.dic
        found = measured_in(folder, measurement.series)
        return OpenPictures(session, measurement.series, dic.static, dic.subset, *found)
    loaded = load_pictures(folder).pictures
    declared = loaded.toml.declared
    assert declared.dic is not None  # shots with pictures have it
    surfaces, remark = measured_in(folder, loaded.series)
    if surfaces and stored_key(folder / "results" / RESULT_FILE) != key_of(loaded):
        remark = f"Pictures or shot.toml changed after {RESULT_FILE} was made: run dic again."
    static, subset = declared.frames.static, declared.dic.subset
    return OpenPictures(session, loaded.series, static, subset, surfaces, remark, loaded)


def measured_in(folder: Path, series: Sequence[Pictures]) -> tuple[tuple[MeasuredPoints, ...], str]:
    """The surfaces measured from the pictures of a folder. If there are none, the reason."""
    if not (folder / "results" / RESULT_FILE).is_file():
        return (), "No fields yet: run dic first."
    try:
        found = read_measured_points(folder)
    except InputError as error:
        return (), f"{error}"
    count = found[0].surface.n_frames
    if count != series[0].n_frames:
        return (
            (),
            f"{RESULT_FILE} is of {count} frames, the pictures are {series[0].n_frames}: run dic again.",
        )
    return found, ""


def page(root: Path) -> None:
    """Register the page."""

    @ui.page("/pictures", response_timeout=30.0)
    async def pictures_page(shot: str = "") -> None:
        with frame.framed(f"Pictures of {shot}", view="pictures", shot=shot):
            folder = frame.folder_at(root, shot)
            if not (folder / SHOT_FILE).is_file() and has_calibration_pictures(folder):
                CalibrationView(folder)
                return
            opened = await frame.opened("The pictures are opened ...", open_all, folder)
            if not has_calibration_pictures(folder):
                PicturesView(opened)
                return
            with ui.tabs().props("dense no-caps align=left") as tabs:
                test, target = ui.tab("Test"), ui.tab("Calibration")
            with ui.tab_panels(tabs, value=test).classes("w-full"):
                with ui.tab_panel(test).classes("p-0"):
                    PicturesView(opened)
                with ui.tab_panel(target).classes("p-0"):
                    CalibrationView(folder)


class PicturesView:
    """Pictures, regions and quality of one shot."""

    def __init__(self, opened: OpenPictures) -> None:
        """Build the view."""
        self.opened, self.session = opened, opened.session
        self.k, self.mode = 0, "draw"
        self.held: int | None = None
        self.wanted: Drawable = self.session.wanted[0]
        self.corners: dict[str, list[list[float]]] = {}
        self.frames: dict[str, int] = {}
        for key, shapes in self.session.drawn.items():
            self.corners[key] = [list(corner) for corner in shapes[0].corners]
            self.frames[key] = shapes[0].frame
        self.quality: SpeckleQuality | None = None
        self.subset_at: tuple[float, float] | None = None
        self.player = frame.Player(self.session.pictures.n_frames, self._at, words="Frame", every=0.15)
        self.fields = (
            FieldsView(opened.surfaces, self.session.pictures.shape, self._draw) if opened.surfaces else None
        )
        with ui.row().classes("w-full items-center gap-3"):
            modes = {key: words for key, words in MODES.items() if key != "follow" or self.fields}
            mode = frame.choice(modes, "draw", "A click on a picture", width="w-80").mark("mode")
            mode.on_value_change(lambda change: setattr(self, "mode", str(change.value)))
            self.said = ui.label().classes("soft").props("role=status").mark("subset")
        if self.fields is not None:
            self.fields.controls()
        if opened.remark:
            frame.note(opened.remark, "caution" if opened.surfaces else "soft")
        with ui.element("div").classes("grid2"):
            self.images = [self._camera(i) for i in range(len(opened.series))]
            if self.fields is not None:
                self.fields.panels()
            self._regions()
            with ui.column().classes("w-full gap-1"):
                frame.heading("Grey values")
                self.histogram = frame.chart(
                    "Grey value",
                    "Share of the pixels (%)",
                    [],
                    words="Histogram of the frame",
                    legend=len(opened.series) > 1,
                )
        self._at(0)

    def _camera(self, i: int) -> ui.interactive_image:
        events = ["mousedown", "mousemove", "mouseup"] if i == 0 else ["mousedown"]
        return frame.camera(i, on_mouse=partial(self._mouse, i), events=events, cross=i == 0)

    def _regions(self) -> None:
        with ui.column().classes("w-full gap-2"):
            frame.heading("Regions")
            titles = {one.key: one.title for one in self.session.wanted}
            kind = frame.choice(titles, self.wanted.key, "What is drawn")
            kind.on_value_change(lambda change: self._want(str(change.value)))
            self.text = ui.textarea('Corners, one "x, y" a line [px]').classes("w-full").mark("corners")
            self.text.props("outlined rows=5").on("blur", self._typed)
            with ui.row().classes("gap-2"):
                if self.opened.shot is not None and len(self.session.drawn) < len(self.session.wanted):
                    ui.button("Find in the pictures", on_click=self._find).props("outline dense")
                ui.button("Clear", on_click=self._clear).props("flat dense")
                ui.button("Check", on_click=self._check).props("outline dense")
                save = ui.button(f"Save into {self.session.path.name}", on_click=self._save)
                save.props("unelevated dense")
            self.problems = ui.label().props("role=status").mark("problems")

    async def _find(self) -> None:
        """Detect the undeclared regions in the pictures and draw them. Nothing is saved."""
        assert self.opened.shot is not None  # else there is no button
        self.problems.text = "The pictures are searched for the regions ..."
        try:
            found, why = await frame.in_thread(regions_in_pictures, self.opened.shot)
        except InputError as error:
            self._report([str(error)])
            return
        for key, shapes in found.items():
            self.corners[key] = [list(corner) for corner in shapes[0].corners]
            self.frames[key] = shapes[0].frame
        self._draw()
        names = ", ".join(key.replace("_", " ") for key in found)
        self._report([], success=f"Found: {names}{f'; {why}' if why else ''}. Look at each, then save.")

    def _want(self, key: str) -> None:
        self.wanted = next(one for one in self.session.wanted if one.key == key)
        if key in self.frames and self.frames[key] != self.k:
            self.player.slider.value = self.frames[key]
        self._draw()

    def _mine(self) -> list[list[float]]:
        return self.corners.setdefault(self.wanted.key, [])

    def _mouse(self, camera: int, event: events.MouseEventArguments) -> None:
        """Add a corner, move one, show a subset, or follow a point."""
        rows, columns = self.session.pictures.shape
        place = [float(np.clip(event.image_x, 0, columns - 1)), float(np.clip(event.image_y, 0, rows - 1))]
        if self.mode == "follow":
            if event.type == "mousedown" and self.fields is not None:
                self.fields.choose(camera, (place[0], place[1]))
                self._draw()
            return
        if camera != 0:
            return
        if event.type == "mouseup":
            self.held = None
        elif event.type == "mousemove":
            if self.held is None:
                return
            self._mine()[self.held] = [round(v, 1) for v in place]
        elif self.mode == "subset":
            self.subset_at = place[0], place[1]
            ui.timer(0.0, self._look_at_subset, once=True)
        else:
            self._press([round(v, 1) for v in place], columns)
        self._draw()

    def _press(self, place: list[float], columns: int) -> None:
        mine = self._mine()
        near = [float(np.hypot(c[0] - place[0], c[1] - place[1])) for c in mine]
        if near and min(near) < GRAB * columns:
            self.held = int(np.argmin(near))
            return
        if self.wanted.point:
            mine.clear()
        if not mine:
            self.frames[self.wanted.key] = self.k if self.wanted.framed else self.wanted.home
        mine.append(place)

    def _typed(self) -> None:
        found = []
        for line in str(self.text.value or "").splitlines():
            try:
                x, y = (float(part) for part in line.split(","))
            except ValueError:
                if line.strip():
                    self._report([f"{line.strip()!r} is not a corner: write x, y"])
                    return
                continue
            found.append([x, y])
        if found and not self._mine():
            self.frames[self.wanted.key] = self.k if self.wanted.framed else self.wanted.home
        self.corners[self.wanted.key] = found
        self._draw()

    def _clear(self) -> None:
        self.corners[self.wanted.key] = []
        self._draw()

    def _drawn(self) -> dict[str, list[Region]]:
        """The drawn regions, with those of the session that are not on the page."""
        found = {}
        for one in self.session.wanted:
            if corners := self.corners.get(one.key):
                first = Region(tuple((x, y) for x, y in corners), self.frames.get(one.key, one.home))
                found[one.key] = [first, *self.session.drawn.get(one.key, [])[1:]]
        return found

    def _check(self) -> None:
        self._report(self.session.problems(self._drawn()))

    def _save(self) -> None:
        problems = self.session.save(self._drawn())
        self._report(
            problems, success=f"saved into {self.session.path.name}: {', '.join(self.session.saved)}"
        )

    def _report(self, problems: Sequence[str], *, success: str = "The regions can be saved.") -> None:
        self.problems.text = "; ".join(problems) or success
        self.problems.classes(replace="caution" if problems else "soft")

    def _at(self, k: int) -> None:
        """Show a frame of each camera, with its histogram."""
        self.k = k
        self.player.now.text = f"frame {k} of {self.session.pictures.n_frames}"
        for image, pictures in zip(self.images, self.opened.series, strict=True):
            image.set_source(frame.source_of(pictures, k))
        if self.fields is not None:
            self.fields.at(k)
        self._histogram()
        self._draw()

    def _histogram(self) -> None:
        series = []
        for i, (pictures, colour) in enumerate(
            zip(self.opened.series, (frame.INK, frame.BLUE), strict=False)
        ):
            try:
                grey = np.asarray(pictures.frame(self.k))
            except PictureError:
                continue  # the picture's place stays empty
            counts, edges = np.histogram(grey, bins=BINS, range=(0, 2**pictures.bits))
            share = 100.0 * counts / grey.size
            series.append(frame.line(f"camera {i}", frame.points(edges[:-1], share), colour, step="end"))
        self.histogram.options["series"] = series
        self.histogram.update()

    def _draw(self) -> None:
        """Draw fields over the pictures and regions over camera 0, and list the corners."""
        _, columns = self.session.pictures.shape
        width, parts = columns / 400.0, []
        for key, corners in self.corners.items():
            if not corners or self.frames.get(key, 0) != self.k:
                continue
            colour = frame.ORANGE if key == self.wanted.key else frame.BLUE
            places = " ".join(f"{x:g},{y:g}" for x, y in corners)
            line = f'stroke="{colour}" stroke-width="{width:g}"'
            parts.append(f'<polygon points="{places}" fill="{colour}22" {line}/>')
            parts += [
                f'<circle cx="{x:g}" cy="{y:g}" r="{2.2 * width:g}" fill="{colour}"/>' for x, y in corners
            ]
            x, y = corners[0]
            edge = f'stroke="#000" stroke-width="{0.3 * width:g}" paint-order="stroke"'
            parts.append(
                f'<text x="{x:g}" y="{y - 3 * width:g}" font-size="{12 * width:g}" fill="{colour}" {edge}>'
                f"{escape(key.replace('_', ' '))}</text>"
            )
        if self.subset_at is not None:
            x, y = (v - 0.5 * self.opened.subset for v in self.subset_at)
            size = self.opened.subset
            look = f'fill="none" stroke="#ffe000" stroke-width="{width:g}"'
            parts.append(f'<rect x="{x:g}" y="{y:g}" width="{size}" height="{size}" {look}/>')
        for i, image in enumerate(self.images):
            under = "" if self.fields is None else self.fields.overlay(i)
            image.content = under + ("".join(parts) if i == 0 else "")
        self.text.value = "\n".join(f"{x:g}, {y:g}" for x, y in self._mine())

    async def _look_at_subset(self) -> None:
        """Show the expected noise of a subset at the chosen position."""
        if self.quality is None:
            try:
                self.quality = await frame.in_thread(quality_of, self.opened)
            except (ValueError, PictureError) as error:
                self.said.text = f"The speckles cannot be judged: {error}"
                return
        assert self.subset_at is not None
        self.said.text = subset_words(self.quality, self.subset_at)


def quality_of(opened: OpenPictures) -> SpeckleQuality:
    """Speckle quality of camera 0, from its frames at rest.

    Raises ValueError if the frames have no contrast, or if there is only one. Raises PictureError if one
    cannot be read.
    """
    pictures = opened.series[0]
    count = min(opened.static, MOST_AVERAGED, pictures.n_frames)
    rest = [np.asarray(pictures.frame(k)) for k in range(count)]
    noise = grey_noise(rest, range(count))
    return speckle_quality(
        np.mean(np.stack(rest).astype(np.float64), axis=0), None, opened.subset, noise, averaged=count
    )


def subset_words(quality: SpeckleQuality, place: tuple[float, float]) -> str:
    """Number of speckles in a subset at (x, y) and the expected noise of a match, in words."""
    x, y = (round(v) for v in place)
    floor, size = quality.floor[y, x], float(np.nanmean(quality.size))
    speckles = f"about {(quality.subset / (2.0 * size)) ** 2:.0f} speckles" if size > 0.0 else "no speckles"
    head = f"Subset of {quality.subset} px at ({x}, {y}): {speckles} of {size:.1f} px"
    if not np.isfinite(floor).all():
        return f"{head}; it has no contrast, or lies half outside"
    return f"{head}; expected noise of a match {floor[0]:.4f} px along x, {floor[1]:.4f} px along y"
