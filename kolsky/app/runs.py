"""The view that runs commands of a shot: progress, log and exit."""

from __future__ import annotations

import shlex
from pathlib import Path

from nicegui import ui

from kolsky.app import frame, jobs
from kolsky.app.copies import original_of
from kolsky.base.errors import InputError
from kolsky.schema.pictures import find_measurement_file
from kolsky.schema.shot_file import SHOT_FILE

WORDS = {
    "identify": "Identify: stiffness factor with its uncertainty, report",
    "dic": "Image correlation of the pictures",
    "sweep": "Sweep: many simulations over the free parameters",
    "report": "Write the report again",
}
"""Commands that can be selected."""
EVERY = 1.0
"""Interval of updates of a running command [s]."""


def page(root: Path) -> None:
    """Register the page."""

    @ui.page("/run")
    def run_page(shot: str = "") -> None:
        with frame.framed(f"Run {shot}", view="run", shot=shot):
            folder = frame.folder_at(root, shot)
            if (folder / SHOT_FILE).exists():
                RunView(folder, shot, WORDS)
            elif find_measurement_file(folder) is not None:
                RunView(folder, shot, {"dic": WORDS["dic"]})
            else:
                frame.note("There is no shot.toml yet: set the shot up first.", "caution")


class RunView:
    """Start, progress and log of the commands of one shot."""

    def __init__(self, folder: Path, shot: str, commands: dict[str, str]) -> None:
        """Build the view. It also shows a run that another page or an earlier server started."""
        self.folder, self.shot = folder, shot
        with ui.row().classes("w-full items-end gap-3"):
            self.command = frame.choice(commands, next(iter(commands)), "Command", width="w-96 max-w-full")
            self.options = ui.input("Options, as on the command line").classes("grow").props("dense outlined")
            self.begin = ui.button("Start", on_click=self.start).props("unelevated")
            self.end = ui.button("Cancel", on_click=self.cancel).props("outline color=negative")
        frame.note(
            "A run is a separate process: it continues when this page or the server is closed. The same "
            "command in a terminal writes the same files."
        )
        self.state = ui.label().props("role=status")
        self.bar = ui.linear_progress(value=0.0, show_value=False).props('aria-label="Progress"')
        self.stages = frame.note("").classes("stages")
        self.links = ui.row().classes("gap-4")
        self.log = ui.label().classes("log").props('tabindex=0 role=log aria-label="Log"')
        self.shown: object = self  # nothing yet
        self.look()
        ui.timer(EVERY, self.look)

    def _job(self) -> jobs.Job | None:
        """The displayed run: the running one, otherwise the last one."""
        found = jobs.jobs_of(self.folder)
        running = [job for job in found if job.running]
        return max(running or found, key=lambda job: job.log.stat().st_mtime, default=None)

    def look(self) -> None:
        """Show the state of the run."""
        job = self._job()
        self.begin.set_enabled(job is None or not job.running)
        self.end.set_visibility(job is not None and job.running)
        self.log.set_visibility(job is not None)
        if job == self.shown:
            return
        self.shown = job
        if job is None:
            self.state.text = "Nothing has been run from here yet."
            self.bar.set_visibility(False)
            return
        self.state.text = f"kolsky {job.command}, started {job.started}: {job.state}"
        self.bar.set_visibility(job.running)
        self.stages.set_visibility(job.running)
        self.bar.value = 0.0
        if job.running and job.stages:
            *earlier, now = job.stages
            self.state.text += f": {now.name}, {now.done} of {now.total}, {now.time}".removesuffix(", ")
            self.bar.value = now.done / now.total if now.total else 0.0
            self.stages.text = "\n".join(f"{one.name}: {one.done} of {one.total}" for one in earlier)
        self.log.text = job.text or "(it has printed nothing yet)"
        self._links(job)

    def _links(self, job: jobs.Job) -> None:
        self.links.clear()
        if job.running or job.exit_code != 0:
            return
        with self.links:
            if job.command == "identify":
                ui.link("Look at the result", frame.address("look", self.shot))
                original = original_of(self.folder)
                if original is not None:
                    target = frame.comparison(frame.beside(self.shot, original), self.shot)
                    ui.link(f"Compare with {original.name}", target)
            for name in ("report", "dic", "sweep"):
                if (self.folder / "results" / f"{name}.html").is_file():
                    target = frame.address("result", self.shot, name=f"{name}.html")
                    ui.link(f"{name}.html", target, new_tab=True)

    def start(self) -> None:
        """Start the selected command."""
        try:
            options = shlex.split(str(self.options.value or ""))
            jobs.start(self.folder, str(self.command.value), options)
        except InputError as error:
            ui.notify(str(error), type="warning")
        except ValueError as error:
            ui.notify(f"The options cannot be read: {error}", type="warning")
        self.shown = self
        self.look()

    def cancel(self) -> None:
        """Cancel the running command."""
        job = self._job()
        if job is not None:
            jobs.cancel(job)
            ui.notify("It cleans up and ends; earlier results stay.")
