"""Time in which `kolsky open` lists many shots: the files below a folder, and the page from its server.

    python -m benchmarks.app_shots --json benchmarks/results/app_shots.json

Every shot has a shot file and the summary of a result. The command prints the minimum of `REPEATS`
measurements. It measures the list, the page's table, and a GET of the page, with all files in the system's
cache. It measures processor time, so other work on the machine has little influence. For the page it measures
the server's process (Linux only).
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from http.client import HTTPConnection
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlsplit

from kolsky.app.shots import list_shots, table_row

COUNT = 2000
"""Number of shots in the folder."""
REPEATS = 5
SUMMARY = (
    "stiffness_factor (1),U stiffness_factor (1),verdict stiffness_factor,nominal strain rate (1/s)\n"
    "1.1{i:04d},0.004,identified,{rate}\n"
)


def tree(root: Path, count: int) -> None:
    """Make the folders of a campaign, 50 shots per day, with the shot file of `runs/open-05`."""
    text = (Path(__file__).parents[1] / "runs" / "open-05" / "shot.toml").read_bytes()
    for i in range(count):
        folder = root / f"day {i // 50:03d}" / f"shot {i:04d}"
        (folder / "results").mkdir(parents=True)
        (folder / "shot.toml").write_bytes(text)
        summary = SUMMARY.format(i=i, rate=300 + i % 400)
        (folder / "results" / "summary.csv").write_text(summary, encoding="utf-8")


def least(act: Callable[[], object], clock: Callable[[], float]) -> float:
    """Minimum time of the repeats by a clock [s]."""
    times = []
    for _ in range(REPEATS):
        start = clock()
        act()
        times.append(clock() - start)
    return round(min(times), 3)


def processor_seconds(process: int) -> float:
    """Processor time of another process so far [s]."""
    user, system = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / float(os.sysconf("SC_CLK_TCK"))


def page(root: Path) -> float:
    """Minimum time of a GET of the page from a separate server [s]."""
    words = [sys.executable, "-m", "kolsky.cli", "open", str(root), "--no-browser"]
    server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env={**os.environ})
    try:
        assert server.stdout is not None
        server.stdout.readline()
        url = urlsplit(server.stdout.readline().strip())
        host, token = url.netloc, url.query.partition("=")[2]
        cookie = f"kolsky-{url.port}={token}"

        def get() -> None:
            connection = HTTPConnection(host, timeout=60.0)
            connection.request("GET", "/", headers={"Cookie": cookie})
            text = connection.getresponse().read()
            connection.close()
            if b"shots below" not in text:
                raise RuntimeError("the server did not answer with the page")

        until = time.monotonic() + 60.0
        while True:
            try:
                get()
                break
            except ConnectionRefusedError:
                if time.monotonic() > until:
                    raise
                time.sleep(0.1)
        return least(get, lambda: processor_seconds(server.pid))
    finally:
        server.terminate()
        server.communicate(timeout=30.0)


def main() -> None:
    """Measure and print the times; `--json FILE` stores them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--shots", type=int, default=COUNT)
    given = parser.parse_args()
    with TemporaryDirectory() as place:
        root = Path(place)
        tree(root, given.shots)
        found = {
            "shots": given.shots,
            "list_seconds": least(lambda: list_shots(root), time.process_time),
            "table_seconds": least(lambda: [table_row(one) for one in list_shots(root)], time.process_time),
            "page_seconds": page(root),
        }
    print(json.dumps(found, indent=1))
    if given.json is not None:
        given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
