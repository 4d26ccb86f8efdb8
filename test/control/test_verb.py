"""`rsea control` as a user runs it."""

import json

from rsea_ros.cli.main import main


def test_the_verb_writes_json_and_a_page(tmp_path, capsys):
    assert main(["control", "--rate", "280", "--json", "--fail-on", "missed", "--out", str(tmp_path)]) == 0
    result = json.loads(capsys.readouterr().out)
    (at,) = result["rates"]
    met = [trial["met"] for trial in at["trials"]]
    assert False not in met and met.count(True) > 12 and at["set"]["unstable"] == 0
    assert at["gains"]["k_p"] > 0.0 and "locked" in at["margins"]
    assert {c["effect"] for c in at["compensation"]} >= {"coulomb_friction", "torque_ripple", "backlash"}
    assert {m["motor"] for m in result["large_signal"]} >= {"h54-200-s500-r, continuous"}
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for said in ("with every margin kept", "softer than the spring", "Large signals"):
        assert said in page


def test_senseless_options_are_refused_in_one_line_with_status_2(tmp_path, capsys):
    for arguments, line in (
        (["bare_drive"], "rig bare_drive: spring.rigid = True"),
        (["--rate", "0"], "--rate 0 Hz, expected 50 to 2000 Hz"),
        (["--rate", "10000"], "--rate 10000 Hz, expected 50 to 2000 Hz"),
        (["--free", "paper_high_impedance"], "both ends are clamped"),
        (["nowhere.yaml"], "nowhere.yaml"),
    ):
        assert main(["control", *arguments, "--out", str(tmp_path)]) == 2
        told = capsys.readouterr().err
        assert line in told and told.count("\n") == 1
