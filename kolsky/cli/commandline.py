"""The commands of `kolsky` in the order of `--help`, and the start of the program."""

import errno
import inspect
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import TextIOWrapper
from threading import Thread, Timer
from types import FrameType
from typing import Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.base.process import last_work, set_blas_threads
from kolsky.cli.actuator import actuator_control, actuator_invert, actuator_simulate
from kolsky.cli.bars import repeats, waves, wavespeed
from kolsky.cli.dic import calibrate, dic
from kolsky.cli.doctor import doctor
from kolsky.cli.identify import demo, identify
from kolsky.cli.material_curves import material_relaxation, reference_curve
from kolsky.cli.material_fit import material_fit, material_healing
from kolsky.cli.new import channels, check, new, open_pages
from kolsky.cli.options import with_settings
from kolsky.cli.plan import plan, predict, virtual_make, virtual_new
from kolsky.cli.report import film, rate, report
from kolsky.cli.simulate import simulate
from kolsky.cli.specimen import specimen_fit, specimen_new, specimen_plan, specimen_simulate
from kolsky.cli.sweep import budget, sweep

Command = Callable[..., None]

COMMANDS: dict[str, Command] = {
    "demo": demo,
    "new": new,
    "open": open_pages,
    "check": check,
    "channels": channels,
    "dic": dic,
    "waves": waves,
    "wavespeed": wavespeed,
    "repeats": repeats,
    "rate": rate,
    "calibrate": calibrate,
    "identify": identify,
    "report": report,
    "simulate": simulate,
    "plan": plan,
    "predict": predict,
    "sweep": sweep,
    "budget": budget,
    "film": film,
    "doctor": doctor,
    "material reference-curve": reference_curve,
    "material fit": material_fit,
    "material relaxation": material_relaxation,
    "material healing": material_healing,
    "specimen new": specimen_new,
    "specimen fit": specimen_fit,
    "specimen simulate": specimen_simulate,
    "specimen plan": specimen_plan,
    "actuator simulate": actuator_simulate,
    "actuator invert": actuator_invert,
    "actuator control": actuator_control,
    "virtual new": virtual_new,
    "virtual make": virtual_make,
}
"""Commands by their words on the command line. The first of two words is a group of `GROUPS`."""

GROUPS = {
    "material": "Quasi-static tests of the material of a shot.",
    "specimen": "Whole specimens in slow tests, simulated and fitted.",
    "actuator": "Pressurised soft actuators: bend, pressure for a bend, closed loop.",
    "virtual": "The virtual laboratory: synthetic shots with known properties.",
}
"""Groups of commands and their line of `--help`."""

BROUGHT_BY = {
    "cv2": "opencv-contrib-python-headless",
    "skimage": "scikit-image",
    "pyvista": "pyvista",
    "pandas": "pandas",
    "xarray": "xarray",
    "nptdms": "npTDMS",
    "RigolWFM": "RigolWFM",
    "imageio": "kolsky[film]",
    "imageio_ffmpeg": "kolsky[film]",
    "nicegui": "kolsky[app]",
    "emcee": "kolsky[bayes]",
    "pyamg": "kolsky[amg]",
}
"""Name for pip of the distribution, or the extra of this package, that provides a module."""

LONGEST_PLACE = 300
"""Largest number of characters of a name in a message."""
SIGNAL_CODE = 128
"""Exit code of a command that was ended by a signal, minus the signal's number, as in shells."""

REPEAT_AFTER = 0.05
"""Time after which a signal is repeated if its exception was ignored [s]."""


def _ending(received: list[int]) -> Callable[[int, FrameType | None], None]:
    """Handler of a signal that ends the command. It raises an exception, and every block cleans up."""

    def end(number: int, frame: FrameType | None) -> None:
        received.append(number)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(SIGNAL_CODE + number)

    return end


def _repeat_ignored_signals(received: list[int]) -> None:
    """Repeat a signal if Python ignores its exception, as in a finaliser. No message is printed."""
    ordinary = sys.unraisablehook

    def repeat(event: "sys.UnraisableHookArgs") -> None:
        if received and isinstance(event.exc_value, KeyboardInterrupt | SystemExit):
            timer = Timer(REPEAT_AFTER, os.kill, (os.getpid(), received[0]))
            timer.daemon = True
            timer.start()
        else:
            ordinary(event)

    sys.unraisablehook = repeat


TIME_TO_END = 3.0
"""Time for a command to clean up after a signal [s]. A simulation that does not react to signals is then
stopped."""


def _end_in_time() -> None:
    """End the process some seconds after SIGTERM, also in a compiled loop, which blocks the handlers."""
    # The system writes the signal's number into a pipe at once. A thread waits for it.
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    os.register_at_fork(after_in_child=lambda: signal.set_wakeup_fd(-1))  # the pipe is this process's

    def wait() -> None:
        while int(signal.SIGTERM) not in os.read(reading, 64):
            pass
        time.sleep(TIME_TO_END)
        from dic.files import remove_scratch

        remove_scratch()
        os._exit(SIGNAL_CODE + int(signal.SIGTERM))

    Thread(target=wait, daemon=True).start()


def main() -> None:
    """Entry point of the `kolsky` command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # If a terminal lacks a character (± in an old code page), it gets its escape instead of a
            # traceback.
            stream.reconfigure(errors="backslashreplace")
    set_blas_threads()
    received: list[int] = []
    _repeat_ignored_signals(received)
    signal.signal(signal.SIGTERM, _ending(received))
    if os.name == "posix":
        _end_in_time()
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a background job ignores it
        signal.signal(signal.SIGINT, _ending(received))
    try:
        with last_work():
            app()
    except Exception:
        if not received:
            raise
        # While a library is loaded, it may turn the signal's exception into another error.
        raise SystemExit(SIGNAL_CODE + received[0]) from None


def program(commands: Mapping[str, Command]) -> typer.Typer:
    """The command line of a table of commands such as `COMMANDS`."""
    made = typer.Typer(
        name="kolsky",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        help="Dynamic stiffness of a soft material, with its uncertainty, from one impact test.",
    )
    made.callback()(_kolsky)
    groups = {
        name: typer.Typer(name=name, no_args_is_help=True, help=line)
        for name, line in GROUPS.items()
        if any(words.startswith(f"{name} ") for words in commands)
    }
    for words, command in commands.items():
        group, _, name = words.rpartition(" ")
        text = re.sub(r"(?<!\n)\n(?!\n| |- )", " ", inspect.getdoc(command) or "")
        made_of = refusing_bad_input()(with_settings(command))
        (groups[group] if group else made).command(name, help=text)(made_of)
    for group_of_commands in groups.values():
        made.add_typer(group_of_commands)
    return made


@contextmanager
def refusing_bad_input() -> Iterator[None]:
    """Context that turns bad input, a system error or a missing package into lines on stderr, exit code 2."""
    try:
        yield
    except InputError as error:
        words = str(error)
    except ModuleNotFoundError as error:
        source = BROUGHT_BY.get((error.name or "").partition(".")[0])
        if source is None:
            raise
        words = f"this needs the package {error.name}: pip install '{source}'"
    except OSError as error:
        if error.errno is None or isinstance(error, BrokenPipeError):
            raise
        words = str(of_system(error))
    except MemoryError:
        cure = "use a coarser mesh, fewer runs at once, or a machine with more memory"
        words = f"there is not enough memory. Cure: {cure}"
    else:
        return
    typer.echo(words, err=True)
    raise typer.Exit(2)


def of_system(error: OSError) -> InputError:
    """Input error for a system error (full disk, long name, folder without access) with the remedy."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        cure = "make room, or give another place with --out FOLDER; earlier results are unchanged"
    elif error.errno == errno.ENAMETOOLONG:
        cure = "give a shorter name"
    elif error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        cure = "give yourself read and write access, or copy it to a folder where you have it"
    else:
        cure = "check the file or folder that it names"
    place = str(error.filename) if error.filename is not None else "the disk"
    shown = place if len(place) <= LONGEST_PLACE else f"{place[:LONGEST_PLACE]}..."
    return InputError(shown, f"cannot be used: {error.strerror}", cure=cure)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version

        try:
            typer.echo(f"kolsky {version('kolsky')}")
        except PackageNotFoundError:
            typer.echo("kolsky, not installed (running from its source folder)")
        raise typer.Exit


def _kolsky(
    version: Annotated[
        bool,
        typer.Option(
            "--version", "-V", callback=_show_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    pass


app = program(COMMANDS)
