"""A laboratory's script over identified shots: `python runs/rate_report.py SHOT SHOT ...`.

It writes the files of `kolsky rate` into the folder rates. It also shows how to use the numbers: for each
group it prints the shot whose removal changes the mean most.
"""

import sys
from pathlib import Path

import kolsky

if len(sys.argv) < 2:
    sys.exit("give the folders of identified shots")
report = kolsky.rate(sys.argv[1:])
kolsky.write_results(Path("rates"), report)

for group in report.groups:
    print(f"{group.name}: {len(group.counted)} shots count")
    if group.pooled is None or group.slope is None:
        continue
    low, high = group.pooled.interval
    print(f"  m = {group.pooled.mean:.4f}, 95 % {low:.4f} to {high:.4f}; {group.slope.verdict}")
    moved = [
        (abs(float(fit.coefficients[0]) - group.pooled.mean), shot.name)
        for shot, fit in zip(group.counted, group.pooled.leave_one_out, strict=True)
        if fit is not None
    ]
    if moved:
        change, name = max(moved)
        print(f"  without {name} the mean moves by {change:.4f}")
    print(*(f"  {remark}" for remark in (*group.slope.reasons, *group.remarks)), sep="\n")
