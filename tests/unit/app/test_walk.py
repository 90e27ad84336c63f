"""`kolsky open` in a browser, from raw files to m: `AUDIT=FOLDER pytest --long tests/unit/app/test_walk.py`.

FOLDER has `npm install axe-core puppeteer-core` behind it; CHROMIUM names the browser. PICTURES names a
folder that gets the pictures of the how-to.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from laboratory_files import TYPED, laboratory
from speckle_pictures import plane

from kolsky.results.hdf5 import read_identification

OPTIONS = ["--mesh", "12x16", "--refined-mesh", "16x22", "--replicates", "2", "--threads", "1"]
"""A coarse mesh: a minute for an answer, whose interval is 1.136 ± 0.017; the truth is 1.12."""
PICTURES = ("shots", "setup", "run", "look", "pictures", "compare")


def served(root: Path) -> tuple[subprocess.Popen[str], str]:
    """The server over a folder, and the address that it prints."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    words = [sys.executable, "-m", "kolsky.cli", "open", str(root), "--no-browser", "--port", str(port)]
    outside = {
        key: value for key, value in os.environ.items() if not key.startswith("PYTEST")
    }  # a user's own
    server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=outside)
    assert server.stdout is not None
    server.stdout.readline()
    url = server.stdout.readline().strip()
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return server, url
        time.sleep(0.1)
    raise AssertionError("the server does not answer")


@pytest.mark.long
def test_from_raw_files_to_the_answer_without_an_editor(tmp_path: Path) -> None:
    audit = os.environ.get("AUDIT")
    if audit is None:
        pytest.skip("AUDIT names no folder with node_modules")
    root, out = tmp_path / "root", tmp_path / "out"
    out.mkdir()
    laboratory(root / "shot5")
    plane(root / "plane")
    shutil.copy(root / "plane" / "dic.toml", root / "plane" / "frames.csv")  # a table, so that it is listed
    (root / "plane" / "frames.csv").write_text("frame,time (s)\n0,0\n1,1\n2,2\n", encoding="utf-8")
    typed: list[tuple[str, str]] = []
    for key, toml in TYPED.items():
        value = json.loads(toml)
        typed += (
            [(f"{key}.{i}", v) for i, v in enumerate(value)]
            if isinstance(value, list)
            else [(key, str(value))]
        )
    (out / "typed.json").write_text(json.dumps(typed), encoding="utf-8")
    server, url = served(root)
    try:
        surroundings = {**os.environ, "NODE_PATH": f"{audit}/node_modules", "OPTIONS": " ".join(OPTIONS)}
        script = Path(__file__).with_name("walk.js")
        done = subprocess.run(
            ["node", script, url, out, root],
            env=surroundings,
            capture_output=True,
            text=True,
            timeout=900,
            check=False,
        )
    finally:
        server.terminate()
        server.wait(20.0)
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["problems"] == []
    assert found["outside"] == []  # nothing is loaded from a network
    first, last = (float(end.removesuffix(" us")) for end in json.loads(found["baseline"]))
    assert -200.0 <= first < last < 0.0  # it was dragged: the survey's baseline ends after 0
    assert "m = 1.1" in found["log"]
    assert done.returncode == 0
    by_page = read_identification(root / "shot5" / "results" / "identification.h5")
    again = [
        sys.executable,
        "-m",
        "kolsky.cli",
        "identify",
        str(root / "shot5"),
        "--out",
        str(tmp_path / "again"),
    ]
    subprocess.run([*again, *OPTIONS, "--quiet"], check=True)
    by_command = read_identification(tmp_path / "again" / "identification.h5")
    assert by_page.estimates == by_command.estimates  # to the bit
    np.testing.assert_array_equal(by_page.design.points, by_command.design.points)
    if target := os.environ.get("PICTURES"):
        for name in PICTURES:
            shutil.copy(out / f"{name}-1280.png", Path(target) / f"app_{name}.png")
