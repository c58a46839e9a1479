#!/usr/bin/env python3
# Puts KROT's commands into a folder of COLMAP 4's sources: copies the files of
# colmap-4/new and adds the lines of colmap-4/places.txt at the places that it
# names. Every place must be found exactly once, or nothing is changed. --undo
# gives the files back to the byte. Python 3.8 or newer, nothing else.
import argparse
import difflib
import hashlib
import json
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent / "colmap-4"
RECORD = ".krot_installed.json"  # in COLMAP's folder, until it is undone


class Refused(Exception):
    """Sentences for the user; nothing was changed."""


# ---- Where our lines go -----------------------------------------------------

COMMENTS_AND_STRINGS = {
    "c++": r'(?P<comment>//[^\n]*|/\*.*?\*/)|R"(?P<d>[^\s()\\]*)\(.*?\)(?P=d)"'
           r'|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])*\'',
    "cmake": r'(?P<comment>#\[(?P<c>=*)\[.*?\](?P=c)\]|#[^\n]*)'
             r'|\[(?P<d>=*)\[.*?\](?P=d)\]|"(?:\\.|[^"\\])*"',
    "text": r"(?P<comment>(?!))",
}
NAMESPACE = re.compile(r"namespace(\s+[\w:]+)?\s*$")
BLOCKS = {  # what opens and closes, apart from brackets
    "c++": (r"^[ \t]*#[ \t]*if", r"^[ \t]*#[ \t]*endif"),
    "cmake": (r"^[ \t]*(?:if|foreach|while|function|macro)\s*\(",
              r"^[ \t]*end(?:if|foreach|while|function|macro)\s*\("),
    "text": (r"(?!)", r"(?!)"),
}


def blank(match):
    return re.sub(r"[^\n]", " ", match.group())


class Source:
    """A file, beside it the same without comments, and without strings too."""

    def __init__(self, path, text):
        self.path = path
        self.text = text
        suffix = Path(path).suffix
        self.kind = ("c++" if suffix in (".h", ".cc") else
                     "text" if suffix == ".rst" else "cmake")
        token = re.compile(COMMENTS_AND_STRINGS[self.kind], re.DOTALL)
        self.code = token.sub(
            lambda m: blank(m) if m.group("comment") else m.group(), text)
        self.bare = token.sub(blank, text)

    def refuse(self, what, place):
        raise Refused(f"{self.path}: the place '{place}' {what}.")

    def find(self, text, begin, end, place, behind=""):
        """The only match, however its tokens are broken into lines."""
        tokens = re.findall(r'"[^"]*"|\w+|\S', text)
        pattern = "".join(
            re.escape(token) + (
                "" if following is None else
                r"\s+" if token[-1].isalnum() and following[0].isalnum() else
                r"\s*")
            for token, following in zip(tokens, tokens[1:] + [None]))
        if re.match(r"\w", text):
            pattern = r"(?<!\w)" + pattern
        if re.search(r"\w$", text):
            pattern += r"(?!\w)"
        found = list(re.compile(pattern + behind).finditer(
            self.code, begin, end))
        if len(found) != 1:
            self.refuse(f"was found {len(found)} times and is needed once", place)
        return found[0]

    def braces(self, text, place):
        """Begin and end of what is inside the braces of this definition."""
        begin = self.find(text, 0, len(self.text), place, r"[^;{]*\{").end()
        return begin, self.close(begin, place)

    def close(self, begin, place):
        depth = 1
        for position in range(begin, len(self.bare)):
            depth += (self.bare[position] in "({[") - (
                self.bare[position] in ")}]")
            if depth == 0:
                return position
        self.refuse("has a bracket that is not closed", place)

    def statement_end(self, begin, place):
        if self.kind == "text" or self.bare[begin] == "#":
            return self.line_end(begin)
        position = begin
        while position < len(self.bare):
            character = self.bare[position]
            if character in "({[":
                position = self.close(position + 1, place)
                if self.kind == "cmake":
                    return position + 1
            elif character == ";":
                return position + 1
            position += 1
        self.refuse("is a statement that does not end", place)

    def line_end(self, position):
        end = self.text.find("\n", position)
        return len(self.text) if end < 0 else end

    def require_outside(self, begin, position, place):
        """Refuses a place inside of braces, #if or if() that are not meant."""
        part = self.bare[begin:position]
        opened = []
        for found in re.finditer(r"[({\[]|[)}\]]", part):
            if found.group() in "({[":
                opened.append(NAMESPACE.search(
                    part, max(0, found.start() - 99), found.start()) is None)
            elif opened:
                opened.pop()
        opens, closes = (re.findall(pattern, part, re.MULTILINE)
                         for pattern in BLOCKS[self.kind])
        if any(opened) or len(opens) != len(closes):
            self.refuse("was found inside of another block", place)

    def position(self, place):
        """Where lines go: the beginning of a line."""
        name = place["name"]
        begin, end = (self.braces(place["in"], name) if place["in"] else
                      (0, len(self.text)))
        at = where = (begin if place["how"] == "start" else
                      self.find(place["text"], begin, end, name).start())
        self.require_outside(begin, at, name)
        if place["how"] == "before":
            where = self.text.rfind("\n", 0, at) + 1
            if self.bare[where:at].strip():
                self.refuse("does not begin a line", name)
            return where
        if place["how"] == "after":
            where = self.statement_end(at, name)
        line_end = self.line_end(where)  # "after" and "start"
        if self.code[where:line_end].strip() or line_end == len(self.text):
            self.refuse("does not end a line", name)
        return line_end + 1


def read_places(path):
    """{file: [place]}, each with how, text, in, name and lines."""
    files, places, inside = {}, None, ""
    for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
        if line.startswith("|"):
            places[-1]["lines"].append(line[2:])
            continue
        if not line.strip() or line.startswith("#"):
            continue
        word, _, rest = line.partition(" ")
        if word == "file":
            places = files.setdefault(rest, [])
        elif word == "in":
            inside = rest
        elif word in ("after", "before", "start"):
            name = line + (f" in {inside}" if inside else "")
            places.append({"how": word, "text": rest, "in": inside,
                           "name": name.rstrip("("), "lines": []})
            inside = ""
        else:
            raise ValueError(f"{path}:{number}: not understood: {line}")
    return files


# ---- What becomes of the files ----------------------------------------------


def digest(data):
    return None if data is None else hashlib.sha256(data).hexdigest()


def read(path):
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None


def with_lines(path, data, places):
    """The file with our lines, and what was added where: (offset, length)."""
    source = Source(path, data.decode("utf-8", "surrogateescape"))
    line_break = "\r\n" if "\r\n" in source.text else "\n"
    added = sorted(((source.position(place), number) for number, place
                    in enumerate(places)))
    result, ranges, last = b"", [], 0
    for position, number in added:
        lines = "".join(line + line_break for line in places[number]["lines"])
        result += source.text[last:position].encode("utf-8", "surrogateescape")
        ranges.append((len(result), len(lines.encode())))
        result += lines.encode()
        last = position
    result += source.text[last:].encode("utf-8", "surrogateescape")
    return result, ranges


def plan(colmap):
    """[(path, before, after, ranges)]; before is None for a new file."""
    places = read_places(HERE / "places.txt")
    missing = [path for path in places if read(colmap / path) is None]
    if missing:
        raise Refused(
            f"{colmap / missing[0]}: there is no such file (of {len(places)} "
            f"files of COLMAP 4 that KROT adds to, {len(missing)} are missing); "
            "give the folder of COLMAP 4's sources, where README.md is.")
    changes, reasons = [], []
    for path, wanted in places.items():
        before = read(colmap / path)
        if b"KROT" in before:
            reasons.append(f"{path}: it has lines about KROT already, which "
                           "this installer did not add.")
            continue
        try:
            changes.append((path, before, *with_lines(path, before, wanted)))
        except Refused as refused:
            reasons.append(str(refused))
    new = HERE / "new"
    for file in sorted(new.rglob("*.*")):
        path = file.relative_to(new).as_posix()
        if read(colmap / path) is not None:
            reasons.append(f"{path}: there is a file where KROT's would go.")
        changes.append((path, None, file.read_bytes(), []))
    if reasons:
        raise Refused("\n".join(reasons) + "\nUse the unchanged sources of a "
                      "release of COLMAP 4, or add the lines of "
                      f"{HERE / 'places.txt'} by hand.")
    return changes


def write_all(colmap, files):
    """Replaces all files {path: bytes or None: none} in this order, or none.

    If this process is killed in between, the record tells --undo what to do.
    """
    before = {path: read(colmap / path) for path in files}
    temporary, done = {}, []
    try:
        for path, data in files.items():
            if data is None:
                continue
            target = colmap / path
            target.parent.mkdir(parents=True, exist_ok=True)
            handle, temporary[path] = tempfile.mkstemp(dir=target.parent)
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            if before[path] is None:
                os.chmod(temporary[path], 0o644)
            else:
                shutil.copymode(target, temporary[path])
        for path, data in files.items():
            done.append(path)
            if data is None:
                (colmap / path).unlink()
            else:
                os.replace(temporary[path], colmap / path)
                del temporary[path]
    except BaseException as error:
        for path in done:
            if before[path] is not None:
                (colmap / path).write_bytes(before[path])
            elif (colmap / path).exists():
                (colmap / path).unlink()
        for name in temporary.values():
            os.unlink(name)
        if isinstance(error, OSError):
            raise Refused(f"{error.filename}: {error.strerror}.")
        raise


def read_record(colmap):
    data = read(colmap / RECORD)
    if data is None:
        return None
    try:
        return json.loads(data)
    except ValueError:
        raise Refused(f"{RECORD}: it is not what this installer wrote; take "
                      "COLMAP's sources again.")


def state(colmap, path, entry):
    now = digest(read(colmap / path))
    return ("installed" if now == entry["after"] else
            "original" if now == entry["before"] else "changed")


# ---- The commands -----------------------------------------------------------


def diff(changes):
    """As git writes it, with context."""
    text = ""
    for path, before, after, _ in changes:
        text += f"diff --git a/{path} b/{path}\n"
        if before is None:
            text += "new file mode 100644\n"
        lines = [(data or b"").decode("utf-8", "surrogateescape")
                 .splitlines(keepends=True) for data in (before, after)]
        for line in difflib.unified_diff(
                *lines, "/dev/null" if before is None else f"a/{path}",
                f"b/{path}"):
            text += line if line.endswith("\n") else (
                line + "\n\\ No newline at end of file\n")
    return text.encode("utf-8", "surrogateescape")


def install(colmap, dry_run, diff_path):
    record = read_record(colmap)
    if record is not None:
        states = {state(colmap, path, entry) for path, entry in record.items()}
        if states == {"installed"}:
            print(f"KROT is installed in {colmap} already; nothing was done.")
            return
        raise Refused(f"{RECORD}: files changed since KROT was installed, or it "
                      "was installed in part; run with --undo first.")
    changes = plan(colmap)
    width = max(len(path) for path, *_ in changes)
    for path, before, after, ranges in changes:
        count = sum(after[at:at + length].count(b"\n") for at, length in ranges)
        what = (f"new, {after.count(bytes([10]))} lines" if before is None else
                f"{count} lines at {len(ranges)} "
                f"place{'s' if len(ranges) > 1 else ''}")
        print(f"{path:{width}}  {what}")
    if diff_path:
        diff_path.write_bytes(diff(changes))
        print(f"The diff is in {diff_path}.")
    if dry_run:
        print("All places were found; nothing was changed (--dry_run).")
        return
    record = {path: {"before": digest(before), "after": digest(after),
                     "added": ranges}
              for path, before, after, ranges in changes}
    write_all(colmap, {RECORD: json.dumps(record, indent=1).encode(),
                       **{path: after for path, _, after, _ in changes}})
    print("Installed. Configure COLMAP with -DKROT_ENABLED=ON; --undo gives the "
          "files back.")


def undo(colmap, dry_run):
    record = read_record(colmap)
    if record is None:
        raise Refused(f"{colmap}: KROT was not installed by this installer "
                      f"({RECORD} is missing).")
    files, reasons = {}, []
    for path, entry in record.items():
        status = state(colmap, path, entry)
        if status == "changed":
            reasons.append(f"{path}: it changed since KROT was installed; undo "
                           "your change, or take the file from COLMAP again.")
        if status != "installed":
            continue
        data = read(colmap / path)
        for at, length in reversed(entry["added"]):
            data = data[:at] + data[at + length:]
        files[path] = None if entry["before"] is None else data
    if reasons:
        raise Refused("\n".join(reasons))
    if not dry_run:
        write_all(colmap, {**files, RECORD: None})
    print(f"{len(files)} files {'would be' if dry_run else 'are'} as they were "
          "before KROT was installed.")


def main():
    parser = argparse.ArgumentParser(
        description="Puts KROT's commands into COLMAP 4's sources.")
    parser.add_argument("colmap", type=Path, help="the folder of its sources")
    parser.add_argument("--undo", action="store_true",
                        help="give the files back as they were")
    parser.add_argument("--dry_run", action="store_true",
                        help="look for all places and change nothing")
    parser.add_argument("--diff_path", type=Path,
                        help="also write what is added as a diff with context, "
                        "to send it or for git apply")
    arguments = parser.parse_args()
    if arguments.undo and arguments.diff_path:
        parser.error("--diff_path has no effect with --undo")
    try:
        if arguments.undo:
            undo(arguments.colmap, arguments.dry_run)
        else:
            install(arguments.colmap, arguments.dry_run, arguments.diff_path)
    except (Refused, OSError) as error:
        print(f"{error}\nNothing was changed.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
