"""`python -m benchmarks.files [COUNT]`: how files in layouts drawn at random are read.

Writes `layouts.csv` beside this file: by where the units are declared, how many files are read
right, with seconds assumed aloud, with a unit that is listed as not used, refused with an option,
or wrongly. Ends with status 1 where any is read wrongly.
"""

import csv
import sys
from collections import Counter, defaultdict
from pathlib import Path

from benchmarks.files.corpus import outcome_of

OUTCOMES = ("right", "aloud", "listed", "refused", "wrong")


def main(count: int) -> int:
    """Draw and read files, and write the table."""
    table: dict[str, Counter[str]] = defaultdict(Counter)
    for seed in range(count):
        outcome, layout = outcome_of(seed)
        kind = outcome if outcome in OUTCOMES else "wrong"
        table[layout[0]][kind] += 1
        if kind == "wrong":
            print(seed, outcome, layout)
    with Path(__file__).with_name("layouts.csv").open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file, lineterminator="\n")
        lines.writerow(["units declared in", "files", *OUTCOMES])
        total = sum(table.values(), Counter())
        for place, counts in [*sorted(table.items()), ("all", total)]:
            lines.writerow([place, counts.total(), *(counts[each] for each in OUTCOMES)])
    print(dict(total))
    return 1 if total["wrong"] else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 5000))
