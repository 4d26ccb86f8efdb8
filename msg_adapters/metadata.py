"""metadata.yaml, which rosbag2 puts beside the storage files of a bag."""

from __future__ import annotations

from pathlib import Path, PurePath

import yaml

from msg_adapters.contents import Contents
from rsea_ros.errors import BagError

NAME = "metadata.yaml"
ROOT = "rosbag2_bagfile_information"
NOTES = "rsea_notes"


def files_of(bag: Path, contents: Contents) -> list[Path]:
    """Return the files that the metadata of a bag name; empty where there are none (recorder killed).

    Topics and types are taken from the files themselves; the metadata add only the order and the notes.
    Raises BagError for metadata that name a file that is not there.
    """
    try:
        known = yaml.safe_load((bag / NAME).read_text())[ROOT]
        files = [bag / PurePath(name).name for name in known["relative_file_paths"]]
        notes = str((known.get("custom_data") or {}).get(NOTES, ""))
    except FileNotFoundError:
        contents.notes.append(f"{bag}: without {NAME} (recorder killed?), read from its files")
        return []
    except (yaml.YAMLError, KeyError, TypeError, AttributeError, UnicodeDecodeError):
        contents.notes.append(f"{bag / NAME}: not understood, read from the files beside it")
        return []
    for file in files:
        if not file.exists():
            raise BagError(f"{bag / NAME}: names {file.name}, which is not there")
    contents.notes.extend(notes.splitlines())
    return files
