#!/usr/bin/env python3
"""Writes docs/licenses.md: the packages that an executable is linked with, or
is compiled with, and their licence, as Debian's copyright files name them.

Usage: tools/docs/licenses.py KROT > docs/licenses.md   (on Debian)
"""

import pathlib
import re
import subprocess
import sys

HEAD = """# Licences

KROT's own code is under the [BSD 3-Clause licence](../LICENSE), and nothing of others
is in the repository. A binary is linked with these packages of Debian {release}. Named is
the main licence; a package's file under `/usr/share/doc` lists those of its parts. The GPL
of GCC's runtime has an exception for what is linked with it. Debian's Ceres links GPL parts
of SuiteSparse (CHOLMOD's supernodal code): binaries linked with it fall under the GPL.

Made by `tools/docs/licenses.py`.

"""

# Of which headers or static libraries go into the binary.
COMPILED = ("libceres-dev", "libeigen3-dev", "nlohmann-json3-dev")


def output(*words):
    return subprocess.run(words, check=True, capture_output=True,
                          text=True).stdout


def shared_packages(executable):
    packages = set()
    for path in re.findall(r"=> (/\S+)", output("ldd", executable)):
        real = pathlib.Path(path).resolve()
        # Debian lists what was installed below /lib and /usr/lib alike.
        for name in (path, str(real), path.replace("/lib", "/usr/lib", 1),
                     str(real).replace("/usr", "", 1)):
            found = subprocess.run(["dpkg", "-S", name], capture_output=True,
                                   text=True, check=False)
            if found.returncode == 0:
                packages.add(found.stdout.split(":")[0].split(",")[0])
                break
        else:
            print(f"* `{path}`, dynamically: of no package")
    return packages


def licence(package):
    """The main one: that of all files, or of the first."""
    text = pathlib.Path(f"/usr/share/doc/{package}/copyright").read_text(
        errors="replace")
    main = None
    for stanza in re.split(r"\n\s*\n", text):
        name = re.search(r"^License:[ \t]*(\S.*)$", stanza, re.M)
        files = re.search(r"^Files:\s*(.*)$", stanza, re.M)
        if not name or not files:
            continue
        if main is None or files[1].strip() == "*":
            main = name[1].strip()
    if main is None:
        known = re.findall(r"common-licenses/([\w.+-]*\w)", text)
        return ", ".join(sorted(set(known))) or "see its copyright file"
    return main


def main():
    release = re.search(r'VERSION_ID="(\S+)"',
                        pathlib.Path("/etc/os-release").read_text())[1]
    print(HEAD.format(release=release), end="")
    linked = {package: "dynamically" for package in shared_packages(sys.argv[1])}
    linked.update({package: "statically" for package in COMPILED})
    for package, how in sorted(linked.items()):
        print(f"* {package}, {how}: {licence(package)}")


if __name__ == "__main__":
    main()
