"""`kolsky identify SHOT... --each`: the work of each process, the order, and the effect of a failed shot."""

import json
import pickle
import shutil
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

import pytest
from kolsky_command import run_kolsky
from shot_folders import shot_in

from kolsky.base.errors import InputError, InputErrors
from kolsky.cli import identify as module
from kolsky.cli.identify import Printout, SingleShotJob, identify_each, run_jobs
from kolsky.cli.sweep import Workers
from kolsky.cli.terminal import is_quiet, printing
from kolsky.inverse.settings import Numerics, Settings

ALIKE = SingleShotJob(Path("none"), Settings())


def made_up(task: SingleShotJob, *, processes: int) -> Printout:
    """An answer that says what was asked, or that the shot is bad."""
    name = task.shot.name
    if name == "bad":
        raise InputErrors([InputError(task.shot, "is odd", cure="mend it") for _ in range(2)])
    how = f"{task.out} {task.settings.numerics.threads} {processes} {is_quiet()}"
    return Printout(name, ("m = 1",), {}, {"how": how}, ("mind this",), task.shot / "report.html")


@pytest.fixture
def stubbed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_run_job", made_up)


def paths(*names: str) -> list[Path]:
    return [Path("folder") / name for name in names]


@pytest.mark.usefixtures("stubbed")
def test_shots_are_answered_in_their_order_and_a_bad_one_stops_no_other(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(InputErrors, match="is odd") as raised, printing(as_json=True):
        identify_each(paths("b", "bad", "a"), ALIKE, Workers())
    assert len(raised.value.problems) == 2
    printed = capsys.readouterr()
    first, second, third = json.loads(printed.out)["shots"]
    assert first["answer"] == third["answer"] == {"how": "None None 2 False"}
    assert (first["folder"], third["report"]) == ("folder/b", "folder/a/report.html")
    assert second["answer"] is second["report"] is None
    assert second["problem"].splitlines() == ["folder/bad: is odd. Cure: mend it"] * 2
    assert "warning: b: mind this\nwarning: a: mind this" in printed.err


@pytest.mark.usefixtures("stubbed")
def test_a_worker_has_a_thread_draws_alone_and_says_nothing() -> None:
    tasks = [SingleShotJob(Path(name), Settings(numerics=Numerics(threads=3))) for name in "ab"]
    done: list[int] = []
    found = run_jobs(partial(ThreadPoolExecutor, 2), tasks, done.append)
    assert [one.content["how"] for one in found if isinstance(one, Printout)] == ["None 3 1 True"] * 2
    assert done == [0, 1, 2]


@pytest.mark.parametrize(
    ("processes", "given", "threads"), [(None, None, None), (None, 3, 3), (2, 3, 3), (10_000, None, 1)]
)
def test_threads_of_a_worker(
    monkeypatch: pytest.MonkeyPatch, processes: int | None, given: int | None, threads: int | None
) -> None:
    seen: list[SingleShotJob] = []

    def tell(executor: Any, tasks: list[SingleShotJob], told: Any) -> list[Any]:
        seen.extend(tasks)
        return [made_up(task, processes=1) for task in tasks]

    monkeypatch.setattr(module, "run_jobs", tell)
    monkeypatch.setattr(
        module, "_run_or_error", lambda task, processes: seen.append(task) or made_up(task, processes=2)
    )
    alike = SingleShotJob(Path(), Settings(numerics=Numerics(threads=given)))
    identify_each(paths("a"), alike, Workers(processes))
    assert [task.settings.numerics.threads for task in seen] == [threads]


def test_a_lost_worker_is_said_with_what_is_done() -> None:
    kept = Event()

    class Dies(ThreadPoolExecutor):
        def submit(self, work: Callable[..., Any], /, *given: Any, **more: Any) -> "Future[Any]":
            future: Future[Any] = Future()
            if kept.is_set():
                future.set_exception(BrokenExecutor("it was killed"))
            else:
                future.set_result(InputError("a", "is odd", cure="mend it"))
                kept.set()
            return future

    with pytest.raises(InputError, match=r"after [01] of 2 shots were identified \(.*kill"):
        run_jobs(Dies, [ALIKE, ALIKE], lambda done: None)


def test_two_shots_never_write_to_one_place(tmp_path: Path) -> None:
    for name in ("x/a", "y/a"):
        (tmp_path / name).mkdir(parents=True)
    x, y = tmp_path / "x" / "a", tmp_path / "y" / "a"
    assert module._result_folders([x, y], None) == [None, None]
    assert module._result_folders([x], tmp_path) == [tmp_path / "a"]
    for shots, out in (([x, x], None), ([x, x / ".." / "a"], None), ([x, y], tmp_path)):
        with pytest.raises(InputError, match="two shots would write to"):
            module._result_folders(shots, out)


def test_workers_of_a_single_identification_are_refused(tmp_path: Path) -> None:
    for shots in (["a"], ["a", "b"]):
        result = run_kolsky("identify", *shots, "--processes", "2", code=2)
        assert "give --each" in result.output


def test_a_refusal_comes_back_from_a_worker_as_it_was() -> None:
    one = InputError("f.toml", "is odd", line=3, key="a.b", value=[1], allowed="2", cure="mend it")
    for error in (one, InputErrors([one, InputError("g", "is none", cure="make it")])):
        back = pickle.loads(pickle.dumps(error))
        assert (type(back), str(back)) == (type(error), str(error))
        assert [str(p) for p in back.problems] == [str(p) for p in error.problems]


@pytest.mark.slow
def test_processes_give_the_bits_of_one_process(tmp_path: Path) -> None:
    longer = ('length = "6.5 mm"', 'length = "6.52 mm"')
    shots = [shot_in(tmp_path / "a"), shot_in(tmp_path / "b", longer)]
    words = ["identify", *map(str, [*shots, tmp_path / "none"]), "--each", "--json", "--mesh", "8x11"]
    words += ["--refined-mesh", "16x22", "--hold", "poisson", "--hold", "damping", "--replicates", "4"]

    def answers(*more: str) -> list[tuple[float, list[float]]]:
        out = tmp_path / "out"
        result = run_kolsky(*words, "--threads", "1", "--out", out, *more, code=2)
        *good, bad = json.loads(result.stdout)["shots"]
        assert "there is no such folder" in bad["problem"]
        assert all(Path(one["report"]).is_file() for one in good)
        shutil.rmtree(out)
        found = [one["answer"]["stiffness_factor"] for one in good]
        return [(one["value"], one["interval"]) for one in found]

    alone = answers()
    assert alone[0] != alone[1]
    assert answers("--processes", "2") == alone
