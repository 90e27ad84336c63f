"""The commands of the tutorials, run as they are printed but on tiny meshes, so that no tutorial rots.

Run are the blocks of shell whose first line is `# tutorial`, page by page, in a folder with a copy of `runs`.
`kolsky` and `python` are there stand-ins that hand the words on and add the meshes. `kolsky dic` on a whole
shot takes too long here and is not marked; tests/validation/test_dic_chain.py runs it on the same pictures.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
BLOCK = re.compile(r"^```sh\n# tutorial\n(.*?)^```$", re.MULTILINE | re.DOTALL)
KOLSKY = """#!/bin/bash
case $1 in
    identify) set -- "$@" --mesh 12x16 --refined-mesh 16x22 --replicates 0 ;;
    simulate | sweep) set -- "$@" --mesh 12x16 ;;
esac
exec "{python}" -m kolsky.cli "$@"
"""
PYTHON = """#!/bin/bash
case $1 in
    runs/per_shot.py) set -- "$1" "$2" 12x16 16x22 ;;
    runs/rate_shots.py) set -- "$1" "$2" "$3" "${{@: -1}}" ;;
esac
exec "{python}" "$@"
"""
FINE = 'Numerics(mesh=(48, 64), element="fbar")'
"""What `runs/rate_shots.py` makes its shots with."""
WRITTEN = {
    "first_shot": "runs/open-01/results/report.html",
    "vic3d_export": "gel-17/results/report.html",
    "rate_study": "rates/rates.html",
    "gpu_sweep": "sweep-folder/sweep.html",
    "pictures": "my-pictures/shot.toml",
}
"""What the last command of a page has left behind."""


@pytest.fixture
def workplace(tmp_path: Path) -> Path:
    """A folder with the scripts, the shipped shot and the stand-ins."""
    shutil.copytree(ROOT / "runs", tmp_path / "runs", ignore=shutil.ignore_patterns("results"))
    script = tmp_path / "runs" / "rate_shots.py"
    text = script.read_text(encoding="utf-8")
    assert FINE in text
    script.write_text(text.replace(FINE, "Numerics(mesh=(16, 22))"), encoding="utf-8")
    (tmp_path / "bin").mkdir()
    for name, words in (("kolsky", KOLSKY), ("python", PYTHON)):
        stand_in = tmp_path / "bin" / name
        stand_in.write_text(words.format(python=sys.executable), encoding="utf-8")
        stand_in.chmod(0o755)
    return tmp_path


def test_every_page_has_commands_and_an_end():
    assert {page.stem for page in PAGES} == set(WRITTEN)
    for page in PAGES:
        assert BLOCK.search(page.read_text(encoding="utf-8")), page.name


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial(page, workplace, request):
    if page.stem == "pictures":
        shot = request.getfixturevalue("shared") / "data" / "shots" / "open-01"
        if not shot.is_dir():
            pytest.skip("no pictures of open-01 in the folder 'shared': they are not shipped")
        (workplace / "my-pictures").mkdir()
        for name in ("cam0.tif", "cam1.tif", "scope.csv", "frames.csv", "quasi_static.csv"):
            (workplace / "my-pictures" / name).symlink_to(shot / name)
        shutil.copytree(shot / "calibration", workplace / "my-pictures" / "calibration")
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    found = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    path = f"{workplace / 'bin'}{os.pathsep}{os.environ['PATH']}"
    ran = subprocess.run(
        ["bash", "-e", "-c", "".join(blocks)],
        cwd=workplace,
        env={**os.environ, "PATH": path, "PYTHONPATH": found},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == 0, f"{ran.stdout[-2000:]}\n{ran.stderr[-2000:]}"
    assert (workplace / WRITTEN[page.stem]).is_file()
