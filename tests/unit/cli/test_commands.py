"""`kolsky identify`, `simulate` and `sweep` end to end on tiny meshes, and their error messages."""

import errno
import json
import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
import typer
from damaged_shots import BAD
from kolsky_command import json_of, rows_of, run_kolsky
from rich.text import Text
from shot_folders import FILES, OPEN_01, QUICK, ROOT, TINY, shot_in, state
from synthetic import synthetic
from typer.testing import CliRunner

from dic.basics import OpenCVMissing, cv2
from kolsky.base.errors import InputError
from kolsky.base.files import filling, usable_folder
from kolsky.base.process import single_threaded_libraries
from kolsky.cli import doctor
from kolsky.cli.commandline import BROUGHT_BY, app, refusing_bad_input
from kolsky.cli.doctor import OPTIONAL, REQUIRED, examine
from kolsky.inverse.result import Declaration, Verdict
from kolsky.results import numbers, printed
from kolsky.results.hdf5 import read_identification

runner = CliRunner()


# The whole way, once


@pytest.fixture(scope="module")
def identified(tmp_path_factory: pytest.TempPathFactory):
    folder = shot_in(tmp_path_factory.mktemp("identified") / "shot")
    result = run_kolsky("identify", folder, *QUICK, "--figures", "csv", "--json")
    return folder, result


def test_json_is_the_only_thing_on_stdout(identified) -> None:
    folder, result = identified
    said = json.loads(result.stdout)  # fails on anything before or after the object
    m = said["stiffness_factor"]
    assert {"value", "interval", "sigma", "outcome"} <= set(m)
    assert m["interval"] == pytest.approx([m["value"] - 2 * m["sigma"], m["value"] + 2 * m["sigma"]])
    # Meshes of 8 x 11 and 12 x 16 are too soft by some percent, more than two of them can extrapolate: the
    # interval is of that size, and the truth less than another half of it outside.
    assert abs(m["value"] - 1.12) < 3.0 * m["sigma"] < 0.1
    assert m["mesh_shift"] < 0.0
    assert said["shot"] == folder.name
    assert f"report     {folder / 'results' / 'report.html'}" in result.stderr
    assert re.search(r"wall time  \d+\.\d s", result.stderr)


def test_warnings_are_the_same_everywhere(identified) -> None:
    folder, result = identified
    said = json.loads(result.stdout)["warnings"]
    assert any("strained past the quasi-static curve" in text for text in said)
    assert any("the mesh contributes most" in text for text in said)
    assert [line for line in result.stderr.splitlines() if line.startswith("warning: ")] == [
        f"warning: {text}" for text in said
    ]
    assert list(read_identification(folder / "results" / "identification.h5").warnings) == said
    page = (folder / "results" / "report.html").read_text("utf-8")
    (box,) = re.findall(r'<div class="warnings".*?</div>', page, re.DOTALL)
    assert box.count("<li>") == len(said)


def test_results_are_complete_and_inputs_untouched(identified) -> None:
    folder, _ = identified
    for name in FILES:
        assert (folder / name).read_bytes() == (OPEN_01 / name).read_bytes()
    assert sorted(p.name for p in folder.iterdir()) == sorted([*FILES, "results"])
    made = sorted(p.name for p in (folder / "results").iterdir())
    tables = ["design.csv", "energy.csv", "force.csv", "profile.csv", "summary.csv"]
    assert made == sorted([*tables, "figures", "identification.h5", "report.html"])
    drawn = {p.suffix for p in (folder / "results" / "figures").iterdir()}
    assert drawn == {".csv"}


def test_the_report_has_words_for_every_key(identified) -> None:
    folder, _ = identified
    page = (folder / "results" / "report.html").read_text("utf-8")
    headings = re.findall(r'<th scope="row">([^<]*)</th>', page.split('id="trust"')[0])
    assert len(headings) > 40
    assert not [words for words in headings if "_" in words]


def test_simulate(shot: Path) -> None:
    arguments = ["simulate", str(shot), *TINY, "-p", "stiffness_factor=1.12", "-p", "damping=25 us", "--vtu"]
    said = json_of(*arguments)
    assert said["parameters"] == pytest.approx({"stiffness_factor": 1.12, "damping": 25e-6})
    assert said["outcome"] == "COMPLETED"
    assert said["energy_imbalance"] < 1e-3
    assert 0.0 < said["artificial_energy"] < 0.01
    folder = shot / "results" / "simulation"
    assert said["folder"] == str(folder)
    assert (folder / "mesh.pvd").exists()
    rows = rows_of(folder / "force.csv")
    misfit = [abs(float(r["simulated force (N)"]) - float(r["measured force (N)"])) for r in rows]
    # Eq. (M.4) from the written table, nine digits a value.
    assert sum(misfit) == pytest.approx(said["phi_force"], rel=1e-6)
    outline = rows_of(folder / "profile.csv")
    assert len(outline) == said["n_shape"] + said["n_outside"]


def test_simulate_for_people(shot: Path) -> None:
    result = run_kolsky("simulate", shot, *TINY, "-p", "friction=0.5")
    assert "parameters          friction = 0.5" in result.stdout
    assert re.search(r"wall time +\d", result.stdout)
    assert "Coulomb's law replaced the interface" in result.stderr


def test_simulate_with_another_element(shot: Path) -> None:
    arguments = ["simulate", str(shot), *TINY, "--json"]
    chosen = ([], ["--element", "fbar"], ["--hourglass", "viscous"])
    found = [runner.invoke(app, [*arguments, *extra]) for extra in chosen]
    assert [result.exit_code for result in found] == [0, 0, 0], found[-1].stderr
    default, full, viscous = (json.loads(result.stdout) for result in found)
    assert full["artificial_energy"] == 0.0
    assert 0.0 < viscous["artificial_energy"] != default["artificial_energy"]
    for other in (full, viscous):  # another answer on a coarse mesh, by some per cent of the misfit
        assert other["phi_force"] != default["phi_force"]
        assert other["phi_force"] == pytest.approx(default["phi_force"], rel=0.2)


def test_simulate_nearly_incompressible(shot: Path) -> None:
    arguments = ["simulate", str(shot), "--mesh", "12x16", "--json", "-p", "poisson=0.4999"]
    found = [runner.invoke(app, [*arguments, *extra]) for extra in ([], ["--nearly-incompressible"])]
    assert [result.exit_code for result in found] == [0, 0], found[1].stderr
    direct, corrected = (json.loads(result.stdout) for result in found)
    assert corrected["steps"] < 0.3 * direct["steps"]  # those at nu = 0.495: sqrt(50) in the limit
    # At 0.495 Phi_S is 40 % larger; the correction leaves a tenth of that on so coarse a mesh.
    assert corrected["phi_shape"] == pytest.approx(direct["phi_shape"], rel=0.04)
    assert corrected["extrapolated_share"] == pytest.approx(direct["extrapolated_share"], abs=0.03)


def test_nearly_incompressible_has_its_limits(shot: Path) -> None:
    for arguments, words in (
        (["--mesh", "12x16", "-p", "poisson=0.49"], "poisson must be above compressible = 0.495, got 0.49"),
        (TINY, "needs 12 elements or more across the radius, got 8"),
    ):
        result = run_kolsky("simulate", shot, *arguments, "--nearly-incompressible", code=2)
        assert words in " ".join(result.stderr.split())


def test_sweep(shot: Path) -> None:
    arguments = [
        "sweep", str(shot), *TINY, "--vary", "stiffness_factor=1:1.3:3", "--vary", "damping=0:50 us:2",
    ]  # fmt: skip
    said = json_of(*arguments)
    assert (said["runs"], said["completed"], said["warnings"]) == (6, 6, [])
    rows = rows_of(shot / "results" / "sweep.csv")
    assert [float(r["stiffness_factor (1)"]) for r in rows] == [1.0, 1.0, 1.15, 1.15, 1.3, 1.3]
    assert [float(r["damping (s)"]) for r in rows] == pytest.approx([0.0, 5e-5] * 3)
    phi = [float(r["Phi_F (N)"]) / 1000.0 + float(r["Phi_S (1)"]) / 0.001 for r in rows]  # Eq. (M.5)
    np.testing.assert_allclose([float(r["Phi (1)"]) for r in rows], phi, rtol=1e-7)  # nine digits
    assert said["smallest_phi"] == pytest.approx(min(phi))
    assert said["at"]["stiffness_factor"] == float(rows[int(np.argmin(phi))]["stiffness_factor (1)"])
    assert said["surface_optimum"] is not None or said["no_surface"]


def test_random_sweeps_repeat_with_their_seed(shot: Path) -> None:
    arguments = ["sweep", str(shot), *TINY, "--design", "sobol", "--runs", "4", "--vary", "friction=0.1:0.6"]
    written = []
    for seed in ("7", "7", "8"):
        result = run_kolsky(*arguments, "--seed", seed)
        assert "completed" in result.stdout
        written.append((shot / "results" / "sweep.csv").read_bytes())
    assert written[0] == written[1] != written[2]


def test_sweep_over_the_release_stress(shot: Path) -> None:
    file = shot / "shot.toml"
    text = file.read_text("utf-8").replace('faces = "bonded" ', 'faces = "bonded_release" ')
    file.write_text(text.replace("# friction = 0.3 ", 'release_stress = "50 kPa" '), "utf-8")
    assert json_of("sweep", shot, *TINY, "--vary", "release_stress=0:100 kPa:2")["completed"] == 2
    rows = rows_of(shot / "results" / "sweep.csv")
    assert [float(r["release_stress (Pa)"]) for r in rows] == [0.0, 1e5]
    assert float(rows[0]["Phi_F (N)"]) > 1.01 * float(rows[1]["Phi_F (N)"])  # the shot's faces were bonded


@pytest.mark.parametrize(
    ("more", "words"),
    [([], "(faces bonded, side bonded): choose the law"), (["-p", "friction=0.3"], "together with friction")],
)
def test_a_release_stress_without_effect_is_refused(more: list[str], words: str, shot: Path) -> None:
    result = run_kolsky("simulate", shot, *TINY, "-p", "release_stress=20 kPa", *more, code=2)
    assert "release_stress has no effect" in result.stderr
    assert words in result.stderr


# What a terminal shows


def test_the_first_line_is_the_answer_and_no_line_wraps() -> None:
    found = synthetic(("stiffness_factor", "damping"))
    m, beta = found.estimates.values()
    # u = hypot(0.0019, 0.0016) = 0.00248 and hypot(0.4, 0.1) = 0.412 us, twice of each.
    assert printed.answer(m) == "m = 1.1200 ± 0.0050 (k = 2)"
    assert printed.answer(beta) == "beta = 25.00 ± 0.82 us (k = 2)"
    lines = numbers.columns(printed.details(found))
    assert max(map(len, lines)) <= 80
    said = [" ".join(line.split()) for line in lines]  # the longest name decides where the values stand
    assert "m, interval 1.1150 to 1.1250" in said
    assert "beta (us), interval 24.18 to 25.82" in said
    assert all(character.isascii() for line in lines for character in line.replace("±", ""))


def test_the_variance_is_shared_among_its_sources() -> None:
    found = synthetic()
    e = found.estimates["stiffness_factor"]
    for name, value in {"sigma_noise": 1.0, "sigma_numerical": 2.0, "sigma_systematic": 5.0}.items():
        object.__setattr__(e, name, value)
    inputs = [
        Declaration(key, sigma=0.01, unit="1", shifts={"stiffness_factor": shift}, status="varied")
        for key, shift in {"curve_scale": -4.0, "specimen_length": 3.0}.items()
    ]
    object.__setattr__(found, "systematic", tuple(inputs))
    # 1 + 4 + 16 + 9 = 30 = 1 + 2^2 + 5^2, the variance of the answer
    assert printed.variance_shares(found, "stiffness_factor") == pytest.approx(
        {"curve_scale": 16 / 30, "specimen_length": 9 / 30, "mesh and step": 4 / 30, "noise": 1 / 30}
    )
    rows = printed.summary(found)
    assert rows["variance of m"] == "curve scale 53 %, specimen length 30 %, mesh and step 13 %, noise 3.3 %"
    assert rows["next"] == "a better known curve scale narrows the interval most"


@pytest.mark.parametrize("verdict", [v for v in Verdict if v is not Verdict.IDENTIFIED])
def test_a_bad_verdict_stands_beside_the_value(verdict: Verdict) -> None:
    e = synthetic().estimates["stiffness_factor"]
    object.__setattr__(e, "outcome", verdict)
    assert printed.answer(e).endswith(f"(k = 2): {verdict.value.upper()}")


def test_columns_show_what_they_are_given() -> None:
    rows = {"a": 0.125, "long name": None, "b": {"x": 1e-7, "y": 2}, "c": 1}
    assert numbers.columns(rows) == [
        "  a          0.125",
        "  long name  none",
        "  b          x = 1e-07, y = 2",
        "  c          1",
    ]


@pytest.mark.slow  # a process of its own, kernels compiled anew: half a minute
def test_a_cold_start_prints_nothing_else(tmp_path: Path) -> None:
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path / "cache")}
    command = [sys.executable, "-m", "kolsky.cli", "identify", str(OPEN_01), *QUICK, "--json"]
    run = {"cwd": ROOT, "env": environment, "capture_output": True, "text": True, "check": True}
    result = subprocess.run([*command, "--out", str(tmp_path / "out")], **run)
    assert json.loads(result.stdout)["stiffness_factor"]["value"] > 1.0
    lines = result.stderr.splitlines()
    lines = [line for line in lines if " since the start" not in line]  # progress, a line a minute
    assert all(line.startswith(("  report ", "  wall time ", "warning: ")) for line in lines), lines


@pytest.mark.slow
def test_a_terminal_without_a_character_gets_its_escape(tmp_path: Path) -> None:
    words = ["wavespeed", "runs/bar-02", "--out", str(tmp_path)]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    run = {"cwd": ROOT, "env": environment, "capture_output": True, "text": True, "check": True}
    result = subprocess.run([sys.executable, "-m", "kolsky.cli", *words], **run)
    assert r"\xb1" in result.stdout.splitlines()[1]  # ±, without a traceback


@pytest.mark.slow  # a process of its own
def test_the_per_shot_script(tmp_path: Path) -> None:
    folder = shot_in(tmp_path / "shot")
    script = ROOT / "runs" / "per_shot.py"
    command = [sys.executable, str(script), str(folder), "8x11", "16x22"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert re.match(r"shot: m = 1\.1\d{3} ± 0\.0\d{3} \(k = 2\): ", result.stdout), result.stdout
    made = {p.name for p in (folder / "results").iterdir()}
    assert {"identification.h5", "report.html", "force.csv"} <= made
    assert read_identification(folder / "results" / "identification.h5").shot == "shot"


# Bad shots: the same answers as `kolsky check`, nothing written

ISSUE = (  # cases of `kolsky check` that every command must answer
    "missing file",
    "swapped scope columns",
    "swapped outline columns",
    "clipping",
    "unsorted times",
    "repeated time",
    "frames beyond the flyer record",
    "curve of the wrong sign",
    "Poisson's ratio",
    "negative density",
    "empty folder",
    "not UTF-8",
    "two gigabytes",
)


@pytest.mark.parametrize("case", ISSUE)
@pytest.mark.parametrize("command", ["identify", "simulate", "sweep"])
def test_bad_shots_are_answered_in_one_line(command: str, case: str, shot: Path) -> None:
    mutate, fragments = BAD[case]
    mutate(shot)
    before = state(shot.parent)
    result = run_kolsky(command, shot, "--json", code=2)
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1, result.stderr
    assert result.stderr.startswith(str(shot))
    for fragment in fragments:
        assert fragment in result.stderr
    assert state(shot.parent) == before


OPTIONS: dict[str, tuple[list[str], str]] = {
    "unknown free parameter": (["identify", "--free", "m"], "there is no parameter 'm'; choose from stiff"),
    "bound outside": (["identify", "--free", "poisson=0.4:0.6"], "must be in [0, 0.49999]"),
    "reversed bounds": (["identify", "--free", "friction=2:0"], "lower bound of friction before the upper"),
    "unknown held parameter": (["identify", "-p", "nu=0.49"], "there is no parameter 'nu'"),
    "value outside": (["identify", "-p", "damping=-1"], "must be in [0, 0.01] s"),
    "free and held": (
        ["identify", "--free", "stiffness_factor", "-p", "stiffness_factor=1"],
        "stiffness_factor is named by both --free and --hold",
    ),
    "mesh not finer": (["identify", "--refined-mesh", "20x64"], "is not finer than --mesh 20x27"),
    "mesh of words": (["identify", "--mesh", "fine"], "elements across the radius x along"),
    "figure format": (
        ["identify", "--figures", "svg,gif"],
        '"gif" is not known; it must be pdf, svg, png or csv',
    ),
    "precision": (["identify", "--precision", "fp16"], "it must be fp64 or fp32"),
    "element": (["identify", "--element", "hex"], "it must be one_point or fbar"),
    "hourglass": (["sweep", "--hourglass", "enhanced"], "it must be stiffness or viscous"),
    "nodes of two meshes": (["simulate", "--nearly-incompressible", "--vtu"], "exclude each other"),
    "device": (["identify", "--device", "cuda:7"], "device must be one of ["),
    "simulated precision": (["simulate", "--precision", "double"], "it must be fp64 or fp32"),
    "simulated parameter": (["simulate", "-p", "m=1.1"], "there is no parameter 'm'"),
    "simulated value": (["simulate", "-p", "poisson=0.5"], "must be in [0, 0.49999]"),
    "no value": (["simulate", "-p", "friction"], "NAME=VALUE"),
    "design": (["sweep", "--design", "grid"], "it must be factorial, lhs, maximin, sobol, "),
    "Sobol' runs": (["sweep", "--design", "sobol", "--runs", "100"], "needs a power of two, got n = 100"),
    "levels": (["sweep", "--vary", "friction=0:2"], "NAME=LOW:HIGH:LEVELS"),
    "levels of a random design": (["sweep", "--design", "lhs", "--vary", "friction=0:2:9"], "NAME=LOW:HIGH"),
    "varied and held": (["sweep", "-p", "friction=1"], "friction is named by both --vary and --parameter"),
    "varied outside": (["sweep", "--vary", "poisson=0:1:3"], "must be in [0, 0.49999]"),
}


@pytest.mark.parametrize("case", OPTIONS)
def test_bad_options_are_answered_in_one_line(case: str, shot: Path) -> None:
    (command, *options), words = OPTIONS[case]
    before = state(shot.parent)
    result = run_kolsky(command, shot, *options, code=2)
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1, result.stderr
    assert result.stderr.startswith("command line: ")
    assert words in result.stderr
    assert state(shot.parent) == before


# Where results go


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("command", ["identify", "simulate", "sweep"])
def test_a_file_for_a_folder_is_refused_before_any_run(command: str, shot: Path) -> None:
    out = shot.parent / "taken"
    out.write_text("mine")
    for place in (out, out / "below"):
        result = run_kolsky(command, shot, "--out", place, code=2)
        assert result.stderr == (
            f"{out}: is a file; results need a folder. Cure: give another place with --out FOLDER\n"
        )
    assert out.read_text() == "mine"


def test_a_folder_without_permission_is_refused_before_any_run(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The administrator may write anywhere, so the answer of the system is made up.
    monkeypatch.setattr("os.access", lambda path, mode: not (Path(path) == shot and mode & os.W_OK))
    result = run_kolsky("identify", shot, code=2)
    assert result.stderr.startswith(f"{shot}: is not writable. Cure: ")
    assert usable_folder(shot.parent / "elsewhere") == shot.parent / "elsewhere"


def test_a_failed_write_leaves_old_results_as_they_were(shot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ["simulate", str(shot), *TINY]
    assert runner.invoke(app, arguments).exit_code == 0
    before = contents(shot / "results")

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    result = run_kolsky(*arguments, "-p", "stiffness_factor=1.3", code=2)
    assert result.stderr == (
        f"{shot / 'results' / 'simulation'}: results cannot be written: No space left on device. "
        "Cure: give another place with --out FOLDER\n"
    )
    assert contents(shot / "results") == before


def test_a_folder_is_filled_whole_or_not_at_all(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "results"
    with pytest.raises(KeyboardInterrupt), filling(folder) as partial:  # noqa: PT012
        (partial / "new").write_text("half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []  # not even the folders made for it
    with filling(folder) as partial:
        (partial / "one").write_text("1")
        (partial / "deep").mkdir()
        (partial / "deep" / "two").write_text("2")
    (folder / "mine").write_text("3")
    with pytest.raises(RuntimeError), filling(folder) as partial:  # noqa: PT012
        (partial / "one").write_text("other")
        raise RuntimeError
    (folder / "taken").mkdir()
    with pytest.raises(InputError, match="taken: is a folder where a result"), filling(folder) as p:  # noqa: PT012
        (p / "one").write_text("other")
        (p / "taken").write_text("file")
    assert contents(folder) == {"one": b"1", "deep/two": b"2", "mine": b"3"}


def texts(command: object, name: str) -> list[tuple[str, str]]:
    """Every text of a command and of the commands below it, with where it stands."""
    found = [(name, getattr(command, "help", None) or "")]
    for parameter in getattr(command, "params", []):
        found.append((f"{name} {parameter.name}", getattr(parameter, "help", None) or ""))
    for below, part in getattr(command, "commands", {}).items():
        found += texts(part, f"{name} {below}")
    return found


def test_no_word_of_a_help_text_is_lost() -> None:
    said = texts(typer.main.get_command(app), "kolsky")
    assert len(said) > 100  # all commands and options were found
    lost = {place: text for place, text in said if Text.from_markup(text).plain != text}
    assert not lost


HEAD = "nominal strain (1),nominal stress (Pa),independent sigma (Pa)"


@pytest.fixture
def curve(tmp_path):
    """A table as `kolsky material reference-curve` writes it: 20 kPa (lam^-2 - lam)."""
    lam = 1.0 - np.linspace(0.02, 0.5, 12)
    rows = np.column_stack([1.0 - lam, 20e3 * (lam**-2 - lam), np.full(12, 10.0)])
    np.savetxt(tmp_path / "curve.csv", rows, delimiter=",", header=HEAD, comments="")
    return tmp_path / "curve.csv"


def test_units_in_brackets_are_shown(curve):
    shown = json_of("channels", curve)
    assert [channel["unit"] for channel in shown["channels"]] == ["1", "Pa", "Pa"]


@pytest.mark.parametrize("bracket", ["", " ({})"])
def test_a_written_curve_is_fitted(curve, bracket):
    columns = [f"nominal strain{bracket.format('1')}", f"nominal stress{bracket.format('Pa')}"]
    words = ["--convention", "compression-positive", "--laws", "neo_hookean", "--out"]
    columns = ["--strain", columns[0], "--stress", columns[1]]
    fit = json_of("material", "fit", curve, *columns, *words, curve.parent / "out")["laws"][0]["fit"]
    assert fit["constants"]["mu"] == pytest.approx(20e3, rel=1e-9)


def test_without_it_what_needs_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(OpenCVMissing, match="pip install opencv-contrib-python-headless"):
        _ = cv2.imread
    with single_threaded_libraries():  # of no use to OpenCV that is not there
        pass


def test_a_command_ends_with_one_line_and_exit_code_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(typer.Exit) as ended, refusing_bad_input():
        _ = cv2.imread
    assert ended.value.exit_code == 2
    said = "this needs the package cv2: pip install 'opencv-contrib-python-headless'\n"
    assert capsys.readouterr().err == said
    with pytest.raises(ModuleNotFoundError, match="no_such_module"), refusing_bad_input():
        import no_such_module  # noqa: F401  # a fault of ours is no bad input


def test_every_package_that_a_command_names_is_there() -> None:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    by_default = {text.partition(">=")[0] for text in project["dependencies"]}
    assert set(BROUGHT_BY.values()) <= by_default | {f"kolsky[{name}]" for name in extras}
    for distribution, (source, _) in OPTIONAL.items():
        extra = source.removeprefix("kolsky[").removesuffix("]")
        brought = extras[extra] if source != extra else by_default
        assert any(text.startswith(distribution) for text in brought), distribution
    assert set(REQUIRED) <= by_default


def test_a_shot_from_exports_needs_few_libraries(tmp_path: Path) -> None:
    """Some are not loaded by it; others need not be installed."""
    code = (
        "import sys; from pathlib import Path\n"
        "for name in ('cv2', 'skimage', 'pyvista', 'vtk', 'pandas', 'imageio'):\n"
        "    sys.modules[name] = None\n"
        "from kolsky.shot.load import load_shot; load_shot(Path('runs/open-01'))\n"
        "import kolsky.identification, kolsky.report.result_folder\n"
        "names = ('pint', 'scipy.stats', 'scipy.signal', 'scipy.ndimage', 'dic.result', 'dic.images', "
        "'h5py', 'matplotlib'); loaded = [name for name in names if name in sys.modules]\n"
        "assert not loaded, loaded\n"
        "from kolsky.cli import main\n"
        "import kolsky.report.pages.identification, kolsky.report.figures\n"
        f"sys.argv = ['kolsky', 'check', 'runs/open-01', '--out', {str(tmp_path)!r}]\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_sound_installation(tmp_path: Path) -> None:
    found = examine(tmp_path)
    assert found["problems"] == []
    assert found["devices"][0].startswith("cpu")
    assert found["versions"]["numpy"] == version("numpy")
    assert doctor.rows(found)["cores"] == str(found["cores"])
    assert list(tmp_path.iterdir()) == []


def test_what_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "REQUIRED", ("numpy", "no-such-distribution"))
    monkeypatch.setattr(doctor, "LEAST_SPACE", 1e18)
    found = examine(tmp_path)
    assert [problem.partition(" ")[0] for problem in found["problems"]] == [
        "no-such-distribution",
        str(tmp_path),
    ]
    gone = examine(tmp_path / "nowhere")
    assert any("nowhere cannot be written to (No such file" in problem for problem in gone["problems"])
    assert gone["free_bytes"] is None


def test_the_command_says_the_same_in_json(tmp_path: Path) -> None:
    said = json_of("doctor", tmp_path)
    assert said["versions"]["kolsky"] == examine(tmp_path)["versions"]["kolsky"]
    assert said["problems"] == []
    lost = run_kolsky("doctor", tmp_path / "nowhere", code=1)
    assert "cannot be written to" in lost.output


def test_the_version_has_a_short_option() -> None:
    runner = CliRunner()
    assert runner.invoke(app, ["-V"]).output == runner.invoke(app, ["--version"]).output
