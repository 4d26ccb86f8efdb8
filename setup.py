"""The ament_python package, and the wheel for those who have only Python.

What package.xml says stands only there. A colcon workspace gets the nodes as executables for `ros2 run`; a
wheel gets `rsea` alone: names such as `driver` belong to nobody's PATH.
"""

import sys
from configparser import ConfigParser
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NODES = (
    "controller", "driver", "excite", "experiment", "health", "identify", "joint", "model", "plant",
    "record", "replay",
)  # fmt: skip
EXTRAS = ConfigParser()
EXTRAS.read("rsea_extras/entry_points.txt", encoding="utf-8")
"""What the extras register; nothing where their folder is missing."""
EXECUTABLES = {node: f"rsea_ros.nodes.{node}" for node in NODES}
if "rsea_ros.nodes" in EXTRAS:
    EXECUTABLES |= EXTRAS["rsea_ros.nodes"]
MANIFEST = ElementTree.parse("package.xml").getroot()
NAME = MANIFEST.findtext("name")
SHARE = Path("share") / NAME
IS_WHEEL = not {"bdist_wheel", "dist_info"}.isdisjoint(sys.argv)


def tree(top: str) -> list[tuple[str, list[str]]]:
    """Return the files under a directory as data files of the package's share."""
    files = sorted(path for path in Path(top).rglob("*") if path.is_file() and path.suffix != ".pyc")
    return [(str(SHARE / path.parent), [str(path)]) for path in files]


def requirements(part: str) -> list[str]:
    """Return what requirements/PART.in asks for."""
    lines = Path("requirements", f"{part}.in").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if not line.startswith("#")]


setup(
    name=NAME,
    version=MANIFEST.findtext("version"),
    description=MANIFEST.findtext("description"),
    maintainer=MANIFEST.findtext("maintainer"),
    maintainer_email=MANIFEST.find("maintainer").get("email"),
    license=MANIFEST.findtext("license"),
    packages=find_packages(include=["rsea_ros*", "rsea_extras*", "msg_adapters*"]),
    python_requires=">=3.10",
    install_requires=requirements("run"),
    extras_require={part: requirements(part) for part in ("can", "fleet", "export")},
    zip_safe=False,
    package_data={
        "": ["py.typed"],
        "rsea_ros.report.page": ["*.css", "*.js", "vendor/*"],
        "rsea_ros.paper": ["*.svg"],
        "rsea_ros.hardware.dynamixel": ["models/*.yaml"],
        "rsea_ros.hardware.mit_can": ["models/*.yaml"],
        "rsea_ros.nodes": ["*.xml"],
        "rsea_extras": ["entry_points.txt"],
        "rsea_extras.watch": ["page/*"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (str(SHARE), ["package.xml"]),
        *([] if IS_WHEEL else [("bin", ["launcher/installed/rsea"])]),
        *tree("config"),
        *tree("launch"),
    ],
    entry_points={
        "console_scripts": [
            "rsea = rsea_ros.cli.main:main",
            *(f"{node} = {module}:main" for node, module in EXECUTABLES.items() if not IS_WHEEL),
        ],
        **{group: [" = ".join(each) for each in EXTRAS[group].items()] for group in EXTRAS.sections()},
    },
)
