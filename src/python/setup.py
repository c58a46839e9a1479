"""pip install . --no-build-isolation: builds pykrot by CMake, with the options in
CMAKE_ARGS. Needs what KROT needs, pybind11 and numpy."""

import os
import pathlib
import re
import shlex
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def version():
    text = (ROOT / "CMakeLists.txt").read_text()
    return re.search(r"project\(krot VERSION ([0-9.]+)", text).group(1)


class CMakeBuild(build_ext):

    def build_extension(self, extension):
        build = pathlib.Path(self.build_temp).resolve()
        target = pathlib.Path(self.get_ext_fullpath(extension.name)).resolve()
        subprocess.run(
            ["cmake", "-S", ROOT, "-B", build, "-DCMAKE_BUILD_TYPE=Release",
             "-DKROT_BUILD_TESTS=OFF", "-DKROT_BUILD_PYTHON=ON",
             f"-DPYTHON_EXECUTABLE={sys.executable}",
             *shlex.split(os.environ.get("CMAKE_ARGS", ""))], check=True)
        subprocess.run(["cmake", "--build", build, "--target", "pykrot_core",
                        "--parallel"], check=True)
        built = next((build / "python" / "pykrot").glob("_core*.so"))
        target.parent.mkdir(parents=True, exist_ok=True)
        self.copy_file(built, target)


setup(
    name="pykrot",
    version=version(),
    description="The known rotation problem for COLMAP models",
    license="BSD-3-Clause",
    packages=["pykrot"],
    package_data={"pykrot": ["py.typed", "__init__.pyi"]},
    install_requires=["numpy"],
    ext_modules=[Extension("pykrot._core", sources=[])],
    cmdclass={"build_ext": CMakeBuild},
    python_requires=">=3.9",
)
