"""A laboratory's script over identified shots: `python runs/rate_report.py SHOT SHOT ...`.

It writes what `kolsky rate` writes, into the folder rates, and has the numbers at hand: here the shot of each
group without which the mean moves most.
"""

import sys
from pathlib import Path

from kolsky.report.pages.rates import write_page
from kolsky.studies.rates.collect import collected_shot, declarations, group_key, group_of
from kolsky.studies.rates.comparison import compare
from kolsky.studies.rates.output import write_csv, write_hdf5

folders = [Path(word) for word in sys.argv[1:]]
if not folders:
    sys.exit("give the folders of identified shots")
files = [declarations(folder)[0] for folder in folders]
key = group_key(files, None)
shots = [
    collected_shot(folder, group=group_of(file, key)) for folder, file in zip(folders, files, strict=True)
]
report = compare(shots, grouped_by=key)
out = Path("rates")
out.mkdir(exist_ok=True)
write_hdf5(out / "rates.h5", report)
write_csv(out, report)
write_page(out / "rates.html", report)

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
