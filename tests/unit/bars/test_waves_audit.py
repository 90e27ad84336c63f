"""The audit log: sizes by hand, switches, and rejected inputs."""

import re
from pathlib import Path

import numpy as np
import pytest

from kolsky.bars.audit import CORRECTIONS, AuditLog, Switches, compare, table_of
from kolsky.bars.records import Correction
from kolsky.base.files import write_table

BEFORE = np.array([0.0, 1.0, 2.0, 3.0])
AFTER = np.array([0.0, 1.5, 1.0, 3.0])


def test_sizes_over_the_pulse():
    entry = compare("x", "droop", BEFORE, AFTER, applied=True, unit="N", reason="because")
    assert entry == Correction("x", "droop", True, 1.0, np.sqrt(1.25 / 4), "N", "because")
    over = np.array([False, True, False, False])
    part = compare("x", "droop", BEFORE, AFTER, applied=True, unit="N", reason="r", over=over)
    assert (part.size, part.rms) == (0.5, 0.5)


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
    log.add(compare("a, b", "mass", BEFORE, AFTER, applied=False, unit="N", reason='said "so"'))
    path = write_table(tmp_path / "log.csv", table_of(log.corrections))
    assert path.read_text().splitlines() == [
        "correction,switch,applied,largest change,rms change,unit,reason",
        '"a, b",mass,no,1,0.559016994,N,"said ""so"""',
    ]


def test_switches_are_a_mapping_with_defaults():
    switches = Switches({"dispersion": False})
    assert set(switches) == set(CORRECTIONS)
    assert len(switches) == len(CORRECTIONS)
    assert (switches["dispersion"], switches["punching"], switches["baseline drift"]) == (False, True, False)
    assert Switches()["dispersion"]
    bare = Switches({"radial_inertia": True})  # as a bare key of TOML
    assert bare["radial inertia"]
    assert bare["radial_inertia"]
    assert bare.state("radial inertia") == "switched on"


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        (
            {"dispersoin": True},
            r"no correction is called 'dispersoin'; did you mean 'dispersion'\? Known are",
        ),
        ({"gravity!": True}, r"no correction is called 'gravity!'; known are 'bridge nonlinearity'"),
        ({"mass": 1}, r"switch 'mass' must be true or false, got 1"),
        ({"radial_inertia": True, "radial inertia": True}, r"'radial inertia' is stated twice"),
    ],
)
def test_unknown_switches_are_refused(stated, message):
    with pytest.raises(ValueError, match=message):
        Switches(stated)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"key": "weight"}, "no correction is called 'weight'"),
        ({"after": AFTER[:3]}, r"shapes \(4,\) and \(3,\)"),
        ({"after": np.array([0.0, 0.0, np.inf, 0.0])}, "not finite at sample 2"),
        ({"over": np.zeros(4, dtype=bool)}, "there is no sample"),
        ({"reason": " "}, "needs a reason"),
    ],
)
def test_impossible_comparisons_are_refused(changes, message):
    given = {"name": "x", "key": "mass", "before": BEFORE, "after": AFTER}
    given |= {"applied": True, "unit": "N", "reason": "r"} | changes
    with pytest.raises(ValueError, match=message):
        AuditLog().compare(**given)


def test_a_log_knows_its_keys():
    log = AuditLog()
    log.add(Correction("x", "radial_inertia", True, 0.0, 0.0, "Pa", "r"))
    assert log.corrections[0].key == "radial inertia"
    with pytest.raises(ValueError, match="no correction is called 'x'"):
        AuditLog().add(Correction("x", "x", True, 0.0, 0.0, "1", "r"))


def test_the_documented_switches_are_those_there_are():
    page = (Path(__file__).parents[3] / "docs" / "theory" / "bars.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([^`]+)` \| (on|off) \| (.+) \|$", page, flags=re.MULTILINE)
    assert [(key, state == "on", words) for key, state, words in rows] == [
        (key, default, words) for key, (default, words) in CORRECTIONS.items()
    ]
