"""The file whose noise counts for observer and health node, where it is none."""

from __future__ import annotations

import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._health_inputs import noise_from


@pytest.mark.parametrize(
    ("text", "why"), [(None, "No such file or directory"), ("name: rig\n", "no JSON"), ("[1, 2]", "")]
)
def test_a_file_of_another_kind_is_refused_in_plain_words(tmp_path, text, why):
    """It said `[Errno 2] …` and `Expecting value: line 1 column 1 (char 0)`."""
    file = tmp_path / "file.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(ParameterError) as caught:
        noise_from(load_rig("paper_high_impedance"), str(file))
    said = f": {why}" if why else ""
    assert str(caught.value).startswith(f"parameter identification = {str(file)!r}{said}, expected an ident")
