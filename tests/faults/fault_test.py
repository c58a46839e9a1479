"""Every call of the system may fail: what a command leaves is whole.

Usage: fault_test.py KROT --library FILE [--limit N] [--memory N] [--seed S]
         [--command NAME] [--kind NAME]
Of each command and each kind of fault in faults.cc the 1st, 2nd, 3rd ... call
fails until a run passes untouched; with a limit, so many of them by chance.
--memory is that of malloc, which a command calls tens of thousands of times.
Prints a table for docs/history/reliability.md.
"""

import argparse
import pathlib
import random
import sys
import tempfile

import harness

# Kind: which exit codes may follow. A read that fails is a model that cannot
# be read, or an output that cannot be; a call that is only asked for something
# better, like a hard link, may fail without consequence.
READ = (0, 1, 2, 5)
WRITE = (0, 5)
KINDS = {
    "open": READ, "stat": READ, "read": READ, "read_short": (0,),
    "read_interrupted": (0,), "list": READ, "write": WRITE,
    "write_short": (0,), "write_interrupted": (0,), "fsync": WRITE,
    "close": READ, "rename": WRITE, "rename_without_exchange": WRITE,
    "link": WRITE, "write_without_link": WRITE, "mkdir": WRITE,
    "remove": WRITE, "chmod": WRITE, "mmap": (0, 6), "malloc": (0, 5, 6),
    "thread": (0, 6), "kill": (0, -9), "kill_without_exchange": (0, -9),
}
LASTING = ("open", "stat", "read", "write", "fsync", "rename", "link", "mkdir",
           "remove", "chmod", "thread", "mmap")


class Injector:
    def __init__(self, place, library):
        self.place = place
        self.library = library
        self.log = place.folder.parent / "faults.log"
        self.calls = {}

    def run(self, fault):
        """The result, whether the fault struck, and the calls of each kind if
        it ended."""
        self.log.unlink(missing_ok=True)
        self.place.reset()
        kind = fault.split(":")[0]
        result = self.place.run(self.place.threads if kind == "thread" else 1,
                                {"LD_PRELOAD": self.library,
                                 "KROT_FAULT": fault,
                                 "KROT_FAULT_LOG": str(self.log)})
        words = self.log.read_text().split() if self.log.exists() else []
        calls = {name: int(count) for name, count in zip(words[::2], words[1::2])
                 if name in KINDS}
        return result, "struck" in words, calls

    def count(self, kind):
        """The calls of this kind in a run without a fault."""
        if kind == "thread" or kind not in self.calls:
            counted = self.run(f"{kind}:0")[2]
            self.calls = {**counted, **self.calls, kind: counted.get(kind, 0)}
        return self.calls[kind]


def test_kind(injector, kind, limit, dice):
    """Faults injected, how many were refused, how many ended by a signal, and a
    line for each thing that is wrong."""
    numbers = range(1, injector.count(kind) + 1)
    faults = [f"{kind}:{n}" for n in numbers]
    if kind in LASTING:
        faults += [f"{kind}:{n}+" for n in numbers]
    if limit and len(faults) > limit:
        faults = dice.sample(faults, limit)
    num_refused = num_signals = 0
    wrong = []
    for fault in faults:
        result, has_struck, _ = injector.run(fault)
        complaints = injector.place.judge(result, KINDS[kind])
        if injector.place.command.checkpoint:
            complaints += injector.place.judge_again()
        if not has_struck:
            complaints.append("it did not strike")
        num_refused += result.returncode > 0
        num_signals += result.returncode < 0
        for complaint in complaints:
            wrong.append(f"{injector.place.command.title}: {fault}: {complaint}"
                         f" ({result.stderr.splitlines()[-1:]})")
    return len(faults), num_refused, num_signals, wrong


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("krot")
    parser.add_argument("--library", type=pathlib.Path, required=True)
    parser.add_argument("--limit", type=int, default=0)
    parser.add_argument("--memory", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--command", default="")
    parser.add_argument("--kind", default="")
    options = parser.parse_args()
    dice = random.Random(options.seed)
    totals = {kind: [0, 0, 0, 0] for kind in KINDS}
    for command in harness.COMMANDS:
        if options.command not in command.title:
            continue
        with tempfile.TemporaryDirectory(prefix="krot-faults-") as folder:
            place = harness.Place(options.krot, command, pathlib.Path(folder))
            injector = Injector(place, str(options.library.resolve(strict=True)))
            for kind in KINDS:
                if options.kind and kind != options.kind:
                    continue
                limit = options.limit
                if kind == "malloc" and options.memory:
                    limit = options.memory
                *counts, wrong = test_kind(injector, kind, limit, dice)
                for line in wrong:
                    print(line, file=sys.stderr, flush=True)
                for i, count in enumerate((*counts, len(wrong))):
                    totals[kind][i] += count

    print("| call that fails | injected | refused | done all the same | "
          "ended by a signal | wrong |")
    print("|---|---|---|---|---|---|")
    for kind, (injected, refused, signals, wrong) in totals.items():
        print(f"| `{kind}` | {injected} | {refused} | "
              f"{injected - refused - signals} | {signals} | {wrong} |")
    if not any(injected for injected, *_ in totals.values()):
        sys.exit("no fault was injected")
    return 1 if any(total[-1] for total in totals.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
