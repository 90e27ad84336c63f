"""`kolsky open` in a browser, from raw files to m: `AUDIT=FOLDER pytest --long tests/unit/app/test_walk.py`.

FOLDER has `npm install axe-core puppeteer-core` behind it; CHROMIUM names the browser. PICTURES names a
folder that gets the pictures and the film of the how-to.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from laboratory_files import TYPED, laboratory
from PIL import Image, ImageDraw, ImageFont
from served import served
from speckle_pictures import plane

from kolsky.results.hdf5 import read_identification

OPTIONS = ["--mesh", "12x16", "--refined-mesh", "18x24", "--replicates", "2"]
"""Coarse meshes: 40 s of a processor for an answer, 1.129 ± 0.015; the truth is 1.12."""
COARSER = ["--mesh", "12x16", "--refined-mesh", "16x22", "--replicates", "2"]
"""Of the shot that is only compared."""
PICTURES = ("shots", "setup", "run", "look", "pictures", "fields", "compare")
FILM = (800, 532)
"""Columns and rows of the film [px], the caption included."""


@pytest.mark.long
def test_from_raw_files_to_the_answer_without_an_editor(tmp_path: Path) -> None:
    audit = os.environ.get("AUDIT")
    if audit is None:
        pytest.skip("AUDIT names no folder with node_modules")
    root, out = tmp_path / "root", tmp_path / "out"
    out.mkdir()
    laboratory(root / "shot5")
    plane(root / "plane")
    typed: list[tuple[str, str]] = []
    for key, toml in TYPED.items():
        value = json.loads(toml)
        typed += (
            [(f"{key}.{i}", v) for i, v in enumerate(value)]
            if isinstance(value, list)
            else [(key, str(value))]
        )
    (out / "typed.json").write_text(json.dumps(typed), encoding="utf-8")
    with served(root) as (server, url):
        own = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST")}
        own |= {
            "NODE_PATH": f"{audit}/node_modules",
            "OPTIONS": " ".join(OPTIONS),
            "COARSER": " ".join(COARSER),
            "SERVER": json.dumps({"process": server.pid, "words": server.args}),
        }
        script = Path(__file__).with_name("walk.js")
        done = subprocess.run(
            ["node", script, url, out, root],
            env=own,
            capture_output=True,
            text=True,
            timeout=2400,
            check=False,
        )
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["problems"] == []
    assert found["outside"] == []  # nothing is loaded from a network
    first, last = (float(end.removesuffix(" us")) for end in json.loads(found["baseline"]))
    assert -200.0 <= first < last < 0.0  # it was dragged: the survey's baseline ends after 0
    assert found["states"]["tabs"] == ["6.6 mm", "870 kg/m^3"]  # of the other tab, not of the refused one
    assert found["states"]["undone"] == ["6.5 mm", "870 kg/m^3"]
    state = found["states"]["afterKill"].split(": ")[1]
    assert state in ("running", "finished")  # the run went on meanwhile
    assert "m = 1.1" in found["log"]
    assert "force explained" in found["log"]
    assert found["states"]["report"] == [200, "shot5: identification"]
    # Three quarters along the picture u = 1e-2 x^2 / 64 from its middle has a slope of 1 %; noise, subsets.
    assert float(found["states"]["point"].split()[2]) == pytest.approx(1.0, abs=0.3)
    assert found["states"]["filtered"] == ["shot5, longer"]
    assert found["hostile"] == {
        "read": "refused",
        "read blindly": "refused",
        "post": "refused",
        "websocket": "refused",
        "frame": "refused",
        "another name": "status 403",
    }
    assert done.returncode == 0
    assert (root / "plane" / "results" / "dic.h5").is_file()
    _same_by_command(root / "shot5", tmp_path / "out2")
    if target := os.environ.get("PICTURES"):
        for name in PICTURES:
            _small(out / f"{name}-1280.png", Path(target) / f"app_{name}.png")
        _write_film(out, found["film"], Path(target) / "app_walk.webp")


def _same_by_command(shot: Path, out: Path) -> None:
    """The same shot.toml gives the same bits by the command line."""
    words = [
        sys.executable, "-m", "kolsky.cli", "identify", str(shot), "--out", str(out), "--quiet", *OPTIONS,
    ]  # fmt: skip
    subprocess.run(words, check=True)
    by_page = read_identification(shot / "results" / "identification.h5")
    by_command = read_identification(out / "identification.h5")
    assert by_page.estimates == by_command.estimates
    np.testing.assert_array_equal(by_page.design.points, by_command.design.points)
    for name in ("force.csv", "profile.csv", "summary.csv"):
        assert (shot / "results" / name).read_bytes() == (out / name).read_bytes()


def _small(source: Path, target: Path) -> None:
    """A picture of a page in 256 colours: a third of the bytes."""
    with Image.open(source) as image:
        image.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(target, optimize=True)


def _write_film(out: Path, pictures: Sequence[tuple[str, str, float]], target: Path) -> None:
    """The pictures with their captions, one after the other, as an animated WebP that is shown twice."""
    frames = []
    font = ImageFont.load_default(19)
    for name, words, _ in pictures:
        frame = Image.new("RGB", FILM, "#0072b2")
        with Image.open(out / name) as image:
            seen = image.convert("RGB").crop((0, 0, 1280, 800))
            frame.paste(seen.resize((800, 500), Image.Resampling.LANCZOS), (0, 0))
        ImageDraw.Draw(frame).text((14, 505), words, fill="white", font=font)
        frames.append(frame)
    durations = [round(1000.0 * seconds) for _, _, seconds in pictures]
    frames[0].save(
        target, save_all=True, append_images=frames[1:], duration=durations, loop=2, quality=55, method=6
    )
