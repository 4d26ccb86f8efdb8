"""package.xml: what a build farm and its linters ask of it, and the maintainer of a release."""

import importlib.util
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
_SPEC = importlib.util.spec_from_file_location("release", ROOT / "launcher" / "release.py")
release = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(release)
TEXT = (ROOT / "package.xml").read_text()
WHO = "A. & B. Name", "a.name@lab.org", "https://lab.org/rsea_ros"


def test_the_manifest_has_its_elements_in_the_order_of_its_schema():
    """catkin_pkg and ament_xmllint refuse others (REP 149)."""
    manifest = ElementTree.fromstring(TEXT)
    order = ["name", "version", "description", "maintainer", "license"]
    assert [each.tag for each in manifest][:5] == order
    assert manifest.get("format") == "3" and manifest.find("license").get("file") == "LICENSE"
    keys = [each.text for each in manifest if each.tag.endswith("depend")]
    assert len(keys) == len(set(keys)) and {"ament_lint", "python3-pytest"} <= set(keys)


def test_the_licence_is_the_text_that_ament_copyright_knows():
    """Of BSD-3-Clause: a copyright line, and three conditions."""
    licence = (ROOT / "LICENSE").read_text()
    assert licence.splitlines()[2].startswith("Copyright (c) 2026, ")
    for condition in ("Redistributions of source code", "Redistributions in binary form", "Neither the name"):
        assert condition in licence
    contributing = " ".join((ROOT / "CONTRIBUTING.md").read_text().split())
    assert "will be under the 3-Clause BSD License, as dictated by that [license]" in contributing


def test_a_release_names_its_maintainer_and_place_once_however_often_it_is_made():
    text = release.released(release.released(TEXT, *WHO), *WHO, "0.2.0")
    manifest = ElementTree.fromstring(text)
    assert manifest.findtext("maintainer") == "A. & B. Name"
    assert manifest.find("maintainer").get("email") == "a.name@lab.org"
    assert [(url.get("type"), url.text) for url in manifest.iter("url")] == [
        ("website", WHO[2]), ("repository", WHO[2]),
    ]  # fmt: skip
    assert manifest.findtext("version") == "0.2.0"
    assert release.released(TEXT, *WHO).replace(WHO[1], "") != TEXT


@pytest.mark.parametrize(
    "words", [(), WHO[:2], (WHO[0], "me@example.com", WHO[2]), (*WHO, "1.0"), (WHO[0], WHO[1], "lab.org")]
)
def test_a_release_without_a_real_maintainer_is_refused_and_nothing_is_written(words, tmp_path, capsys):
    manifest = tmp_path / "package.xml"
    manifest.write_text(TEXT)
    assert release.main(words, manifest) == 2
    assert "expected NAME EMAIL URL [VERSION]" in capsys.readouterr().err
    assert manifest.read_text() == TEXT
