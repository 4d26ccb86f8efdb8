"""Recordings are found in folders, patterns, lists and object stores, each once."""

from __future__ import annotations

import os
from dataclasses import replace

import fsspec
import pytest
from fleet_stubs import HIP, KNEE

from rsea_extras.fleet import FleetError
from rsea_extras.fleet.sources import bags_of, fingerprint, local_copy, relist


def urls(sources, joints=(KNEE,)):
    return [bag.url for bag, held in bags_of(map(str, sources), joints) if held]


@pytest.fixture
def remote():
    files = fsspec.filesystem("memory")
    files.pipe("/lab/monday/metadata.yaml", b"m")
    files.pipe("/lab/monday/monday.mcap", b"content")
    files.pipe("/lab/tuesday.db3", b"other")
    yield "memory://lab"
    files.rm("/lab", recursive=True)


def test_a_folder_with_metadata_is_one_bag_and_other_files_are_each(folder):
    bag = folder / "week" / "bag"
    bag.mkdir(parents=True)
    for name in ("metadata.yaml", "bag_0.mcap", "bag_1.mcap"):
        (bag / name).write_bytes(b"x" * 10)
    (folder / "notes.txt").write_text("no bag")
    (folder / ".hidden.mcap").write_text("half written")
    listed_sources = urls([folder])
    assert listed_sources == [*(str(folder / f"run{n}.mcap") for n in range(5)), str(bag)]
    assert dict(bags_of([str(folder)], [KNEE])).keys() and bags_of([str(bag)], [KNEE])[0][0].size == 30


def test_a_source_named_twice_counts_once(folder, tmp_path):
    listing = tmp_path / "list.txt"
    listing.write_text(f"# two\n{folder}/run1.mcap\n\n{folder}/run2.mcap\n")
    assert urls([folder / "*.mcap", f"@{listing}", folder]) == urls([folder])
    assert urls([f"@{listing}"]) == [str(folder / "run1.mcap"), str(folder / "run2.mcap")]


def test_a_joint_is_in_the_bags_that_its_pattern_names(folder):
    first, rest = replace(KNEE, bags=("run0.mcap",)), replace(HIP, bags=("bags/run[1-9]*",))
    listed_sources = bags_of([str(folder)], [first, rest])
    held = {bag.url[-9:]: [joint.name for joint in joints] for bag, joints in listed_sources}
    assert held["run0.mcap"] == ["knee"] and held["run3.mcap"] == ["hip"]


def test_an_object_store_is_read_like_a_folder(remote):
    (monday, _), (tuesday, _) = bags_of([remote], [KNEE])
    assert (monday.url, monday.size) == ("memory:///lab/monday", 8)
    assert tuesday.url == "memory:///lab/tuesday.db3"
    with local_copy(monday) as path:
        assert sorted(os.listdir(path)) == ["metadata.yaml", "monday.mcap"]
        assert (path / "monday.mcap").read_bytes() == b"content"
    assert not path.exists()
    assert relist(tuesday) == tuesday


def test_a_fingerprint_is_that_of_the_content(folder, remote):
    bags = [bag for bag, _ in bags_of([str(folder)], [KNEE])]
    assert len({fingerprint(bag) for bag in bags}) == 5
    (folder / "copy.mcap").write_bytes((folder / "run3.mcap").read_bytes())
    copy = next(bag for bag, _ in bags_of([str(folder)], [KNEE]) if bag.url.endswith("copy.mcap"))
    assert fingerprint(copy) == fingerprint(bags[3])


@pytest.mark.parametrize("source", ["nowhere", "nowhere/*.mcap", "@nowhere", "no-such-protocol://x"])
def test_a_source_without_recordings_is_named(source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FleetError, match=r"nowhere|no-such-protocol"):
        bags_of([source], [KNEE])


def test_a_chained_url_is_refused_at_once(folder):
    """Recordings in a zip were listed by names that no worker could open again."""
    with pytest.raises(FleetError, match="chained URL, expected a folder or one URL"):
        bags_of([f"zip://::file://{folder}/recs.zip"], ())
