"""A mistake in a file is described in words for people, not in those of a parser."""

from __future__ import annotations

import gzip

import pytest

from rsea_ros.cli.main import main

PARSERS = ("None", "codec", "miMATRIX", "Mat file", "int()", "end-of-stream", "gzipped", "indices")
MAP = "time: {rate: 100}\nchannels: {command: {column: u, unit: N m}}\n"
PACKED = gzip.compress(b"u\n1\n2\n", mtime=0)


def test_a_mistake_in_an_import_map_is_described_in_plain_words(tmp_path, capsys):
    (tmp_path / "map.yaml").write_bytes(b"")
    (tmp_path / "run.csv").write_text("u\n1\n2\n")
    assert main(["import", *_files(tmp_path, "run.csv")]) == 2
    _assert_plain(capsys.readouterr().err, "map is empty, expected a mapping")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("run.mat", b"hello", "no MAT file that can be read, expected one up to version 7"),
        ("run.csv.gz", PACKED[:12], "damaged or no gzip file"),
        ("run.csv.gz", b"\xff\xfe\x00", "damaged or no gzip file"),
    ],
)
def test_a_mistake_in_a_table_is_described_in_plain_words(name, content, said, tmp_path, capsys):
    (tmp_path / "map.yaml").write_text(MAP)
    (tmp_path / name).write_bytes(content)
    assert main(["import", *_files(tmp_path, name)]) == 2
    _assert_plain(capsys.readouterr().err, said)


def _files(folder, name):
    return [str(folder / name), "--map", str(folder / "map.yaml"), "--out", str(folder / "bag")]


def _assert_plain(text, said):
    assert said in text
    assert not [word for word in PARSERS if word in text]


def test_predict_says_where_the_rig_goes(capsys):
    with pytest.raises(SystemExit) as left:
        main(["predict", "run.mcap", "--rig", "my_bench.yaml"])
    assert left.value.code == 2
    assert "first argument, `rsea predict my_bench.yaml BAG`" in capsys.readouterr().err
