"""Changes the certificate checker in one place at a time; its tests must notice.

Usage: mutate_checker.py BUILD [--count N] [--skip N] [--seed S] [--jobs N]
                         [--only FILE[:LINE]]...
BUILD is a build folder with verify_test (Ninja). Each mutant is one operator,
bound or constant of the checker's sources that becomes another; it is compiled,
linked into verify_test and run. Prints the mutants that no test notices, with
their line, and a summary for docs/history/reliability.md. Those that change
nothing, or nothing that can be told, stand in equivalent_mutants.txt with the
reason. The exit code is 0 if no other went unnoticed, and all of that list are mutants.
"""

import argparse
import concurrent.futures
import pathlib
import random
import re
import shlex
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
VERIFY = ROOT / "src" / "krot" / "verify"
# What judges, as opposed to what makes certificates.
CHECKER = ("certificate_check.cc", "force_balance.cc", "force_checker.cc")
EQUIVALENT = pathlib.Path(__file__).with_name("equivalent_mutants.txt")
TIMEOUT = 60  # seconds of a test: what takes longer hangs, and is noticed

# Operators stand between blanks, template brackets do not.
CHANGES = [
    (r" < ", " <= "), (r" <= ", " < "), (r" > ", " >= "), (r" >= ", " > "),
    (r" < ", " > "), (r" == ", " != "), (r" != ", " == "),
    (r" \+ ", " - "), (r" - ", " + "), (r" \* ", " / "), (r" / ", " * "),
    (r" \+= ", " -= "), (r" -= ", " += "), (r" && ", " || "),
    (r" \|\| ", " && "), (r"if \(!", "if ("), (r"\btrue\b", "false"),
    (r"\bfalse\b", "true"), (r"std::max\b", "std::min"),
    (r"std::min\b", "std::max"), (r"\b1e-(\d+)\b", r"1e-1\1"),
    (r"(?<![\w.])1(?![\w.])", "2"), (r"(?<![\w.])0(?![\w.])", "1"),
    (r"(?<![\w.])2(?![\w.>])", "1"), (r"(= |\()-(?=\w)", r"\1"),
    (r"\.cwiseAbs\(\)", ""), (r"std::abs\(", "("),
]
SKIPPED = re.compile(r"^\s*(//|#|static_assert|using|namespace)")


def mutants():
    """Every place and change: file, line number, the line as it becomes."""
    for name in CHECKER:
        for number, line in enumerate((VERIFY / name).read_text().splitlines()):
            code = line.split("//")[0]
            if SKIPPED.match(line) or '"' in code:
                continue
            for pattern, replacement in CHANGES:
                for match in re.finditer(pattern, code):
                    changed = (code[:match.start()] +
                               match.expand(replacement) + code[match.end():])
                    yield name, number, changed


def original(mutant):
    name, line, _ = mutant
    return (VERIFY / name).read_text().splitlines()[line].split("//")[0]


def key(mutant):
    """What the list of equivalent mutants knows it by: no line number."""
    return mutant[0], original(mutant).strip(), mutant[2].strip()


def read_equivalent():
    """The reason by key, from blocks of four lines with an empty one between:
    the file, the line as it stands, as it becomes, and the reason."""
    reasons = {}
    for block in EQUIVALENT.read_text().split("\n\n"):
        lines = [line.strip() for line in block.splitlines()
                 if line and not line.startswith("#")]
        if lines:
            name, before, after, *reason = lines
            reasons[name, before, after] = " ".join(reason)
    return reasons


def is_chosen(mutant, places):
    return not places or any(
        place in (mutant[0], f"{mutant[0]}:{mutant[1] + 1}")
        for place in places)


class Bench:
    """Compiles and links verify_test with other checkers."""

    def __init__(self, build, scratch):
        self.build = build
        self.scratch = scratch
        commands = subprocess.run(
            ["ninja", "-C", build, "-t", "commands", "tests/verify_test"],
            check=True, capture_output=True, text=True).stdout.splitlines()
        link = commands[-1].removeprefix(": && ").removesuffix(" && :")
        self.link = shlex.split(link)
        compile_line = next(line for line in commands if "krot_verify.dir" in
                            line and " -c " in line)
        words = shlex.split(compile_line)
        self.flags = [word for i, word in enumerate(words)
                      if word.startswith(("-I", "-D", "-std"))
                      or word == "-isystem" or words[i - 1] == "-isystem"]
        self.header = scratch / "all.h"
        self.header.write_text(
            "#include <Eigen/LU>\n#include <algorithm>\n#include <cmath>\n"
            "#include <functional>\n#include <limits>\n#include <numeric>\n"
            "#include <optional>\n#include <queue>\n#include <sstream>\n"
            "#include <tuple>\n#include <utility>\n#include <vector>\n")
        self.compile(self.header, scratch / "all.h.gch",
                     ["-x", "c++-header"], [])
        self.objects = {}
        for source in sorted(VERIFY.glob("*.cc")):
            target = scratch / (source.name + ".o")
            self.compile(source, target)
            self.objects[source.name] = target

    def compile(self, source, target, before=(), header=None):
        include = ["-include", self.header] if header is None else header
        subprocess.run(["g++", *self.flags, "-O0", "-w", *include, *before,
                        "-c", source, "-o", target], cwd=self.build, check=True,
                       capture_output=True)

    def is_noticed(self, mutant, number):
        """Whether verify_test fails; None if it does not compile."""
        name, line, text = mutant
        lines = (VERIFY / name).read_text().splitlines()
        lines[line] = text
        source = self.scratch / f"{number}.cc"
        source.write_text("\n".join(lines) + "\n")
        target = self.scratch / f"{number}.o"
        try:
            self.compile(source, target)
        except subprocess.CalledProcessError:
            return None
        program = self.scratch / f"{number}.test"
        objects = [str(file) for key, file in self.objects.items()
                   if key != name] + [str(target)]
        words = []
        for word in self.link:
            words += objects if "libkrot_verify.a" in word else [word]
        words[words.index("-o") + 1] = str(program)
        subprocess.run(words, cwd=self.build, check=True, capture_output=True)
        try:
            return subprocess.run(
                [program, "--gtest_brief=1", "--gtest_fail_fast"],
                capture_output=True, timeout=TIMEOUT,
                check=False).returncode != 0
        except subprocess.TimeoutExpired:
            return True
        finally:
            program.unlink()
            target.unlink()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--skip", type=int, default=0,
                        help="of the first, which were tried before")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", action="append", metavar="FILE[:LINE]")
    options = parser.parse_args()
    possible = list(mutants())
    reasons = read_equivalent()
    stale = set(reasons) - {key(mutant) for mutant in possible}
    for name, before, after in sorted(stale):
        print(f"no longer a mutant: {name}: {before} -> {after}")
    chosen = [mutant for mutant in possible if is_chosen(mutant, options.only)]
    random.Random(options.seed).shuffle(chosen)
    noticed = 0
    equivalent = []
    unnoticed = []
    with tempfile.TemporaryDirectory(prefix="krot-mutants-") as folder, \
            concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        bench = Bench(pathlib.Path(options.build).resolve(),
                      pathlib.Path(folder))
        todo = chosen[options.skip:options.skip + options.count]
        for mutant, result in zip(todo, pool.map(bench.is_noticed, todo,
                                                 range(len(todo)))):
            name, line, text = mutant
            place = f"{name}:{line + 1}: {text.strip()}"
            if result:
                noticed += 1
                if key(mutant) in reasons:
                    print(f"noticed, though listed: {place}", flush=True)
            elif result is not None and key(mutant) in reasons:
                equivalent.append(mutant)
                print(f"equivalent, because {reasons[key(mutant)]}: {place}",
                      flush=True)
            elif result is not None:
                unnoticed.append(mutant)
                print(f"unnoticed: {place}", flush=True)
    print(f"{noticed + len(equivalent) + len(unnoticed)} mutants, of "
          f"{len(possible)} possible changes: {noticed} noticed, "
          f"{len(equivalent)} equivalent, {len(unnoticed)} unnoticed")
    return 1 if unnoticed or stale else 0


if __name__ == "__main__":
    sys.exit(main())
