"""A command may be killed or interrupted at any instant.

Usage: kill_test.py KROT [--kills N] [--interrupts N] [--seed S]
SIGKILL leaves the old output or the new one, to the byte, and a run after it
succeeds. SIGINT and SIGTERM end every command soon, without a trace, and with
--write_on_interrupt 1 with a valid model that is no worse than the input.
Prints a table for docs/history/reliability.md.
"""

import argparse
import json
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time

import harness

LATEST = 5  # seconds: what a busy machine may add to one is not KROT's


def run_and_signal(place, number, instant):
    """The result of a run that gets a signal after so many seconds, and how
    long it then took to end."""
    place.reset()
    with place.start(place.threads) as process:
        time.sleep(instant)
        process.send_signal(number)
        start = time.monotonic()
        _, err = process.communicate()
        seconds = time.monotonic() - start
    return subprocess.CompletedProcess([], process.returncode, "", err), seconds


def duration(place):
    place.reset()
    start = time.monotonic()
    place.run(place.threads)
    return time.monotonic() - start


def kill(place, count, dice):
    """How many were killed, and what was wrong."""
    seconds = duration(place)
    num_killed = 0
    wrong = []
    for _ in range(count):
        result, _ = run_and_signal(place, signal.SIGKILL,
                                   dice.uniform(0, seconds))
        num_killed += result.returncode < 0
        wrong += place.judge(result, (0, -signal.SIGKILL))
        wrong += place.judge_again()
    return num_killed, wrong


def interrupt(place, count, dice):
    """How many were interrupted, the longest seconds, and what was wrong."""
    seconds = duration(place)
    num_interrupted = 0
    longest = 0
    wrong = []
    for _ in range(count):
        number = dice.choice((signal.SIGINT, signal.SIGTERM))
        result, waited = run_and_signal(place, number,
                                        dice.uniform(0, seconds))
        num_interrupted += result.returncode != 0
        longest = max(longest, waited)
        wrong += place.judge(result, (0, 130, -number))
        if waited > LATEST:
            wrong.append(f"ended after {waited:.1f} s")
    return num_interrupted, longest, wrong


class LargeScene:
    """A model whose solve takes seconds."""

    def __init__(self, krot, folder):
        self.krot = krot
        self.folder = folder
        self.input = folder / "input"
        subprocess.run(
            [krot, "model_synthesizer", "--output_path", self.input,
             "--Scene.num_frames", "60", "--Scene.num_points", "20000",
             "--Scene.pixel_noise", "1", "--Scene.start_translation_noise",
             "0.01", "--Scene.start_point_noise", "0.01", "--random_seed", "5"],
            check=True, stdout=subprocess.DEVNULL)
        self.before = self.errors(self.input)

    def errors(self, model):
        report = self.folder / "errors.json"
        subprocess.run([self.krot, "model_analyzer", "--path", model,
                        "--report_path", report], check=True,
                       stdout=subprocess.DEVNULL)
        return json.loads(report.read_text())["pixel_error"]

    def interrupt(self, command, figure, dice):
        """Whether something was written, the seconds, and what was wrong."""
        out = self.folder / "out"
        subprocess.run(["rm", "-rf", out], check=True)
        with subprocess.Popen(
                [self.krot, command, "--input_path", self.input,
                 "--output_path", out, "--write_on_interrupt", "1"],
                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                text=True) as process:
            time.sleep(dice.uniform(0.2, 3))
            process.send_signal(signal.SIGINT)
            start = time.monotonic()
            _, err = process.communicate()
            seconds = time.monotonic() - start
        wrong = []
        if process.returncode not in (0, 130):
            wrong.append(f"exit code {process.returncode}: {err[-200:]}")
        if "nothing was written" in err:
            if out.exists():
                wrong.append("something was written")
            return False, seconds, wrong
        after = self.errors(out)
        if not after[figure] <= self.before[figure] * (1 + 1e-9):
            wrong.append(f"{figure} rose to {after[figure]}")
        if seconds > LATEST:
            wrong.append(f"ended after {seconds:.1f} s")
        return True, seconds, wrong


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("krot")
    parser.add_argument("--kills", type=int, default=3)
    parser.add_argument("--interrupts", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    dice = random.Random(options.seed)
    num_wrong = 0

    def report(title, wrong):
        nonlocal num_wrong
        num_wrong += len(wrong)
        for line in wrong:
            print(f"{title}: {line}", file=sys.stderr, flush=True)

    print("| command | killed | wrong | interrupted | longest, s | wrong |")
    print("|---|---|---|---|---|---|")
    for command in harness.COMMANDS:
        with tempfile.TemporaryDirectory(prefix="krot-kills-") as folder:
            place = harness.Place(options.krot, command, pathlib.Path(folder))
            killed, wrong = kill(place, options.kills, dice)
            report(command.title, wrong)
            interrupted, longest, more = interrupt(place, options.interrupts,
                                                   dice)
            report(command.title, more)
        print(f"| `{command.title}` | {killed} | {len(wrong)} | {interrupted} |"
              f" {longest:.2f} | {len(more)} |", flush=True)

    print("\n| with `--write_on_interrupt 1` | written | nothing yet | "
          "longest, s | wrong |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="krot-kills-") as folder:
        scene = LargeScene(options.krot, pathlib.Path(folder))
        for command, figure in (("solver", "max"),
                                ("point_triangulator", "max"),
                                ("bundle_adjuster", "rms")):
            outcomes = [scene.interrupt(command, figure, dice)
                        for _ in range(options.interrupts)]
            wrong = [line for outcome in outcomes for line in outcome[2]]
            report(command, wrong)
            written = sum(outcome[0] for outcome in outcomes)
            print(f"| `{command}` | {written} | {len(outcomes) - written} | "
                  f"{max(outcome[1] for outcome in outcomes):.2f} | "
                  f"{len(wrong)} |", flush=True)
    return 1 if num_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
