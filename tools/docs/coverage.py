"""Sums gcovr's report up by folders of the library.

Usage: coverage.py COVERAGE_JSON UNREACHED
Prints a table for docs/history/reliability.md; UNREACHED gets one line for each
line of code that no test reached, and for each that did not go all of its ways.
"""

import collections
import json
import pathlib
import sys


def main():
    report, unreached = sys.argv[1:]
    sums = collections.defaultdict(lambda: [0, 0, 0, 0])
    missing = []
    for file in json.loads(pathlib.Path(report).read_text())["files"]:
        name = file["file"]
        sum_ = sums[name.split("/")[2]]
        for line in file["lines"]:
            if line["gcovr/noncode"]:
                continue
            taken = [branch["count"] > 0 for branch in line["branches"]]
            for i, count in enumerate((line["count"] > 0, 1, sum(taken),
                                       len(taken))):
                sum_[i] += count
            if line["count"] == 0:
                missing.append(f"{name}:{line['line_number']}: not reached")
            elif not all(taken):
                missing.append(f"{name}:{line['line_number']}: {sum(taken)} of "
                               f"{len(taken)} ways")
    print("| folder | lines | reached | branches | taken |")
    print("|---|---:|---:|---:|---:|")
    for folder, (reached, lines, taken, branches) in sorted(sums.items()):
        print(f"| `{folder}` | {lines} | {100 * reached / lines:.1f} % | "
              f"{branches} | {100 * taken / max(branches, 1):.1f} % |")
    pathlib.Path(unreached).write_text("\n".join(missing) + "\n")


if __name__ == "__main__":
    main()
