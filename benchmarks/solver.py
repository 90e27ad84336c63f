"""The solver's speed compared with the limits of the device and with CalculiX.

    python -m benchmarks.solver                              # CPU, fp64 and fp32
    python -m benchmarks.solver --device cuda                # a GPU
    python -m benchmarks.solver --save cpu.npz               # also keep the histories ...
    python -m benchmarks.solver --device cuda --compare cpu.npz   # ... and compare with them

It prints runs, seconds and element updates per second. It also prints their fraction of the device's limit,
which it measures in the same run (`benchmarks.limits`). If `ccx` is on the PATH, it also prints the time of
the bonded problem in CalculiX (`benchmarks.peer`). The problem is in `benchmarks.problem`, with bonded
platens and with Coulomb friction on the faces and on the side surface. Run nothing else at the same time.
"""

import argparse
import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks import histories, table
from benchmarks.counting import cost
from benchmarks.limits import limits
from benchmarks.measure import measure
from benchmarks.peer import WINDOW, measure_peer, program
from benchmarks.problem import model
from explicit import Stepping
from explicit.device import select_device
from explicit.precision import PRECISIONS

CONTACTS, NUMBERS = ("bonded", "coulomb"), ("fp64", "fp32")


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.solver", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--runs", type=int, nargs="+", default=[1, 100])
    parser.add_argument("--mesh", default="16x22")
    parser.add_argument(
        "--bound", choices=("trace", "eigenvalue"), default="trace", help="see Stepping.bound"
    )
    parser.add_argument("--repeats", type=int, default=3, help="timed repeats after a first that compiles")
    parser.add_argument("--peer-time", type=float, default=WINDOW, help="simulated by CalculiX [s]; 0: none")
    parser.add_argument("--json", type=Path, help="write the table here")
    parser.add_argument("--save", type=Path, help="keep the histories of the smaller batches (npz)")
    parser.add_argument("--compare", type=Path, help="compare with histories kept by --save")
    options = parser.parse_args(arguments)
    across, along = (int(part) for part in options.mesh.split("x"))
    mesh, device, cores = (across, along), select_device(options.device), os.cpu_count() or 1
    kept, measurements = histories.load(options.compare), []

    if table.is_busy():
        print("This machine has other work: what follows takes too long, the limits too, and not alike.\n")
    work = cost(model(mesh, "bonded"), Stepping().measure_every)
    most = {name: limits(device, PRECISIONS[name], work.instructions, cores) for name in NUMBERS}
    print(
        f"{device.name}, {options.mesh} elements", table.cost_line(work), *table.limit_lines(most), sep="\n"
    )
    print(f"\n{table.HEAD}")
    for contact in CONTACTS:
        for name in NUMBERS:
            first = measure(mesh, contact, 1, name, options.device, 1).first_call
            for runs in options.runs:
                found = measure(mesh, contact, runs, name, options.device, options.repeats, options.bound)
                measurements.append(replace(found, first_call=first))
                print(table.line(measurements[-1], most[name]), flush=True)
    peer = None
    if options.peer_time > 0.0 and program() is None:
        print("\nCalculiX: no ccx on the PATH, so nothing to compare with (Debian and Ubuntu: calculix-ccx)")
    elif options.peer_time > 0.0:
        peer = measure_peer(mesh, window=options.peer_time)
        print("", *table.peer_lines(peer, measurements, cores), sep="\n")
    if options.save:
        histories.save(options.save, measurements)
    if options.json:
        text = table.as_json(
            device=device.name,
            mesh=options.mesh,
            bound=options.bound,
            measurements=measurements,
            cost=work,
            limits=most,
            peer=peer,
            kept=kept,
        )
        options.json.write_text(json.dumps(text, indent=1) + "\n")


if __name__ == "__main__":
    main()
