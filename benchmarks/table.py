"""The table as text and as JSON, with measurements, limits and CalculiX, without names of machines and
dates."""

import os
import platform
from dataclasses import asdict
from math import isnan
from typing import Any

from benchmarks.counting import Cost
from benchmarks.histories import Histories, differences
from benchmarks.limits import Limit
from benchmarks.measure import Measurement
from benchmarks.peer import Peer

HEAD = (
    "contact  precision   runs   seconds  time loops  M element-updates/s  of the limit  same bits"
    "  first call, s"
)


def is_busy() -> bool:
    """Whether more than half of a core was busy in the last minute, if the system reports this."""
    return hasattr(os, "getloadavg") and os.getloadavg()[0] > 0.5


def line(m: Measurement, limits: list[Limit]) -> str:
    """One row of the table, with the fraction of the lowest limit of the whole device."""
    limit = min(limits, key=lambda item: item.updates)
    return (
        f"{m.contact:8} {m.precision:9} {m.runs:6d} {m.seconds:9.4f} {m.time_loops:11.4f}"
        f" {m.updates / 1e6:20.1f} {m.updates / limit.updates:13.1%} {m.same_bits!s:>10} {m.first_call:13.2f}"
    )


def cost_line(cost: Cost) -> str:
    """Arithmetic of an element update, as text."""
    return (
        f"An element update: {cost.operations:.0f} floating-point operations in {cost.instructions:.0f} "
        f"instructions with fused products, {cost.divisions:.1f} divisions and roots among them"
    )


def limit_lines(limits: dict[str, list[Limit]]) -> list[str]:
    """The limits of each precision."""
    return [
        f"{precision}: {item.rate / 1e9:.1f} G{item.unit} ({item.name}) allow "
        f"{item.updates / 1e6:.1f} M element-updates/s"
        for precision, items in limits.items()
        for item in items
    ]


def peer_lines(peer: Peer, measurements: list[Measurement], cores: int) -> list[str]:
    """Time and forces of CalculiX, and the ratio of its time to that of every bonded fp64 batch."""
    steps = round(peer.window / peer.step)
    lines = [
        f"CalculiX {peer.version}, bonded: {peer.seconds:.2f} s for {steps} steps of {peer.step * 1e6:g} us,"
        f" so {peer.whole_run:.1f} s a run",
        f"  force on the transmission platen within {peer.window * 1e6:g} us, undamped: differs by at most "
        f"{peer.largest_difference:.3f} N (rms {peer.rms_difference:.3f} N) of {peer.largest_force:.2f} N",
    ]
    for m in _comparable(measurements):
        ratio = peer.cost(m.runs, cores) / m.seconds
        lines.append(f"  runs: {m.runs:6d}, one a core of {cores}: {ratio:.0f} times as long as here")
    return lines


def as_json(
    *,
    device: str,
    mesh: str,
    bound: str,
    measurements: list[Measurement],
    cost: Cost,
    limits: dict[str, list[Limit]],
    peer: Peer | None,
    kept: Histories,
) -> dict[str, Any]:
    """All measurements for `benchmarks/results`."""
    cores = os.cpu_count() or 1
    text: dict[str, Any] = {
        "machine": {"device": device, "processor": platform.machine(), "cores": cores},
        "mesh": mesh,
        "step_bound": bound,
        "element_update": {name: round(value, 1) for name, value in asdict(cost).items()},
        "limits": {
            precision: [
                {
                    "name": item.name,
                    f"giga_{item.unit}": round(item.rate / 1e9, 2),
                    "million_element_updates_per_s": round(item.updates / 1e6, 2),
                }
                for item in items
            ]
            for precision, items in limits.items()
        },
        "rows": [_row(m, limits[m.precision], kept) for m in measurements],
    }
    if peer is not None:
        ratios = {str(m.runs): round(peer.cost(m.runs, cores) / m.seconds) for m in _comparable(measurements)}
        text["peer"] = {
            "program": f"CalculiX {peer.version}",
            "window_s": peer.window,
            "step_s": peer.step,
            "window_seconds": round(peer.seconds, 2),
            "whole_run_seconds": round(peer.whole_run, 1),
            "largest_force_N": round(peer.largest_force, 3),
            "largest_difference_N": round(peer.largest_difference, 3),
            "rms_difference_N": round(peer.rms_difference, 3),
            "times_as_long": ratios,
        }
    return text


def page_table(made: dict[str, Any]) -> str:
    """The result of `as_json` as the table of a page: one row for each batch, with the ratio of CalculiX if
    it ran."""
    ratios = made.get("peer", {}).get("times_as_long", {})
    heads = ["contact", "precision", "runs", "seconds", "of these in time loops"]
    heads += ["million element updates a second", "of the limit", *(["CalculiX takes"] if ratios else [])]
    lines = [f"{made['machine']['device']}, {made['mesh']} elements:", "", f"| {' | '.join(heads)} |"]
    lines.append("| --- " * len(heads) + "|")
    for row in made["rows"]:
        updates, loops = row["million_element_updates_per_s"], row.get("time_loop_seconds")
        fraction = max(row["fraction_of"].values())  # the lower limit is the relevant one
        cells = [row["contact"], row["precision"], str(row["runs"]), f"{row['seconds']:.3g}"]
        cells += ["–" if loops is None else f"{loops:.3g}"]
        cells += [f"{updates:.3g}" if updates < 1000.0 else f"{updates:.0f}", f"{100.0 * fraction:.2g} %"]
        if ratios:
            peer = ratios.get(str(row["runs"])) if _is_peers(row["contact"], row["precision"]) else None
            cells.append("–" if peer is None else f"{peer} times as long")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _comparable(measurements: list[Measurement]) -> list[Measurement]:
    return [m for m in measurements if _is_peers(m.contact, m.precision)]


def _is_peers(contact: str, precision: str) -> bool:
    """Whether CalculiX solves the same problem: without sliding, in double precision."""
    return contact == "bonded" and precision == "fp64"


def _row(m: Measurement, limits: list[Limit], kept: Histories) -> dict[str, Any]:
    return {
        "contact": m.contact,
        "precision": m.precision,
        "runs": m.runs,
        "steps": round(float(m.response.steps.mean()), 1),
        "seconds": round(m.seconds, 5),
        **({} if isnan(m.time_loops) else {"time_loop_seconds": round(m.time_loops, 5)}),
        "million_element_updates_per_s": round(m.updates / 1e6, 2),
        "fraction_of": {item.name: round(m.updates / item.updates, 4) for item in limits},
        "same_bits": m.same_bits,
        "completed": int(m.response.completed.sum()),
        "first_call_seconds": round(m.first_call, 2),
        **differences(m, kept),
    }
