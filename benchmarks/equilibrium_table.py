"""Results of `benchmarks.equilibrium`, stored in one file and as the table of a page."""

import json
from pathlib import Path
from typing import Any

SAME = ("cells", "kind", "steps", "strain", "linear", "device", "threads", "where")
"""Fields that are equal for measurements of the same case."""
PEERS = {"dolfinx": "DOLFINx with MUMPS", "felupe": "FElupe"}
"""Names of the other programs by the key of their entry."""


def merged(path: Path, entries: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The entries of a file, sorted by size; newer entries replace those of the same case."""
    kept = json.loads(path.read_text("utf-8")) if path.exists() else []
    newer = [[one[key] for key in SAME] for one in entries]
    kept = [one for one in kept if [one[key] for key in SAME] not in newer]
    return sorted([*kept, *entries], key=lambda one: (one["device"], one["linear"], one["displacements"]))


def table(entries: list[dict[str, Any]]) -> str:
    """One row for each measurement, followed by a line for each other program that solved the same case."""
    lines = [
        "| displacements | elements | steps | linear solver | kernels on | machine | clock (s) "
        "| processor (s) | factorisations, iterations |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in entries:
        threads = "1 thread" if one["threads"] == 1 else f"{one['threads']} threads"
        cells = [
            f"{one['displacements']:,}".replace(",", " "),
            f"{' x '.join(map(str, one['cells']))} {one['kind']}",
            f"{one['steps']} to {100 * one['strain']:g} %",
            one["linear"],
            one["device"],
            f"{one['where']}, {threads}",
            f"{one['seconds']:.3g}",
            f"{one['processor seconds']:.3g}",
            f"{one['factorisations']}, {one['iterations']}",
        ]
        if one["outcome"] != "COMPLETED":
            cells[-1] += f": {one['outcome']}"
        lines.append(f"| {' | '.join(cells)} |")
    for one in entries:
        for name in PEERS.keys() & one.keys():
            peer = one[name]["processor seconds"]
            ratio = peer / one["processor seconds"]
            lines += [
                "",
                f"{PEERS[name]} in the same run: {peer:.3g} s of the processor, {ratio:.1f} times as long; "
                f"the forces differ by at most {one['largest difference']:.1e}.",
            ]
    return "\n".join(lines)
