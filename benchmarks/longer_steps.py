"""What a sharper step bound could save, and what it would cost: `python -m benchmarks.longer_steps`.

One run of the benchmarks' problem with shares of the element-by-element bound up to where it fails. Where it
fails is the limit that no bound of the assembled mesh can pass; the force is compared with that of steps a
fifth of the bound.
"""

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

import explicit
from benchmarks.problem import SAMPLING, model, samples
from explicit import Stepping
from kolsky.cli import texts

SHARES = (0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5)
REFERENCE = 0.2


def stepping(bound: Any, share: float) -> Stepping:
    """Steps of a share of the bound, which may be more than the one that holds."""
    made = replace(Stepping(bound=bound), safety=min(share, 1.0))
    object.__setattr__(made, "safety", share)
    return made


def compared(mesh: tuple[int, int], contact: str) -> list[str]:
    """Rows of the table: steps and force of each share."""
    problem, one = model(mesh, contact), samples(1)

    def run(bound: str, share: float) -> explicit.Response:
        return explicit.run(problem, one, SAMPLING, stepping=stepping(bound, share), device="cpu")

    reference = run("eigenvalue", REFERENCE).force_transmission[0]
    rows = []
    for bound, share in [("trace", 0.9), *(("eigenvalue", share) for share in SHARES)]:
        found = run(bound, share)
        off = float(np.sqrt(np.mean((found.force_transmission[0] - reference) ** 2)))
        told = f"{off:.3f}" if found.completed[0] else "fails"
        rows.append(f"| {mesh[0]} x {mesh[1]}, {contact} | {bound} | {share} | {found.steps[0]} | {told} |")
    return rows


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mesh", nargs="+", default=["16x22", "32x44"])
    given = parser.parse_args()
    print("| mesh, faces | bound | share | steps | force, N rms |\n| --- | --- | --- | --- | --- |")
    for mesh in given.mesh:
        for contact in ("bonded", "coulomb"):
            print("\n".join(compared(texts.mesh("--mesh", mesh), contact)), flush=True)


if __name__ == "__main__":
    main()
