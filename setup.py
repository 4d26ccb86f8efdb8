"""The ament_python package; what package.xml says stands only there."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NODES = ("controller", "driver", "excite", "identify", "model", "plant", "record", "replay")
MANIFEST = ElementTree.parse("package.xml").getroot()
NAME = MANIFEST.findtext("name")
SHARE = Path("share") / NAME


def tree(top: str) -> list[tuple[str, list[str]]]:
    """Return the files under a directory as data files of the package's share."""
    files = sorted(path for path in Path(top).rglob("*") if path.is_file() and path.suffix != ".pyc")
    return [(str(SHARE / path.parent), [str(path)]) for path in files]


setup(
    name=NAME,
    version=MANIFEST.findtext("version"),
    description=MANIFEST.findtext("description"),
    maintainer=MANIFEST.findtext("maintainer"),
    maintainer_email=MANIFEST.find("maintainer").get("email"),
    license=MANIFEST.findtext("license"),
    packages=find_packages(include=["rsea_ros*", "msg_adapters*"]),
    python_requires=">=3.10",
    install_requires=["setuptools"],
    zip_safe=False,
    package_data={"rsea_ros.report": ["*.css", "*.js"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (str(SHARE), ["package.xml"]),
        ("bin", ["launcher/installed/rsea"]),
        *tree("config"),
        *tree("launch"),
    ],
    entry_points={
        "console_scripts": [
            "rsea = rsea_ros.cli.main:main",
            *(f"{node} = rsea_ros.nodes.{node}:main" for node in NODES),
        ]
    },
)
