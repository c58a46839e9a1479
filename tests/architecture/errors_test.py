"""Every sentence with which KROT refuses something stands in docs/errors.md.

Usage: errors_test.py ROOT
The sentences are gathered from the sources: string literals among the arguments
of whatever throws or refuses, and what the certificate checkers return. What a
run fills in is … in the document, whose rows must all stem from the sources.
"""

import pathlib
import re
import sys

# What takes a sentence, or the parts of one. A caller's mistake
# (std::invalid_argument, CheckArgument) has one form for all.
SPEAKER = re.compile(
    r"\b(?:ModelError|WriteError|OptionError|CommandError|Error|Fail\w*|fail|"
    r"Refuse|refused)(?:\s+\w+)?\(|\brefusal\s*=")
RETURNED = re.compile(r"\breturn\b")
# Whose functions return why they refuse.
RETURNING = re.compile(r"verify/certificate_(check|input)\.cc$|verdict\.cc$")
# CheckExtent's: no command prints why a proof of lengths was refused.
UNSAID = {"nothing fixed holds it", "balance takes y to",
          "times the length of lambda"}
LITERAL = re.compile(r'"((?:[^"\\\n]|\\.)*)"')
TOKEN = re.compile(r"//[^\n]*|'(?:[^'\\\n]|\\.)'|" + LITERAL.pattern)
EDGES = " ,;:.'\"()[]=-\n"


def without_comments(source):
    """With neither comments nor characters, whose quotes would mislead."""
    return TOKEN.sub(
        lambda token: token[0] if token[0].startswith('"') else " ", source)


def expression(source, start):
    """From `start` to the bracket or the semicolon that ends it."""
    depth = 0
    i = start
    while i < len(source):
        if source[i] == '"':
            literal = LITERAL.match(source, i)
            i = literal.end() if literal else i + 1
            continue
        if source[i] in "([{":
            depth += 1
        elif source[i] in ")]}":
            depth -= 1
            if depth <= 0:
                return source[start:i]
        elif source[i] == ";" and depth <= 0:
            return source[start:i]
        i += 1
    return source[start:]


def parts_of(text):
    """The words of a sentence between what is filled in; a single word is
    none: it may be the name of an option, or fill in a gap itself."""
    joined = []
    end = None
    for literal in LITERAL.finditer(text):
        # Adjacent literals are one.
        if end is not None and not text[end:literal.start()].strip():
            joined[-1] += literal[1]
        else:
            joined.append(literal[1])
        end = literal.end()
    parts = [re.sub(r"\\(.)", r"\1", part.replace(r"\n", " "))
             .replace("`", "").strip(EDGES) for part in joined]
    return [part for part in parts if " " in part and part not in UNSAID]


def sentences(root):
    """Where each sentence of the sources stands, by its parts."""
    found = {}
    for path in sorted([*(root / "src" / "krot").rglob("*"),
                        *(root / "tools" / "krot").rglob("*")]):
        if path.suffix not in (".cc", ".h"):
            continue
        source = without_comments(path.read_text())
        starts = [match.end() - match[0].endswith("(")
                  for match in SPEAKER.finditer(source)]
        if RETURNING.search(path.as_posix()):
            starts += [match.end() for match in RETURNED.finditer(source)]
        for start in starts:
            parts = parts_of(expression(source, start))
            if parts:
                found[tuple(parts)] = path.relative_to(root).as_posix()
    return found


def all_parts(root):
    """Of whatever the sources say, for sentences that are put together."""
    return {part for folder in ("src", "tools")
            for path in (root / folder / "krot").rglob("*")
            if path.suffix in (".cc", ".h")
            for part in parts_of(without_comments(path.read_text()))}


def main():
    root = pathlib.Path(sys.argv[1])
    document = (root / "docs" / "errors.md").read_text().replace("`", "")
    rows = [line for line in document.splitlines() if line.startswith("|")]
    wrong = [f"{path}: '{part}' is not in docs/errors.md"
             for parts, path in sentences(root).items() for part in parts
             if not any(part in row for row in rows)]
    said = all_parts(root)
    for row in rows:
        # A row holds several sentences where one explanation serves them all.
        for sentence in row.split(" | ")[0].lstrip("| ").split("<br>"):
            # A form of many, or a table's head.
            if not sentence or sentence[0] == "-" or (
                    "…" not in sentence and " " not in sentence):
                continue
            if "the form of all" not in row and not any(
                    part in sentence for part in said):
                wrong.append(
                    f"docs/errors.md: the sources do not say '{sentence}'")
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
