"""Files and texts of a synthetic reduction, and the audit log."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from kolsky_command import rows_of
from wavesmaker import made_result

from kolsky.bars import records
from kolsky.bars.audit import CORRECTIONS, AuditLog, Switches, correction_of, table_of
from kolsky.bars.reduction.output import summary, tables, write_hdf5
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.files import write_table, write_tables
from kolsky.report.pages.waves import means_over, render

# Files and texts of a synthetic reduction: intervals, units, and the content of each file.

TIME = np.linspace(0.0, 1e-4, 5)
BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=200e9, density=8000.0)


def history(unit: str, size: float) -> records.History:
    return records.History(value=size * np.arange(5.0), sigma=0.01 * size * np.ones(5), unit=unit)


def signal(unit: str, name: str = "") -> records.Signal:
    return records.Signal(start=1e-3, interval=1e-6, value=np.arange(4.0), sigma=0.25, unit=unit, name=name)


def common() -> dict[str, Any]:
    ways = ("one wave", "three waves")
    reduction = records.Reduction(
        time=TIME,
        strain={way: history("1", 0.1) for way in ways},
        rate={way: history("1/s", 1e3) for way in ways},
        stress={way: history("Pa", 1e6) for way in ways},
        front_force=history("N", 100.0),
        back_force=history("N", 99.0),
        front_velocity=history("m/s", 5.0),
        back_velocity=history("m/s", 1.0),
        imbalance=np.array([np.inf, 0.1, 0.0, -0.1, 0.0]),
        balanced=(2e-5, 8e-5),
    )
    area = records.Quantity("specimen, diameter", 9.5e-3, 1e-5, "m", "B")
    noise = records.Quantity("noise", 0.0, 1.0, "1", "A", freedom=12.0)
    return {
        "name": "made\0up",
        "specimen": Specimen(diameter=9.5e-3, length=6.5e-3, density=1000.0),
        "load": "compression",
        "reduction": reduction,
        "corrections": (
            records.Correction("zero", "baseline", True, 2.0, 1.0, "1", "400 samples"),
            records.Correction("dispersion", "dispersion", False, 3.0, 1.5, "N", "below its noise"),
        ),
        "budget": records.BudgetTable(
            results={"peak stress": (5.0e6, 1.5e5, "Pa")},
            contributions=(
                records.Contribution(area, {"peak stress": 0.75}),
                records.Contribution(noise, {"peak stress": 0.25}),
            ),
        ),
        "facts": {"wave speed/bar": (5000.0, "m/s")},
        "remarks": ("one", "two"),
        "inputs": {"scope.csv": "ab" * 32},
        "settings": {"version": "1"},
        "extra": {"mean force (N)": np.arange(5.0)},
    }


def between_bars() -> records.WavesResult:
    incident = records.BarSignal(signal("1"), BAR, 0.5, "incident", bending=np.zeros(4))
    return records.WavesResult(
        **common(),
        incident=incident,
        transmission=replace(incident, side="transmission", bending=None),
        windows=records.Windows((0.0, 1.0), (1.0, 2.0), (1.5, 2.5), "shot file"),
        faces=records.FaceWaves(
            time=TIME,
            incident=np.arange(5.0),
            reflected=-np.arange(5.0),
            transmitted=0.5 * np.arange(5.0),
            sigma={"incident": 0.1, "reflected": 0.2, "transmitted": 0.3},
            incident_bar=BAR,
            transmission_bar=BAR,
        ),
    )


def with_flyer(*, known: bool = True) -> records.FlyerResult:
    return records.FlyerResult(
        **common(),
        signals=(signal("N", "incident transducer"),),
        events=(("full speed", 1e-3, 2e-6, "kink"), ("arrest", None, None, "not found")),
        valid=(1e-4, 3e-4) if known else None,
        validity="from 0.1 ms",
        synchronisation="they agree" if known else None,
        inertia={"time": TIME, "imbalance": np.zeros(5), "inertia": np.ones(5)},
    )


def test_the_quoted_interval_is_twice_sigma_about_the_value(tmp_path: Path) -> None:
    result = between_bars()
    said = summary(result)["results"]["peak stress"]
    assert said == {"value": 5.0e6, "sigma": 1.5e5, "interval": [4.7e6, 5.3e6], "unit": "Pa"}
    write_hdf5(tmp_path / "waves.h5", result)
    with h5py.File(tmp_path / "waves.h5") as file:
        stored = file["entry/budget/results/peak_stress"]
        assert stored["interval"][()].tolist() == [4.7e6, 5.3e6]
        assert stored["interval"].attrs["units"] == "Pa"
        assert stored["share_of_variance"][()].tolist() == [0.75, 0.25]


def test_the_file_of_a_test_between_bars(tmp_path: Path) -> None:
    write_hdf5(tmp_path / "waves.h5", between_bars())
    with h5py.File(tmp_path / "waves.h5") as file:
        assert (file.attrs["format"], file.attrs["format_version"]) == ("kolsky-waves", 1)
        entry = file["entry"]
        assert entry["shot"].asstr()[()] == "made\\0up"
        assert entry["gauges/incident/strain"].attrs["sigma"] == 0.25
        assert entry["gauges/incident/time"][()].tolist() == pytest.approx(
            [1e-3, 1.001e-3, 1.002e-3, 1.003e-3]
        )
        assert "bending" in entry["gauges/incident"]
        assert "bending" not in entry["gauges/transmission"]
        assert entry["windows/reflected"][()].tolist() == [1.0, 2.0]
        assert entry["faces/transmitted"].attrs["sigma"] == 0.3
        assert entry["faces/time"].attrs["units"] == "s"
        part = entry["reduction/three_waves"]
        assert part.attrs["signal"] == "stress"
        assert part["time"] == entry["reduction/time"]  # one dataset, two names
        assert part["rate"].attrs["units"] == part["rate_sigma"].attrs["units"] == "1/s"
        assert "two_waves" not in entry["reduction"]
        assert entry["reduction/back_velocity"].attrs["units"] == "m/s"
        assert entry["reduction/mean_force"].attrs["units"] == "N"
        assert entry["corrections/applied"][()].tolist() == [1, 0]
        assert entry["corrections/unit"].asstr()[()].tolist() == ["1", "N"]
        assert entry["budget/freedom"][()].tolist() == [np.inf, 12.0]
        assert entry["facts/wave_speed_bar"][()] == 5000.0
        assert entry["inputs/names"].asstr()[()].tolist() == ["scope.csv"]
        assert entry["remarks"].asstr()[()].tolist() == ["one", "two"]


@pytest.mark.parametrize("known", [True, False])
def test_the_file_of_a_test_with_a_flyer(tmp_path: Path, known: bool) -> None:
    result = with_flyer(known=known)
    write_hdf5(tmp_path / "waves.h5", result)
    with h5py.File(tmp_path / "waves.h5") as file:
        entry = file["entry"]
        assert entry["transducers/incident_transducer/force"].attrs["units"] == "N"
        assert entry["events/full_speed/sigma"][()] == 2e-6
        assert list(entry["events/arrest"]) == ["how"]
        assert ("window" in entry["validity"]) == known
        assert ("synchronisation" in entry) == known
        assert entry["validity/inertia"].attrs["units"] == "1"
        assert "gauges" not in entry
    said = summary(result)
    assert said["valid"] == ([1e-4, 3e-4] if known else None)
    assert said["events"][0] == {"name": "full speed", "time": 1e-3, "sigma": 2e-6, "how": "kink"}


def test_tables_have_units_in_their_headings(tmp_path: Path) -> None:
    write_tables(tmp_path, tables(between_bars()))
    made = {}
    for path in tmp_path.glob("*.csv"):
        made[path.stem] = rows_of(path)
    last = made["waves"][-1]
    assert float(last["stress, three waves (Pa)"]) == 4e6
    assert float(last["sigma of stress, one wave (Pa)"]) == 1e4
    assert float(last["back force (N)"]) == 396.0
    assert float(last["mean force (N)"]) == 4.0
    assert [row["applied"] for row in made["waves_corrections"]] == ["yes", "no"]
    assert [float(row["share of variance, peak stress"]) for row in made["waves_budget"]] == [0.75, 0.25]


def test_the_balanced_length_stands_beside_the_means():
    """60 us of balance in a pulse of 150 us are 40 % of it."""
    facts = {
        "plateau from": (50e-6, "s"),
        "plateau to": (120e-6, "s"),
        "balanced length of the plateau": (60e-6, "s"),
        "incident pulse at half its height": (150e-6, "s"),
    }
    said = means_over(replace(made_result(), facts=facts))
    assert said.startswith("Means over 50 to 120 µs")
    assert "balanced over 60 µs, 40 % of the incident pulse" in said
    assert said in render(replace(made_result(), facts=facts))
    assert means_over(made_result()) == ""


# The audit log: sizes by hand, switches, and rejected inputs.

BEFORE = np.array([0.0, 1.0, 2.0, 3.0])
AFTER = np.array([0.0, 1.5, 1.0, 3.0])


def test_sizes_over_the_pulse():
    entry = correction_of("x", "droop", AFTER - BEFORE, applied=True, unit="N", reason="because")
    assert entry == records.Correction("x", "droop", True, 1.0, np.sqrt(1.25 / 4), "N", "because")
    log, over = AuditLog(), np.array([False, True, False, False])
    log.compare("x", "droop", BEFORE, AFTER, applied=True, unit="N", reason="r", over=over)
    assert (log.corrections[0].size, log.corrections[0].rms) == (0.5, 0.5)


def test_a_log_applies_what_is_on_and_lists_what_is_off():
    log = AuditLog(Switches({"droop": False, "radial inertia": True}))
    kept = log.choose("droop, force", "droop", BEFORE, AFTER, unit="N", reason="tau 2 ms")
    np.testing.assert_array_equal(kept, BEFORE)
    changed = log.choose("inertia", "radial inertia", BEFORE, AFTER, unit="Pa", reason="formula")
    np.testing.assert_array_equal(changed, AFTER)
    log.choose("mass", "mass", BEFORE, AFTER, unit="N", reason="7.1 g")
    assert [(c.applied, c.size) for c in log.corrections] == [(False, 1.0), (True, 1.0), (True, 1.0)]
    assert [c.reason for c in log.corrections] == [
        "tau 2 ms; switched off",
        "formula; switched on",
        "7.1 g; on by default",
    ]


def test_the_table_can_be_written(tmp_path):
    log = AuditLog()
    log.compare("a, b", "mass", BEFORE, AFTER, applied=False, unit="N", reason='said "so"')
    path = write_table(tmp_path / "log.csv", table_of(log.corrections))
    assert path.read_text().splitlines() == [
        "correction,switch,applied,largest change,rms change,unit,reason",
        '"a, b",mass,no,1,0.559016994,N,"said ""so"""',
    ]


def test_switches_have_defaults():
    switches = Switches({"dispersion": False})
    assert (switches["dispersion"], switches["punching"], switches["baseline drift"]) == (False, True, False)
    assert switches.state("dispersion") == "switched off"
    assert switches.state("punching") == "on by default"


def test_the_documented_switches_are_those_there_are():
    page = (Path(__file__).parents[3] / "docs" / "theory" / "bars.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([^`]+)` \| (on|off) \| (.+) \|$", page, flags=re.MULTILINE)
    assert [(key, state == "on", words) for key, state, words in rows] == [
        (key, default, words) for key, (default, words) in CORRECTIONS.items()
    ]
