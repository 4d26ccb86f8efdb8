"""The question whether the rig is right, as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from rsea_ros.identification.result import Remark
from rsea_ros.report.file_names import MODEL
from rsea_ros.report.page.html import bullets, code, section
from rsea_ros.report.remark_words import remark_sentences
from rsea_ros.report.rig.words import right_rig, split_off_rig


def right_rig_block(remarks: Sequence[Remark], command: str = "") -> str:
    """Return the values that differ from the rig and what to do about it; empty for none.

    command: makes a rig of the fitted values; without one, model.yaml beside the page is that rig.
    """
    off, _ = split_off_rig(remarks)
    if not off:
        return ""
    remedy = f"<p>{escape(right_rig('' if command else MODEL))} {code(command) if command else ''}</p>"
    return section("Values that differ from the rig", bullets(remark_sentences(off)), remedy)
