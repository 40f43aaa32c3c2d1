"""The packages of the wheel: each folder of a room is a sub-package of autophyx_tet."""

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

ROOMS = ("fem", "predictors", "converters", "toolkit", "research")


class WithoutThisFile(build_py):
    """The root is a package, so that this file would count as one of its modules."""

    def find_package_modules(self, package, package_dir):
        """Return (package, module, path) of every module to install."""
        found = super().find_package_modules(package, package_dir)
        return [row for row in found if row[1] != "setup"]


folders = find_packages(include=[pattern for room in ROOMS for pattern in (room, f"{room}.*")])
setup(
    packages=["autophyx_tet", *(f"autophyx_tet.{folder}" for folder in folders)],
    cmdclass={"build_py": WithoutThisFile},
)
