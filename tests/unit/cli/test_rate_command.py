"""`kolsky rate` from folders of shots to its files, and its error messages."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kolsky_command import run_kolsky
from ratedshots import found
from shot_folders import OPEN_01, shot_in

from kolsky.results.hdf5 import write_identification
from kolsky.shot.load import load_shot
from kolsky.studies.rates.rate import collected_shot, declarations, group_key, group_of

EVIL = "<script>x</script> ../../up"


def identified(folder: Path, name: str, m: float, share: float, *, lines: str = "", rate: str = "") -> Path:
    """A copy of open-01 whose flyer moves by a share of its way, with a made-up result."""
    changes = [("format = 1\n", f'format = 1\nname = "{name}"\n{lines}')]
    if rate:
        changes += [("relative_sigma", f'strain_rate = "{rate}"\nrelative_sigma')]
    shot_in(folder, *changes)
    rows = (folder / "flyer.csv").read_text("utf-8").splitlines()
    cells = [row.split(",") for row in rows[1:]]
    moved = [f"{number},{time},{share * float(way):.5f}" for number, time, way in cells]
    (folder / "flyer.csv").write_text("\n".join([rows[0], *moved]) + "\n", "utf-8")
    result(folder, name, m)
    return folder


def result(folder: Path, name: str, m: float) -> None:
    """A made-up result of a shot's present files."""
    shot = load_shot(folder)
    made = found(name, m, parts={"force and shape": 0.004, "material curve": 0.002}, numerical=0.001)
    said = {
        **made.provenance,
        "inputs": shot.inputs,
        "specimen": vars(shot.specimen),
        "window_s": list(shot.window),
    }
    (folder / "results").mkdir(exist_ok=True)
    write_identification(folder / "results" / "identification.h5", replace(made, provenance=said))


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    root = tmp_path_factory.mktemp("rates")
    made = [("a", 1.12, 1.0), (EVIL, 1.13, 0.9), ("c", 1.11, 0.8)]
    return [
        identified(root / f"s{i}", name, m, share, lines='material = "gel"\n', rate="0.03 1/s")
        for i, (name, m, share) in enumerate(made)
    ]


@pytest.fixture(scope="module")
def whole(shots, tmp_path_factory: pytest.TempPathFactory):
    out = tmp_path_factory.mktemp("out") / "deep" / "rates"
    said = run_kolsky("rate", *shots, "--out", out, "--json", "--strains", "0.1,0.3")
    return out, json.loads(said.stdout), said.stderr


def test_one_object_on_stdout(whole):
    out, said, stderr = whole
    (group,) = said["groups"]
    assert said["grouped_by"] == "material"
    assert group["group"] == "gel"
    assert [shot["shot"] for shot in group["shots"]] == ["c", EVIL, "a"]
    assert f"page       {out / 'rates.html'}" in stderr
    # Three shots at rates within a quarter of each other carry nothing.
    assert group["verdict"].startswith("not testable: there are 3 shots, 4 needed")
    # noise of 1 um
    assert group["span of the rates (decade)"] == pytest.approx(np.log10(1.0 / 0.8), abs=2e-3)
    assert group["decades to the quasi-static rate"] == pytest.approx(4.1, abs=0.1)


def test_the_rate_is_that_of_the_recorded_motion(whole):
    table = np.loadtxt(OPEN_01 / "flyer.csv", delimiter=",", skiprows=1)
    time, strain = table[:, 1], table[:, 2] / 6.5
    first = int(np.argmax(strain > 0.01))
    last = int(np.argmax(time > 1.4625e-3 + 1e-9)) or len(time)
    chord = (strain[last - 1] - strain[first]) / (time[last - 1] - time[first])
    shot = whole[1]["groups"][0]["shots"][2]
    # The frame after 1 % strain instead of the moment itself: 1 of 170 frames.
    assert shot["nominal strain rate (1/s)"] == pytest.approx(chord, rel=5e-3)


def test_the_files_are_where_they_were_asked_for(whole, shots):
    out = whole[0]
    names = {path.name for path in out.iterdir()}
    assert {"rates.json", "rates.html", "rate_shots.csv", "rate_stiffness.csv"} <= names
    assert all(path.is_file() for path in out.iterdir())
    assert list(out.parent.iterdir()) == [out]
    page = (out / "rates.html").read_text("utf-8")
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert not any((shot / "results" / "rates.json").exists() for shot in shots)


def test_groups_by_any_key_of_the_shot_file(shots):
    files = [declarations(shot)[0] for shot in shots]
    assert group_key(files, None) == "material"
    assert group_key(files, "interface.faces") == "interface.faces"
    assert group_of(files[0], "interface.faces") == "bonded"
    assert group_of(files[0], "model.poisson") == "0.499"
    assert group_of(files[0], "") == "all shots"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--group", "specimen.colour"], "has no 'specimen.colour' to group the shots by"),
        (["--group", "specimen"], "is a table or list"),
        (["--strains", "0.1,1.2"], "numbers between 0 and 1"),
        (["--strains", ""], "numbers between 0 and 1"),
        (["--figures", "gif"], "--figures"),
    ],
)
def test_options_that_cannot_be_used(shots, tmp_path, words, message):
    said = run_kolsky("rate", *shots, *words, "--out", tmp_path / "r", code=2)
    assert message in said.stderr
    assert not (tmp_path / "r").exists()


def test_a_shot_without_a_result_is_refused_with_the_cure(shots, tmp_path):
    bare = identified(tmp_path / "bare", "bare", 1.1, 1.0, lines='material = "gel"\n')
    shutil.rmtree(bare / "results")
    said = run_kolsky("rate", *shots, bare, "--out", tmp_path / "r", code=2)
    assert "there is no result of this shot" in said.stderr
    assert f"`kolsky identify {bare}` writes one" in said.stderr


def test_a_result_of_other_recordings_is_refused(shots, tmp_path):
    stale = identified(tmp_path / "stale", "stale", 1.1, 1.0, lines='material = "gel"\n')
    curve = stale / "quasi_static.csv"
    curve.write_text(curve.read_text("utf-8").replace("-7.4598e+02", "-7.4599e+02"), "utf-8")
    said = run_kolsky("rate", stale, "--out", tmp_path / "r", code=2)
    assert "was made of another quasi_static.csv than the shot has now" in said.stderr
    changed = identified(tmp_path / "changed", "changed", 1.1, 1.0)
    text = (changed / "shot.toml").read_text("utf-8")
    (changed / "shot.toml").write_text(text.replace('length = "6.5 mm"', 'length = "6.6 mm"', 1), "utf-8")
    said = run_kolsky("rate", changed, "--out", tmp_path / "r", code=2)
    assert "another specimen or window" in said.stderr


def test_a_group_may_be_added_after_the_identification(tmp_path):
    late = identified(tmp_path / "late", "late", 1.1, 1.0)
    text = (late / "shot.toml").read_text("utf-8")
    (late / "shot.toml").write_text(text.replace("format = 1\n", 'format = 1\ngroup = "b"\n', 1), "utf-8")
    file, _ = declarations(late)
    assert group_key([file], None) == "group"
    assert collected_shot(late, group=group_of(file, "group")).group == "b"


@pytest.mark.slow
def test_the_script_writes_the_same(shots, whole, tmp_path):
    script = Path(__file__).resolve().parents[3] / "runs" / "rate_report.py"
    words = [sys.executable, "-W", "error", script, *shots]
    said = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert said.stdout.startswith("gel: 3 shots count\n  m = 1.1")
    for name in ("rate_shots.csv", "rate_groups.csv", "rate_leave_one_out.csv"):
        assert (tmp_path / "rates" / name).read_bytes() == (whole[0] / name).read_bytes()


def test_two_shots_of_one_name_are_refused(shots, tmp_path):
    said = run_kolsky("rate", shots[0], shots[0], "--out", tmp_path / "r", code=2)
    assert "another shot is called 'a' too" in said.stderr


def test_a_damaged_result_is_one_line(shots, tmp_path):
    bad = identified(tmp_path / "bad", "bad", 1.1, 1.0)
    (bad / "results" / "identification.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 64)
    said = run_kolsky("rate", bad, "--out", tmp_path / "r", code=2)
    assert said.stderr.count("\n") == 1
    assert "identification.h5" in said.stderr


@pytest.mark.parametrize("line", ['rig = ""', "rig = 3", 'strain_rate = "0.03 1/s"'])
def test_impossible_declarations_are_refused(tmp_path, line):
    shot = shot_in(tmp_path / "shot", ("format = 1\n", f"format = 1\n{line}\n"))
    said = run_kolsky("check", shot, code=2)
    assert line.split()[0] in said.stderr
