"""The installer into COLMAP's sources, on made-up sources with its anchors.

Usage: install_into_colmap_test.py FOLDER_OF_THE_INSTALLER
"""

import contextlib
import io
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PATCHES = pathlib.Path(sys.argv.pop(1))
sys.path.insert(0, str(PATCHES))
import install_into_colmap as installer  # noqa: E402

# Made-up files: @ stands where lines are to go. Beside every anchor stands what
# might be mistaken for it: comments, strings, declarations, other functions.
FILES = {
    "CMakeLists.txt": """# option(LSD_ENABLED stands in this comment.
option(LSD_ENABLED
       "(one" ON)  # Its end.
@
if(GUI)
  option(OTHER "" ON)
endif()
""",
    "cmake/FindDependencies.cmake": """if(A)
  foreach(b IN LISTS c)
  endforeach()
endif()
@
set(CUDA_MIN_VERSION 1)
if(CUDA_ENABLED)
endif()
""",
    "cmake/colmap-config.cmake.in": """set(LSD_ENABLED 1)
@
set(LAST 1)
""",
    "doc/cli.rst": """- ``model``: A model. Its color_extractor.

@
- ``color_extractor``: Colours.
""",
    "src/colmap/estimators/CMakeLists.txt": """set(SOURCES a.h a.cc)
COLMAP_ADD_LIBRARY(
    NAME colmap_estimators
    LIBS "a)" ${SOURCES}
)
@
COLMAP_ADD_TEST(NAME a)
""",
    "src/colmap/estimators/global_positioning.h": """#pragma once
#include "colmap/scene/reconstruction.h"
@
@
#include <string>
namespace colmap {
struct GlobalPositionerOptions;
@
struct GlobalPositionerOptions {
@
  GlobalPositionerOptions() { a = 1; }
  int a;
};
}  // namespace colmap
""",
    "src/colmap/estimators/global_positioning.cc": """
#include "colmap/estimators/cost_functions/motion_averaging.h"
@
namespace colmap {
namespace {
void F() { RunGlobalPositioning(1); }
}  // namespace
bool RunGlobalPositioning(const A& options,
                          B& b) {
@
  return b.Solve();
}
}  // namespace colmap
""",
    "src/colmap/controllers/global_pipeline.cc": """namespace colmap {
void Other() { mapper_options.random_seed = 1; }
void GlobalPipeline::Run() {
  if (a) {
    return;
  }
  mapper_options.random_seed =
      Seed(";");
@
  Solve();
}
}  // namespace colmap
""",
    "src/colmap/controllers/option_manager.cc": """namespace colmap {
void OptionManager::AddOther() {
  AddDefaultOption("GlobalMapper.gp_use_gpu", &a);
}
void OptionManager::AddGlobalMapperOptions() {
  if (added_) { return; }
  // Positioning; the quotes in this comment: "
@
  AddDefaultOption(
      "GlobalMapper.gp_use_gpu", &b);
}
}  // namespace colmap
""",
    "src/colmap/exe/CMakeLists.txt": """if(GUI)
endif()
set_target_properties(colmap_main PROPERTIES A b)
@
""",
    "src/colmap/exe/colmap.cc": """#include "colmap/exe/image.h"
@
#if defined(MVS)
#include "colmap/exe/mvs.h"
#endif
int main(int argc, char** argv) {
  const char c = '{';
#if defined(MVS)
  commands.emplace_back("stereo", &Run);
#endif
@
  commands.emplace_back("mapper", &Run);
  for (;;) {
  }
}
""",
    "src/pycolmap/estimators/bindings.cc": """void BindMotionAveraging(M& m);

@
void BindEstimators(M& m) {
  BindMotionAveraging(m);
@
}
""",
    "src/pycolmap/estimators/motion_averaging.cc": """
void BindGlobalPositioner(M& m) {
@
  auto PyGlobalPositionerOptions = A(m).def("\\"{");
@
  MakeDataclass(PyGlobalPositionerOptions);
}
""",
}
PLACES = installer.read_places(PATCHES / "colmap-4/places.txt")


def without_marks(text):
    return text.replace("\n@\n", "\n").replace("\n@\n", "\n")


def with_our_lines(path):
    """The file as it should become: marks filled in, first place first."""
    added = iter("\n".join(place["lines"]) for place in PLACES[path])
    return "".join(next(added) + "\n" if line == "@\n" else line
                   for line in FILES[path].splitlines(keepends=True))


def everything(folder):
    return {path.relative_to(folder).as_posix(): (path.read_bytes(),
                                                  path.stat().st_mode)
            for path in folder.rglob("*") if path.is_file()}


class ColmapInstaller(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.scratch = pathlib.Path(scratch.name)
        self.colmap = self.scratch / "colmap"
        for path, text in FILES.items():
            self.write(path, without_marks(text))

    def write(self, path, text):
        (self.colmap / path).parent.mkdir(parents=True, exist_ok=True)
        (self.colmap / path).write_bytes(text.encode())

    def run_installer(self, *options):
        """Exit code, and all that was said."""
        said = io.StringIO()
        arguments = sys.argv
        sys.argv = ["install_into_colmap.py", str(self.colmap), *options]
        try:
            with contextlib.redirect_stdout(said), \
                    contextlib.redirect_stderr(said):
                code = installer.main()
        finally:
            sys.argv = arguments
        return code, said.getvalue()

    def require_refused(self, *options, naming):
        before = everything(self.colmap)
        code, said = self.run_installer(*options)
        self.assertEqual(code, 1, said)
        self.assertIn(naming, said)
        self.assertIn("Nothing was changed.", said)
        self.assertEqual(everything(self.colmap), before)

    def test_adds_lines_where_they_belong_and_copies_new_files(self):
        code, said = self.run_installer()
        self.assertEqual(code, 0, said)
        for path in FILES:
            self.assertEqual((self.colmap / path).read_text(),
                             with_our_lines(path), path)
            self.assertIn(path, said)
        new = PATCHES / "colmap-4/new"
        for file in new.rglob("*.*"):
            copied = self.colmap / file.relative_to(new)
            self.assertEqual(copied.read_bytes(), file.read_bytes())

    def test_undo_gives_every_file_back_to_the_byte(self):
        path = "src/colmap/exe/colmap.cc"
        self.write(path, without_marks(FILES[path]).replace("\n", "\r\n"))
        with open(self.colmap / path, "ab") as file:
            file.write(b"// \xff is not UTF-8, and no line ends here")
        os.chmod(self.colmap / path, 0o755)
        before = everything(self.colmap)
        self.assertEqual(self.run_installer()[0], 0)
        installed = (self.colmap / path).read_bytes()
        self.assertEqual(installed.count(b"\n"), installed.count(b"\r\n"))
        self.assertIn(b'"outlier_filter"', installed)
        self.assertEqual((self.colmap / path).stat().st_mode & 0o777, 0o755)
        self.assertEqual(self.run_installer("--undo")[0], 0)
        self.assertEqual(everything(self.colmap), before)

    def test_refuses_where_an_anchor_is_missing(self):
        for path, places in PLACES.items():
            for place in places:
                anchor = place["text"] or place["in"]
                text = without_marks(FILES[path])
                self.write(path, text.replace(anchor, "nothing(").replace(
                    '(\n      "GlobalMapper', '(\n "Nothing'))
                with self.subTest(place=place["name"]):
                    self.require_refused(naming=f"{path}: the place")
                self.write(path, text)

    def test_refuses_where_an_anchor_is_found_twice(self):
        for path in PLACES:
            text = without_marks(FILES[path])
            self.write(path, text + text)
            with self.subTest(path=path):
                self.require_refused(naming="was found 2 times")
            self.write(path, text)

    def test_refuses_a_place_inside_of_another_block(self):
        wrappings = {
            "CMakeLists.txt": ("option(LSD_ENABLED\n", "if(A)\noption(LSD_ENABLED\n"),
            "cmake/FindDependencies.cmake": ("endif()\nset(", "set("),
            "src/colmap/exe/colmap.cc": ("#endif\n  commands", "  commands"),
            "src/colmap/controllers/global_pipeline.cc":
                ("return;\n  }", "return;"),
        }
        for path, (old, new) in wrappings.items():
            text = without_marks(FILES[path])
            self.assertIn(old, text)
            closing = "" if "cmake" in path.lower() else "\n}\n"
            self.write(path, text.replace(old, new) + closing)
            with self.subTest(path=path):
                self.require_refused(naming="was found inside of another block")
            self.write(path, text)

    def test_refuses_a_folder_that_is_not_colmap(self):
        shutil.rmtree(self.colmap / "src")
        self.require_refused(naming="there is no such file")

    def test_refuses_to_overwrite_a_file_of_the_same_name(self):
        self.write("src/colmap/exe/known_rotation.cc", "mine")
        self.require_refused(naming="there is a file where KROT's would go")

    def test_says_that_it_is_installed_already(self):
        self.run_installer()
        before = everything(self.colmap)
        code, said = self.run_installer()
        self.assertEqual(code, 0)
        self.assertIn("already; nothing was done", said)
        self.assertEqual(everything(self.colmap), before)

    def test_refuses_what_it_has_no_record_of(self):
        self.run_installer()
        (self.colmap / installer.RECORD).unlink()
        self.require_refused(naming="lines about KROT already")
        self.require_refused("--undo", naming="was not installed")

    def test_undo_refuses_where_a_file_changed_in_between(self):
        self.run_installer()
        path = "src/colmap/exe/colmap.cc"
        with open(self.colmap / path, "a") as file:
            file.write("// mine\n")
        self.require_refused("--undo", naming=f"{path}: it changed since")
        self.require_refused(naming="run with --undo first")

    def test_undo_finishes_what_was_interrupted(self):
        before = everything(self.colmap)
        self.run_installer()
        self.write("CMakeLists.txt", without_marks(FILES["CMakeLists.txt"]))
        (self.colmap / "src/colmap/exe/known_rotation.h").unlink()
        self.require_refused(naming="in part; run with --undo first")
        self.assertEqual(self.run_installer("--undo")[0], 0)
        self.assertEqual(everything(self.colmap), before)

    def test_a_failure_while_files_are_replaced_leaves_all_as_they_were(self):
        before = everything(self.colmap)
        replace = os.replace
        for fails_at in (0, 1, 5):
            calls = []

            def failing(source, target):
                calls.append(target)
                if len(calls) > fails_at:
                    raise OSError(28, "No space left on device", str(target))
                replace(source, target)

            os.replace = failing
            try:
                self.require_refused(naming="No space left on device")
            finally:
                os.replace = replace
            self.assertEqual(everything(self.colmap), before)

    def test_a_dry_run_changes_nothing(self):
        before = everything(self.colmap)
        code, said = self.run_installer("--dry_run")
        self.assertEqual(code, 0)
        self.assertIn("nothing was changed", said)
        self.assertEqual(everything(self.colmap), before)

    @unittest.skipUnless(shutil.which("git"), "git is not installed")
    def test_git_applies_the_diff_to_the_same_files(self):
        copy = self.scratch / "copy"
        shutil.copytree(self.colmap, copy)
        diff = self.scratch / "krot.diff"
        self.assertEqual(self.run_installer("--diff_path", str(diff))[0], 0)
        subprocess.run(["git", "apply", str(diff)], cwd=copy, check=True,
                       env={**os.environ, "GIT_CEILING_DIRECTORIES":
                            str(self.scratch)})
        (self.colmap / installer.RECORD).unlink()
        self.assertEqual({path: data for path, (data, _)
                          in everything(copy).items()},
                         {path: data for path, (data, _)
                          in everything(self.colmap).items()})

    def test_every_header_of_krot_that_the_patches_include_exists(self):
        sources = PATCHES.parent / "src"
        included = set()
        for path in [*PATCHES.rglob("*.patch"), *PATCHES.rglob("*.cc"),
                     *PATCHES.rglob("*.h")]:
            included.update(re.findall(r'^\+?#include [<"](krot/[^>"]+)',
                                       path.read_text("utf-8"), re.MULTILINE))
        self.assertGreater(len(included), 5)
        self.assertEqual([name for name in sorted(included)
                          if not (sources / name).exists()
                          and name != "krot/version.h"], [])


if __name__ == "__main__":
    unittest.main()
