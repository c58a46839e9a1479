"""The folder that a command writes to fills up, vanishes, or has other guests.

Usage: folder_test.py KROT [--rounds N] [--seed S]
A small tmpfs needs root; without, the full disk is left to fault_test.py.
Prints a table for docs/history/reliability.md.
"""

import argparse
import contextlib
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

import harness

PAGE = 4096


@contextlib.contextmanager
def small_disk():
    """A disk of four megabytes; None where it cannot be mounted."""
    with tempfile.TemporaryDirectory(prefix="krot-disk-") as folder:
        mounted = os.geteuid() == 0 and subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=4m", "krot", folder],
            stderr=subprocess.DEVNULL, check=False).returncode == 0
        try:
            yield pathlib.Path(folder) if mounted else None
        finally:
            if mounted:
                subprocess.run(["umount", folder], check=True)


def fill(disk, pages_left):
    """Fills the disk with one file, up to so many pages."""
    free = shutil.disk_usage(disk).free - pages_left * PAGE
    (disk / "filler").write_bytes(bytes(max(0, free)))


def full_disk(krot, command, stride):
    """Runs that were refused, those that went well, and what was wrong; None
    without root."""
    with small_disk() as disk:
        if disk is None:
            return None
        place = harness.Place(krot, command, disk)
        refused = 0
        wrong = []
        for pages in range(0, 200, stride):
            (disk / "filler").unlink(missing_ok=True)
            place.reset()
            fill(disk, pages)
            result = place.run()
            refused += result.returncode != 0
            wrong += [f"{pages} pages left: {line}"
                      for line in place.judge(result, (0, 5))]
            if ".krot-" in "".join(result.stderr.splitlines()[-1:]):
                wrong.append(f"{pages} pages left: a name that nobody knows: "
                             + result.stderr)
            if result.returncode == 0:
                return refused, 1, wrong
        return refused, 0, wrong + ["it never went well"]


def vanishing_input(krot, command, rounds, dice):
    """The input disappears at any instant."""
    refused = 0
    wrong = []
    with tempfile.TemporaryDirectory(prefix="krot-gone-") as folder:
        place = harness.Place(krot, command, pathlib.Path(folder))
        for _ in range(rounds):
            place.reset()
            with place.start() as process:
                time.sleep(dice.uniform(0, 0.2))
                shutil.rmtree(place.folder / "input")
                _, err = process.communicate()
            shutil.copytree(place.pristine / "input", place.folder / "input")
            result = subprocess.CompletedProcess([], process.returncode, "",
                                                 err)
            refused += result.returncode != 0
            wrong += place.judge(result, (0, 2))
    return refused, rounds - refused, wrong


def vanishing_parent(krot, rounds, dice):
    """The output's parent disappears, or turns into a file."""
    refused = done = 0
    wrong = []
    command = harness.Command(
        "solver", ["--input_path", "@input", "--output_path", "@deep/out"])
    with tempfile.TemporaryDirectory(prefix="krot-gone-") as folder:
        place = harness.Place(krot, command, pathlib.Path(folder))
        expected = harness.state(place.folder / "deep" / "out")
        for _ in range(rounds):
            place.reset()
            deep = place.folder / "deep"
            deep.mkdir()
            becomes_file = dice.random() < 0.5
            with place.start() as process:
                time.sleep(dice.uniform(0, 0.2))
                # At once: piece by piece, it would be this test that leaves
                # pieces of what is put there meanwhile.
                gone = place.folder / "gone"
                deep.rename(gone)
                with contextlib.suppress(OSError):
                    if becomes_file:
                        deep.write_text("a file")
                _, err = process.communicate()
            shutil.rmtree(gone)  # with what was in the making
            out = deep / "out"
            refused += process.returncode != 0
            done += process.returncode == 0
            if process.returncode not in (0, 5):
                wrong.append(f"exit code {process.returncode}: {err[-200:]}")
            if out.exists() and harness.state(out) != expected:
                wrong.append("the output is a piece")
            if any(path.name.startswith(".")
                   for path in place.folder.rglob("*")):
                wrong.append("a temporary is left")
    return refused, done, wrong


def guests(krot, rounds):
    """Two runs with different results replace one folder at the same time."""
    refused = done = 0
    wrong = []
    words = harness.SOLVED + ["--Solver.finish"]
    commands = [harness.Command("solver", words + [finish], ("out",))
                for finish in ("none", "least_squares")]
    with contextlib.ExitStack() as stack:
        places = [
            harness.Place(krot, command, pathlib.Path(stack.enter_context(
                tempfile.TemporaryDirectory(prefix="krot-guests-"))))
            for command in commands]
        home = places[0].folder
        places[1].folder = home
        for _ in range(rounds):
            places[0].reset()
            processes = [place.start() for place in places]
            results = [process.communicate()[1] for process in processes]
            for process, err in zip(processes, results):
                refused += process.returncode != 0
                done += process.returncode == 0
                if process.returncode not in (0, 5):
                    wrong.append(f"exit code {process.returncode}: {err[-200:]}")
            found = harness.state(home, ("out",))
            if found not in [place.new for place in places]:
                wrong.append("the output is a mix")
            if set(harness.state(home)) != set(places[0].old):
                wrong.append("something is left")
    return refused, done, wrong


def neighbours(krot, rounds):
    """Two runs create folders in a folder that neither finds."""
    done = 0
    wrong = []
    with tempfile.TemporaryDirectory(prefix="krot-deep-") as folder:
        place = harness.Place(
            krot, harness.Command("model_synthesizer",
                                  ["--output_path", "@first"]),
            pathlib.Path(folder))
        for _ in range(rounds):
            place.reset()
            processes = [
                subprocess.Popen(
                    [krot, "model_synthesizer", "--output_path",
                     place.folder / "results" / name / "model"],
                    stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                    text=True) for name in ("a", "b", "c")]
            for process in processes:
                _, err = process.communicate()
                done += process.returncode == 0
                if process.returncode != 0:
                    wrong.append(err)
            names = sorted(path.relative_to(place.folder / "results").as_posix()
                           for path in (place.folder / "results").glob("*/*"))
            if names != ["a/model", "b/model", "c/model"]:
                wrong.append(f"found {names}")
            if list(place.folder.rglob(".*")):
                wrong.append("a temporary is left")
    return 0, done, wrong


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("krot")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--stride", type=int, default=9)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    dice = random.Random(options.seed)
    krot = options.krot
    num_wrong = 0

    def report(title, outcome):
        nonlocal num_wrong
        if outcome is None:
            print(f"| {title} | – | – | not root |", flush=True)
            return
        refused, done, wrong = outcome
        num_wrong += len(wrong)
        for line in wrong:
            print(f"{title}: {line}", file=sys.stderr, flush=True)
        print(f"| {title} | {refused} | {done} | {len(wrong)} |", flush=True)

    print("| what happens | refused | done | wrong |")
    print("|---|---|---|---|")
    for command in harness.COMMANDS:
        if command.folders:
            report(f"the disk is full, `{command.title}`",
                   full_disk(krot, command, options.stride))
    for command in harness.COMMANDS[:4]:
        report(f"the input vanishes, `{command.title}`",
               vanishing_input(krot, command, options.rounds, dice))
    report("the output's parent vanishes",
           vanishing_parent(krot, options.rounds, dice))
    report("two runs replace one folder", guests(krot, options.rounds))
    report("three runs create one parent", neighbours(krot, options.rounds))
    return 1 if num_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
