"""Rigs in YAML files: found by name, loaded with every error naming the file, saved complete or not at all.

`model.yaml`, written by identification and diagnosis, is a rig file with an `effects` list.
"""

from __future__ import annotations

import os
import sysconfig
from collections.abc import Mapping
from pathlib import Path

from rsea_ros.documents import strict_yaml
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.errors import FieldError, OutputError, RigError
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_document import rig_from_document
from rsea_ros.model.rig_to_document import rig_to_document
from rsea_ros.outputs.new_files import write_text


def rig_path(name_or_path: str | Path) -> Path:
    """Return the file of a rig given by path or by the bare name of a file in config/rigs.

    Raises RigError for a name that no rig has, and for text that cannot be a file name.
    """
    if not isinstance(name_or_path, (str, os.PathLike)) or "\0" in str(name_or_path):
        raise RigError(f"rig {quote(name_or_path)}: expected the name of a rig, or of a YAML file")
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml") or path.is_file():
        return path
    for folder in rig_folders():
        if (folder / f"{name_or_path}.yaml").exists():
            return folder / f"{name_or_path}.yaml"
    known = rig_names()
    near = did_you_mean(str(name_or_path), known)
    raise RigError(
        f"rig {str(name_or_path)!r} not found, expected a YAML file or one of {', '.join(known)}{near}"
    )


def rig_names() -> list[str]:
    """Return the names of the rigs that come with the package."""
    return sorted({p.stem for folder in rig_folders() for p in folder.glob("*.yaml")})


def rig_folders() -> list[Path]:
    """Return where rigs lie: beside the source, or in the share of the installed package."""
    source = Path(__file__).resolve()
    candidates = [
        source.parents[2] / "config" / "rigs",
        Path(sysconfig.get_path("data")) / "share/rsea_ros/config/rigs",
    ]
    candidates += [parent / "share/rsea_ros/config/rigs" for parent in source.parents[3:7]]
    return [folder for folder in candidates if folder.is_dir()]


def load_rig(name_or_path: str | Path | Rig) -> Rig:
    """Return the rig of a YAML file, or of a name in config/rigs; a Rig is returned unchanged.

    Raises RigError with file, field, value and expected value. Format: docs/rig.md.
    """
    if isinstance(name_or_path, Rig):
        return name_or_path
    path = rig_path(name_or_path)
    try:
        document = strict_yaml.read(path)
    except FileNotFoundError:
        raise RigError(f"{path}: no such file, expected a rig in YAML") from None
    except OSError as error:
        raise RigError(f"{path}: {error.strerror}, expected a rig in YAML that can be read") from None
    except FieldError as error:
        raise RigError(f"{path}: {error}") from None
    if not isinstance(document.content, Mapping):
        held = "nothing" if document.content is None else type(document.content).__name__
        raise RigError(f"{path}: holds {held}, expected a mapping with the keys of a rig")
    try:
        return rig_from_document(document.content, default_name=path.stem)
    except RigError as error:
        raise RigError(f"{path}: {document.where(error.field)}{error}", error.field) from None


def save_rig(rig: Rig, path: str | Path, *, force: bool = False) -> None:
    """Write a rig as YAML that `load_rig` reads back to the same rig; `force`: over a file that has the name.

    Raises RigError, and leaves nothing behind, when it cannot be written.
    """
    try:
        write_text(path, rig_text(rig), force=force)
    except OutputError as error:
        raise RigError(str(error)) from None
    except OSError as error:
        raise RigError(f"{path}: {error.strerror}, expected a place that can be written") from None


def rig_text(rig: Rig) -> str:
    """Return the YAML of a rig."""
    return strict_yaml.dump(rig_to_document(rig))
