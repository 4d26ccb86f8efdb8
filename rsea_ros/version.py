"""The version of this software."""

from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

_MANIFEST = Path(__file__).resolve().parents[1] / "package.xml"


def version() -> str:
    """Return the version: of the clone's package.xml, else of the installed package."""
    if _MANIFEST.is_file():
        return ElementTree.parse(_MANIFEST).findtext("version") or "unknown"
    return metadata.version("rsea_ros")
