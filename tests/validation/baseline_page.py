"""Write docs/validation/baseline.md: other programs' specimens with the end friction taken out."""

import json
from pathlib import Path

from benchmarks.baseline_specimens import CASES, MATERIALS, NOISE, RESULTS, SCATTER, SHOWN, SPECIMENS

ROOT = Path(__file__).resolve().parents[2]
MADE_BY = {
    ("neo_hookean", "bonded"): "FElupe, DOLFINx",
    ("neo_hookean", "0.3"): "GetFEM",
}
"""Programs that made a case, GetFEM where it is not named."""


def page() -> str:
    """The page's text."""
    done = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    rows = []
    for law, ends in CASES:
        row = done.get(f"{law}/{ends}")
        if row is None:
            continue
        at = [min(range(len(row["strain"])), key=lambda k: abs(row["strain"][k] - e)) for e in SHOWN]
        cells = " | ".join(f"{100 * row['error'][k]:+.2f} ± {100 * row['k2'][k]:.2f}" for k in at)
        diameter, length, _ = MATERIALS[law]
        rows.append(
            f"| {law} | {1e3 * diameter:g} × {1e3 * length:g} | {ends} | {MADE_BY.get((law, ends), 'GetFEM')}"
            f" | {cells} | {'yes' if row['within_band'] else 'no'} | {100 * row['coverage']:.0f} % |"
        )
    missing = [f"{law}/{ends}" for law, ends in CASES if f"{law}/{ends}" not in done]
    left = f"\nNot run yet: {', '.join(missing)}.\n" if missing else ""
    head = " | ".join(f"{100 * e:.0f} %" for e in SHOWN)
    return f"""# End friction in the quasi-static test

`python -m benchmarks.baseline_specimens --workers 4` makes the numbers, `python
tests/validation/baseline_page.py` this page.

## Against other programs

Specimens of known laws, compressed by programs that share no code with this package (`tests/reference`,
tables A, G and H): FElupe and DOLFINx, or GetFEM with Coulomb's law exact at every node. "bonded" is f = 1000
where GetFEM made it. Their forces are taken for a measured test without its law, and the friction is taken
out ({{doc}}`../howto/reference_curve`). Error of the nominal stress found, with the k = 2 band [%]:

| law | size [mm] | ends | made by | {head} | in the band | coverage |
| --- | --- | --- | --- | {" | ".join(["---"] * len(SHOWN))} | --- | --- |
{chr(10).join(rows)}
{left}
Coverage: share of strains and of 100 draws whose band holds the truth. A draw is {SPECIMENS} specimens
whose stiffness scatters by {100 * SCATTER:g} % and every sample by {100 * NOISE:g} %, taken through the
derivative of the correction.

## What a force cannot tell

A curve of the first invariant and a law of both invariants can meet one force equally well and differ by
several per cent in the uniaxial stress behind it: the platens shear the specimen, and shear sees I2. Laws are
therefore weighed by Schwarz's criterion, their spread is in the band, and where two that meet the test
differ by more than 2 % a warning names them. The radius at mid-height (`--bulge`) is fitted with the force
where it was measured.
"""


def main() -> None:
    """Write the page."""
    (ROOT / "docs" / "validation" / "baseline.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
