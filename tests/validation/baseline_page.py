"""Write the numbers of docs/validation/baseline.md: the end friction of specimens of other programs."""

import json
import sys
from pathlib import Path
from typing import Any

from populations import baseline_specimens, bonded_cylinders
from populations.baseline_specimens import CASES, CHOSEN_ON, FILE, MATERIALS, SHOWN
from populations.bonded_cylinders import line, recorded
from populations.thesis_cylinder import FILE as THESIS
from populations.thesis_cylinder import PLANTED

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests" / "helpers"))
from page_values import store  # noqa: E402

PAGE = ROOT / "docs" / "validation" / "baseline.md"


def shown() -> dict[str, object]:
    """Further names of the page."""
    done = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    lines = []
    for key in CASES:
        row = done.get("/".join(key))
        if row is None:
            continue
        name, ends, program = key
        at = [min(range(len(row["strain"])), key=lambda k: abs(row["strain"][k] - e)) for e in SHOWN]
        cells = " | ".join(f"{100 * row['error'][k]:+.2f} ± {100 * row['k2'][k]:.2f}" for k in at)
        diameter, length, _ = MATERIALS[name]
        lines.append(
            f"| {name} | {1e3 * diameter:g} × {1e3 * length:g} | {ends} | {program} | {cells}"
            f" | {100 * row['worst_to_half']:.2f} | {'yes' if row['within_band'] else 'no'}"
            f" | {100 * row['coverage']:.1f} % |"
        )
    missing = ["/".join(key) for key in CASES if "/".join(key) not in done]
    left = f"\nNot run yet: {', '.join(missing)}.\n" if missing else ""
    draws = max((row["draws"] for row in done.values()), default=1000)
    head = " | ".join(f"{100 * e:.0f} %" for e in SHOWN)
    rows = "\n".join(lines)
    bonded = recorded()
    seed = json.loads(bonded_cylinders.FILE.read_text(encoding="utf-8"))["seed"]
    right = sum(row["judged"]["right"] for row in bonded)
    determined = sum(len(row["judged"]["determined"]) for row in bonded)
    every = sum(len(row["cylinder"]["constants"]) for row in bonded)
    mesh = 100.0 * max(row["mesh"] for row in bonded)
    cylinders = "\n".join(map(line, bonded))
    return vars(baseline_specimens) | {"READING_NOISE": bonded_cylinders.NOISE} | locals()


def verdict(done: dict[str, Any]) -> str:
    """What the table says, of all specimens and of the judged ones."""
    said = []
    for words, wanted in (
        (
            "specimens of the test",
            lambda row: not row.startswith(CHOSEN_ON[-1]) and row.split("/")[0] not in CHOSEN_ON,
        ),
        ("all", lambda row: True),
    ):
        rows = [row for name, row in done.items() if wanted(name)]
        if not rows:
            continue
        low, high = (100 * end([row["coverage"] for row in rows]) for end in (min, max))
        said.append(
            f"- {words}: {sum(row['within_band'] for row in rows)} of {len(rows)} are inside their band at"
            f" every strain.\n  The worst error is {100 * max(row['worst_to_half'] for row in rows):.2f} %,"
            f" the coverage {low:.1f} to {high:.1f} %."
        )
    return "\n".join([*said, *(outside(name, row) for name, row in done.items() if not row["within_band"])])


def outside(name: str, row: dict[str, Any]) -> str:
    """Where a specimen's curve leaves its band, and by how much."""
    beyond = [abs(error) - k2 for error, k2 in zip(row["error"], row["k2"], strict=True)]
    strains = [strain for strain, more in zip(row["strain"], beyond, strict=True) if more > 0.0]
    return (
        f"- {name} leaves its band at {len(strains)} of {len(beyond)} strains, {100 * min(strains):.0f} to"
        f" {100 * max(strains):.0f} %, by\n  {100 * max(beyond):.2f} points at most."
    )


def thesis_rows() -> str:
    """Constants found from both programs' forces."""
    found = json.loads(THESIS.read_text(encoding="utf-8")) if THESIS.exists() else {}
    rows = []
    for program, one in found.items():
        cells = [
            f"{one['constants'][name]:.1f} ± {2 * one['sigma'][name]:.1f} | "
            f"{100 * (one['constants'][name] / planted - 1):+.2f} %"
            for name, planted in PLANTED.items()
        ]
        rows.append(f"| {program} | {' | '.join(cells)} |")
    return "\n".join(rows)


if __name__ == "__main__":
    store(PAGE, globals() | shown())
