"""A mistake in a file is described in words for people, not in those of a parser."""

from __future__ import annotations

import gzip

import pytest

PARSERS = ("None", "codec", "miMATRIX", "Mat file", "int()", "end-of-stream", "gzipped", "indices")
MAP = "time: {rate: 100}\nchannels: {command: {column: u, unit: N m}}\n"
PACKED = gzip.compress(b"u\n1\n2\n", mtime=0)


@pytest.mark.parametrize(
    ("name", "content", "mapped", "said"),
    [
        ("run.csv", b"u\n1\n2\n", "", "map is empty, expected a mapping"),
        ("run.mat", b"hello", MAP, "no MAT file that can be read, expected one up to version 7"),
        ("run.csv.gz", PACKED[:12], MAP, "damaged or no gzip file"),
        ("run.csv.gz", b"\xff\xfe\x00", MAP, "damaged or no gzip file"),
    ],
)
def test_a_mistake_in_a_table_or_its_map_is_described_in_plain_words(
    name, content, mapped, said, tmp_path, refused
):
    (tmp_path / "map.yaml").write_text(mapped)
    (tmp_path / name).write_bytes(content)
    line = refused("import", tmp_path / name, "--map", tmp_path / "map.yaml", "--out", tmp_path / "bag")
    assert said in line and not [word for word in PARSERS if word in line]


def test_predict_says_where_the_rig_goes(refused):
    line = refused("predict", "run.mcap", "--rig", "my_bench.yaml")
    assert "first argument, `rsea predict my_bench.yaml BAG`" in line
