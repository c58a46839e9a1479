"""What the tests of faults share: commands, what they must leave, a judge.

A command is run in a folder that holds its input and, where it writes, an
older output. Afterwards that output must be the old one or the new one, to the
byte, and nothing else may have changed.
"""

import dataclasses
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess

TIMEOUT = 60  # seconds: a run that takes longer hangs
# What only a SIGKILL may leave behind, as docs/reliability.md says.
LEFTOVER = re.compile(r"^(\..+\.krot-\d+-\d+(-old)?|.+\.new-\d+)$")


@dataclasses.dataclass
class Command:
    """One run of krot; words that begin with @ are names in its folder."""

    name: str
    words: list
    folders: tuple = ()  # that it replaces
    files: tuple = ()  # that it writes beside them
    format: str = "BIN"
    checkpoint: str = ""  # a file that lasts until the output is written

    @property
    def title(self):
        return (self.name + (", text" if self.format == "TXT" else "") +
                (", checkpoint" if self.checkpoint else "") +
                (", database" if "@database.db" in self.words else ""))


SOLVED = ["--input_path", "@input", "--output_path", "@out", "--overwrite", "1"]
COMMANDS = [
    Command("solver",
            SOLVED + ["--report_path", "@report.json", "--html_path",
                      "@page.html", "--certificate_path", "@proof.json"],
            ("out",), ("report.json", "page.html", "proof.json")),
    Command("solver", SOLVED + ["--report_path", "@report.json"],
            ("out",), ("report.json",), "TXT"),
    Command("solver", SOLVED + ["--checkpoint_path", "@steps"],
            ("out",), checkpoint="steps"),
    Command("point_triangulator", SOLVED + ["--report_path", "@report.json"],
            ("out",), ("report.json",)),
    Command("model_checker",
            SOLVED + ["--database_path", "@database.db", "--report_path",
                      "@report.json", "--certificate_path", "@proof.json"],
            ("out",), ("report.json", "proof.json")),
    Command("point_triangulator",
            SOLVED + ["--database_path", "@database.db"], ("out",)),
    Command("solver",
            SOLVED + ["--database_path", "@database.db", "--Solver.init",
                      "feasible"], ("out",)),
    Command("bundle_adjuster", SOLVED + ["--report_path", "@report.json"],
            ("out",), ("report.json",)),
    Command("bundle_adjuster", SOLVED, ("out",), (), "TXT"),
    Command("outlier_filter",
            SOLVED + ["--OutlierFilter.max_error", "1", "--suspects_path",
                      "@suspects", "--conflicts_path", "@conflicts.json",
                      "--outliers_path", "@outliers.csv"],
            ("out", "suspects"), ("conflicts.json", "outliers.csv")),
    Command("outlier_filter", SOLVED + ["--OutlierFilter.max_error", "1"],
            ("out",), (), "TXT"),
    Command("model_analyzer",
            ["--path", "@input", "--error_colors_path", "@out", "--overwrite",
             "1", "--report_path", "@report.json"],
            ("out",), ("report.json",)),
    Command("model_comparer",
            ["--input_path1", "@input", "--input_path2", "@old",
             "--overlay_path", "@out", "--overwrite", "1", "--report_path",
             "@report.json"],
            ("out",), ("report.json",)),
    Command("model_synthesizer",
            ["--output_path", "@out", "--overwrite", "1", "--Scene.num_frames",
             "4", "--Scene.num_points", "30", "--Scene.track_length", "3"],
            ("out",)),
    Command("tolerance_analyzer",
            ["--input_path", "@input", "--ToleranceAnalyzer.max_error", "4",
             "--ToleranceAnalyzer.points", "1", "--report_path",
             "@report.json", "--csv_path", "@boxes.csv"],
            (), ("report.json", "boxes.csv")),
    Command("certificate_checker",
            ["--input_path", "@input", "--certificate_path", "@valid.json"]),
]


def state(folder, names=None):
    """Of each file below the folder its bytes, of each folder None."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if names is None or name.split("/")[0] in names:
            found[name] = path.read_bytes() if path.is_file() else None
    return found


def is_complete(name, data):
    if name.endswith(".json"):
        try:
            json.loads(data)
        except ValueError:
            return False
        return True
    return data.endswith(b"</html>\n" if name.endswith(".html") else b"\n")


class Place:
    """A folder with the input of a command and an older output."""

    def __init__(self, krot, command, folder):
        self.krot = krot
        self.command = command
        # Ceres' results depend on their number.
        self.threads = 1 if command.name == "bundle_adjuster" else 2
        self.pristine = folder / "pristine"
        self.folder = folder / "run"
        self.pristine.mkdir(parents=True)
        self._make_models()
        for file in command.files:
            old = {"json": "{}\n", "html": "</html>\n"}
            suffix = file.rsplit(".", 1)[1]
            (self.pristine / file).write_text(old.get(suffix, "old\n"))
        self.reset()
        self.old = state(self.folder)
        result = self.run()
        if result.returncode != 0:
            raise RuntimeError(result.stderr)
        self.new = state(self.folder, command.folders)

    def _krot(self, *words):
        subprocess.run([self.krot, *words, "--log_level", "0"], check=True,
                       stdout=subprocess.DEVNULL)

    def _make_models(self):
        database = ["--database_path", self.pristine / "database.db"]
        if "@database.db" not in self.command.words:
            database = []
        for name, seed, more in ("input", 3, database), ("old", 4, []):
            self._krot("model_synthesizer", "--output_path",
                       self.pristine / name, "--output_type",
                       self.command.format, "--Scene.num_frames", "6",
                       "--Scene.num_points", "60", "--Scene.track_length", "4",
                       "--Scene.pixel_noise", "0.5",
                       "--Scene.start_translation_noise", "0.003",
                       "--Scene.start_point_noise", "0.003", "--random_seed",
                       str(seed), *more)
        for name in self.command.folders:
            out = self.pristine / name
            shutil.copytree(self.pristine / "old", out)
            (out / "more").mkdir()
            (out / "more" / "notes.md").write_text("mine\n")
        if "@valid.json" in self.command.words:
            self._krot("solver", "--input_path", self.pristine / "input",
                       "--output_path", self.pristine / "solved",
                       "--certificate_path", self.pristine / "valid.json")

    def reset(self):
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.copytree(self.pristine, self.folder)

    def start(self, threads=1, environment=None):
        """A process; one thread, so that the n-th call is always the same."""
        words = [str(self.folder / word[1:]) if word.startswith("@") else word
                 for word in self.command.words]
        group = {"solver": "Solver", "point_triangulator": "Solver",
                 "outlier_filter": "Solver", "tolerance_analyzer": "Solver",
                 "bundle_adjuster": "BundleAdjustmentCeres"}
        if self.command.name in group:
            words += [f"--{group[self.command.name]}.num_threads",
                      str(threads)]
        if self.command.name == "model_checker":
            words += ["--num_threads", str(threads)]
        return subprocess.Popen(
            [self.krot, self.command.name, *words],
            env={**os.environ, **(environment or {})}, text=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

    def run(self, threads=1, environment=None):
        with self.start(threads, environment) as process:
            try:
                _, err = process.communicate(timeout=TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                _, err = process.communicate()
                err += "it hangs"
        return subprocess.CompletedProcess([], process.returncode, "", err)

    def judge(self, result, exit_codes):
        """What is wrong with what a run has left; empty: nothing."""
        wrong = []
        command = self.command
        found = state(self.folder)
        is_killed = result.returncode == -signal.SIGKILL
        if result.returncode not in exit_codes:
            wrong.append(f"exit code {result.returncode}")
        if result.returncode > 0:
            last = result.stderr.splitlines()[-1:] or [""]
            speakers = (f"krot {command.name}: ", "krot: ")
            if not last[0].startswith(speakers):
                wrong.append("no sentence")
            if "internal error" in last[0]:
                wrong.append("internal error")

        for name in command.folders:
            part = {key: value for key, value in found.items()
                    if key.split("/")[0] == name}
            old, new = ({key: value for key, value in whole.items()
                         if key.split("/")[0] == name}
                        for whole in (self.old, self.new))
            if not part and is_killed and self._is_set_aside(name, old):
                continue
            if part != new and (part != old or result.returncode == 0):
                wrong.append(f"{name} is a mix")
        for name in command.files:
            if not is_complete(name, found.get(name, b"")):
                wrong.append(f"{name} is a piece")
        changed = {name.split("/")[0] for name in {**found, **self.old}
                   if name not in found or name not in self.old or
                   found[name] != self.old[name]}
        if result.returncode != 0:
            changed.discard(command.checkpoint)  # the next run goes on with it
        for name in sorted(changed.difference(command.folders, command.files)):
            may_be_left = LEFTOVER.match(name) or name == command.checkpoint
            if not (may_be_left and (is_killed or name in result.stderr)):
                wrong.append(f"{name} is left or changed")
        return wrong

    def judge_again(self):
        """What is wrong with what another run makes of what one has left."""
        # An old folder that was set aside keeps what is not of the model.
        expected = {key: value for key, value in self.new.items()
                    if (self.folder / key.split("/")[0]).exists() or
                    not self._is_of_the_user(key)}
        result = self.run()
        if result.returncode != 0:
            return [f"the run after it: {result.stderr}"]
        found = state(self.folder, self.command.folders)
        wrong = [] if found == expected else ["the run after it ends otherwise"]
        if self.command.checkpoint in state(self.folder):
            wrong.append("the run after it leaves its checkpoint")
        return wrong

    def _is_of_the_user(self, key):
        """Whether it is in the old folder, but no part of its model."""
        folder, _, name = key.partition("/")
        return bool(name) and not (self.pristine / "old" / name).exists()

    def _is_set_aside(self, name, old):
        """Whether the old folder bears the name of its own that it has between
        two renames, where folders cannot be exchanged."""
        for aside in self.folder.glob(f".{name}.krot-*-old"):
            content = {f"{name}/{key}": value
                       for key, value in state(aside).items()}
            if {**content, name: None} == old:
                return True
        return False
