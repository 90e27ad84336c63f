"""Weight of a fresh installation and the time to the first answer: `python -m benchmarks.install`.

    python -m benchmarks.install                         # this Python, the package without extras
    python -m benchmarks.install --python python3.13 --extras notebook scene
    python -m benchmarks.install --wheel                 # from a wheel, as a package index would give it

Makes a virtual environment in a folder that is thrown away, installs the package, prints the size on disk of
the whole and of its largest parts, and the seconds of `kolsky --help` and of `kolsky identify runs/open-01`
with an empty cache of kernels. Ends with exit code 1 if the environment is larger than 900 MB, or creation,
installation and the answer together take longer than 2 minutes. Sizes are those of files [MB = 10^6 bytes].
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LARGEST = 900.0
"""Allowed size of an environment without extras [MB]."""
LONGEST = 120.0
"""Allowed time from nothing to the first answer [s]."""
SHOWN = 8
"""Number of parts that are printed."""


def size(place: Path) -> float:
    """Size of the files of a folder, or of a file [MB]; links are not followed."""
    if place.is_dir() and not place.is_symlink():
        return sum(size(inside) for inside in place.iterdir())
    return place.lstat().st_size / 1e6


def largest(folder: Path, count: int = SHOWN) -> list[tuple[str, float]]:
    """The largest entries of a folder with their sizes [MB]."""
    parts = [(inside.name, size(inside)) for inside in folder.iterdir()]
    return sorted(parts, key=lambda part: -part[1])[:count]


def _timed(*command: str | Path, **environment: str) -> float:
    """Run a command, its output on stderr, and return its seconds."""
    started = time.perf_counter()
    env = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"} | environment
    subprocess.run([str(part) for part in command], check=True, stdout=sys.stderr, env=env)
    return time.perf_counter() - started


def main(given: Sequence[str] | None = None) -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", default=sys.executable, help="interpreter of the environment")
    parser.add_argument("--extras", nargs="*", default=[], help="extras to install too")
    parser.add_argument("--wheel", action="store_true", help="build a wheel first and install that")
    parser.add_argument("--no-run", action="store_true", help="leave the identification out")
    options = parser.parse_args(given)
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        # A copy: the build leaves its folders beside the sources.
        shutil.copytree(ROOT, place / "kolsky", ignore=shutil.ignore_patterns(".*", "build", "*.egg-info"))
        source: Path = place / "kolsky"
        seconds = {"environment": _timed(options.python, "-m", "venv", place / "venv")}
        pip = (place / "venv" / "bin" / "python", "-m", "pip")
        if options.wheel:
            _timed(*pip, "wheel", "-q", "--no-deps", "-w", place / "wheels", source)
            source = next((place / "wheels").glob("kolsky-*.whl"))
        extras = f"[{','.join(options.extras)}]" if options.extras else ""
        seconds["install"] = _timed(*pip, "install", "-q", f"{source}{extras}")
        program = place / "venv" / "bin" / "kolsky"
        seconds["kolsky --help"] = _timed(program, "--help", WARP_CACHE_PATH=f"{place}/cache")
        if not options.no_run:
            out = ("--out", place / "results")
            seconds["kolsky identify runs/open-01"] = _timed(
                program, "identify", ROOT / "runs" / "open-01", *out, WARP_CACHE_PATH=f"{place}/cache"
            )
        whole = size(place / "venv")
        packages = next((place / "venv" / "lib").glob("python*/site-packages"))
        for name, megabytes in largest(packages):
            print(f"{megabytes:8.0f} MB  {name}")
    print(f"{whole:8.0f} MB  whole environment (allowed: {LARGEST:.0f} MB without extras)")
    for name, taken in seconds.items():
        print(f"{taken:8.1f} s   {name}")
    total = sum(seconds.values())
    print(f"{total:8.1f} s   together (allowed: {LONGEST:.0f} s)")
    return int((whole > LARGEST and not options.extras) or total > LONGEST)


if __name__ == "__main__":
    raise SystemExit(main())
