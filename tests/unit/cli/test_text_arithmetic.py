"""Numbers of the command line: units, ends of ranges, parts and shares, all checked by hand."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.plan import _frame_interval, _window
from kolsky.cli.sweep import DesignChoice, Records, Workers


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [("4 um", "m", 4e-6), ("0.2 um/N", "m/N", 2e-7), ("3.6 1/mm", "1/m", 3600.0), ("0.5 %", "1", 0.005)],
)
def test_quantities_come_out_in_si(text: str, unit: str, value: float) -> None:
    assert texts.physical("--option", text, unit) == pytest.approx(value, rel=1e-14)  # round-off of a factor


def test_a_positive_quantity_excludes_zero() -> None:
    assert texts.physical("--length", "0 mm", "m") == 0.0
    assert texts.physical("--length", "1 nm", "m", positive=True) == pytest.approx(1e-9)
    for text in ("0 mm", "-1 mm"):
        with pytest.raises(InputError, match=r"--length = .* is not allowed; it must be > 0 m"):
            texts.physical("--length", text, "m", positive=True)


def test_a_frame_rate_is_the_inverse_of_the_time_between_pictures() -> None:
    assert _frame_interval("--frame-rate", "125 kHz") == pytest.approx(8e-6, rel=1e-14)
    assert _window("--window", "50 us:1.2 ms") == pytest.approx((5e-5, 1.2e-3), rel=1e-14)
    with pytest.raises(InputError, match="must be > 0"):
        _frame_interval("--frame-rate", "0 kHz")


def test_strains_lie_between_zero_and_one_without_the_ends() -> None:
    assert texts.strains("--strains", "0.1, 0.999") == (0.1, 0.999)
    for text in ("0", "1", "0.2,1", "-0.1", "", "a"):
        with pytest.raises(InputError, match="numbers between 0 and 1"):
            texts.strains("--strains", text)


def test_the_edges_of_a_mesh_and_of_a_factorial() -> None:
    assert texts.mesh("--mesh", "2x2") == (2, 2)
    assert texts.mesh("--mesh", "1000x1000") == (1000, 1000)
    for text in ("1x2", "2x1", "1000x1001"):
        with pytest.raises(InputError, match="at most a million"):
            texts.mesh("--mesh", text)
    million = ["friction=0:2:1000", "poisson=0.1:0.4:1000"]
    assert texts.levels("--vary", million)[1] == [1000, 1000]
    with pytest.raises(InputError, match="1001000 runs"):
        texts.levels("--vary", ["friction=0:2:1001", "poisson=0.1:0.4:1000"])


def test_shards_are_counted_from_one_to_their_number() -> None:
    assert [texts.shard("--shard", text) for text in ("1/1", "1/3", "3/3")] == [(1, 1), (1, 3), (3, 3)]
    for text in ("0/3", "4/3", "3", "a/b", "1/0"):
        with pytest.raises(InputError, match="I from 1 to N"):
            texts.shard("--shard", text)


def test_parts_of_a_design_are_all_of_it_once() -> None:
    design = DesignChoice(("friction=0:2:7",)).design()
    parts = [Records(shard=(i, 3)).part(design).points[:, 0] for i in (1, 2, 3)]
    assert sorted(np.concatenate(parts)) == pytest.approx(np.linspace(0.0, 2.0, 7))
    assert Records(shard=(2, 3)).stem == "sweep-2of3"
    assert Records().stem == "sweep"


def test_cores_are_shared_out_among_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kolsky.cli.sweep.cores", lambda: 12)
    assert Workers(4).threads(None) == 3
    assert Workers(5).threads(None) == 2  # none shares a core with another
    assert Workers(20).threads(None) == 1
    assert Workers(4).threads(7) == 7
    assert Workers().threads(None) is None


@dataclass
class Table:
    """What `least_misfit` reads of a `kolsky.inverse.run_table.DesignTable`."""

    phi_force: np.ndarray
    phi_shape: np.ndarray
    outcomes: tuple[str, ...] = ("COMPLETED", "COMPLETED", "COMPLETED")
    lost: tuple[int, ...] = ()
    names: tuple[str, ...] = ("friction",)
    points: np.ndarray = field(default_factory=lambda: np.array([[0.1], [0.2], [0.3]]))


def found(**values: object) -> dict[str, object]:
    from kolsky.studies.sweep import Sweep, counts, least_misfit

    result = Sweep("s", Table(**values), {})  # type: ignore[arg-type]
    return {**counts(result), **least_misfit(result)}


def test_the_best_run_of_a_sweep_by_hand() -> None:
    # Eq. (M.5) with 1000 N and 0.001: 3 + 0.5, 1 + 2, 2 + 1.5.
    force, shape = np.array([3000.0, 1000.0, 2000.0]), np.array([0.5e-3, 2e-3, 1.5e-3])
    best = found(phi_force=force, phi_shape=shape)
    assert best == {"runs": 3, "completed": 3, "smallest_phi": pytest.approx(3.0), "at": {"friction": 0.2}}
    shape[1] = 4e-3  # 1 + 4: now the first and the third tie, and the first stands first
    assert found(phi_force=force, phi_shape=shape)["at"] == {"friction": 0.1}


def test_the_best_run_without_an_outline_and_without_a_run() -> None:
    nothing = np.full(3, np.nan)
    by_force = found(phi_force=np.array([3000.0, np.nan, 2000.0]), phi_shape=nothing, lost=(1,))
    assert (by_force["completed"], by_force["smallest_phi"]) == (2, None)
    assert (by_force["smallest_phi_force"], by_force["at"]) == (2000.0, {"friction": 0.3})
    none = found(phi_force=nothing, phi_shape=nothing, lost=(0, 1, 2))
    assert none == {"runs": 3, "completed": 0, "smallest_phi": None, "at": None}


def test_a_name_cannot_steer_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    from kolsky.cli.terminal import print_result

    evil = "shot\x1b[2J\x1b]0;owned\x07\u202etxt"
    print_result({"shot": evil}, {}, files={"file": evil}, lines=[f"m of {evil}"], warnings=[f"{evil}!"])
    shown = "".join(capsys.readouterr())
    assert "owned" in shown
    assert not set(shown) & set("\x1b\x07\u202e")
