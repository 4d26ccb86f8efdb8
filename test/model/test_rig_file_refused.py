"""Nonsense in a rig file is refused in one line with file, line, field, value and expectation."""

import copy

import pytest
import yaml

from rsea_ros.errors import RigError
from rsea_ros.model.rig_file import (
    load_rig,
    rig_path,
    save_rig,
)

BASE = yaml.safe_load(rig_path("paper_high_impedance").read_text())


def change(path, value):
    """Return a shipped document with the entry at a dotted path changed; DELETE removes it."""
    document = copy.deepcopy(BASE)
    *folders, last = path.split(".") if path != "7" else [7]
    place = document
    for key in folders:
        place = place.setdefault(key, {})
    if value is DELETE:
        del place[last]
    else:
        place[last] = value
    return document


@pytest.fixture
def refusal(tmp_path):
    """Return a function that reads a file with some content and returns what refuses it, without the path."""
    file = tmp_path / "bad.yaml"

    def read(content):
        file.write_bytes(content)
        with pytest.raises(RigError) as refused:
            load_rig(file)
        text = str(refused.value)
        assert text.startswith(f"{file}: ") and "\n" not in text
        return text.removeprefix(f"{file}: ")

    return read


DELETE = object()
NONSENSE = [
    ("rotor.reflected_inertia.value", -0.953,
     "rotor.reflected_inertia = -0.953 kg·m², expected a finite value > 0 kg·m²"),
    ("rotor.reflected_inertia.value", "heavy",
     "rotor.reflected_inertia = 'heavy', expected a number (kg·m²)"),
    ("rotor.reflected_inertia.value", 10**400, "rotor.reflected_inertia = "),
    ("rotor.reflected_inertia.unit", "g cm^2", "rotor.reflected_inertia.unit = 'g cm^2', expected 'kg m^2'"),
    ("rotor.reflected_inertia.spread", -0.1,
     "rotor.reflected_inertia.spread = -0.1, expected a relative one-sigma spread"),
    ("rotor.reflected_inertia.source", 7, "rotor.reflected_inertia.source = 7, expected text"),
    ("rotor.reflected_inertia.ci95", [0.9],
     "rotor.reflected_inertia.ci95 = [0.9], expected [low, high] in kg·m²"),
    ("rotor.reflected_inertia", 0.953, "rotor.reflected_inertia = 0.953, expected {value: …, unit: kg m^2}"),
    ("rotor.reflected_inertia", DELETE, "rotor.reflected_inertia is missing, expected a value in kg·m²"),
    ("rotor.mass", {}, "rotor: unknown key 'mass', expected one of reflected_damping, reflected_inertia"),
    ("rotor", None, "rotor = None, expected a mapping"),
    ("7", {}, "rig: unknown key 7, expected one of about"),
    ("gear.ratio.value", 0.5, "gear.ratio = 0.5, expected a finite value >= 1"),
    ("gear.train", "worm", "gear.train = 'worm', expected one of planetary, star, harmonic_"),
    ("gear.or", "star", "gear.or = 'star', expected a list of trains"),
    ("spring.stiffness", DELETE, "spring.stiffness is missing, expected a value in N·m/rad or `rigid: true`"),
    ("spring.stiffness.value", float("inf"),
     "spring.stiffness = inf, expected a value in N·m/rad or `rigid: true`"),
    ("spring.rigid", "yes", "spring.rigid = 'yes', expected true or false"),
    ("spring.rigid", True, "spring rigid and spring_end clamped, expected one of them"),
    ("spring_end.clamped", False, "spring_end.inertia is missing, expected a value in kg·m²"),
    ("proximal", "left", "proximal = 'left', expected one of housing_end, spring_end"),
    ("name", 5, "name = 5, expected text"),
    ("known", "gear.ratio", "known = 'gear.ratio', expected a list of field names"),
    ("known", ["spring_end.inertia"], "known: 'spring_end.inertia', expected a value that this rig states"),
    ("sensors.sound", {}, "sensors: unknown key 'sound', expected one of deflection"),
    ("sensors.command", {}, "sensors: unknown key 'command', expected one of deflection"),
    ("sensors.ft.unit", "lbf ft", "sensors.ft.unit = 'lbf ft', expected 'N m'"),
    ("sensors.ft.noise", -1, "sensors.ft = -1, 0 N·m, expected finite values >= 0"),
    ("sensors.ft.filter", 3, "sensors.ft.filter = 3, expected a mapping"),
    ("sensors.ft.filter", {}, "sensors.ft.filter.kind = '', expected one of one_pole, two_poles, average"),
    ("sensors.ft.filter", {"kind": "kalman", "r": 1}, "sensors.ft.filter: unknown key 'r', expected one of"),
    ("sensors.ft.filter", {"kind": "one_pole"},
     "sensors.ft.filter.time_constant = None, expected {value: …, unit: s}"),
    ("sensors.ft.filter", {"kind": "one_pole", "time_constant": {"value": 36, "unit": "ms"}},
     "sensors.ft.filter.time_constant.unit = 'ms', expected 's'"),
    ("sensors.ft.filter", {"kind": "one_pole", "time_constant": {"value": -0.036, "unit": "s"}},
     "sensors.ft.filter.time_constant = -0.036, expected 1e-06 to 10 s: T of"),
    ("sensors.ft.filter", {"kind": "average", "samples": {"value": 4.5, "unit": "1"}},
     "sensors.ft.filter.samples = 4.5, expected 1 to 10000: number of the last ones, a whole one"),
    ("controller", 3, "controller = 3, expected a mapping"),
    ("controller", {"k_v": 1.0}, "controller.k_p = None, expected a number (1/s)"),
    ("controller", {"k_p": 1.0, "k_v": -1.0}, "controller.k_v = -1 N·m·s/rad, expected a finite value >= 0"),
    ("effects", {"name": "x"}, "effects = {'name': 'x'}, expected a list"),
    ("effects", [{"name": "coulomb_friction", "parameters": {"torque": "big"}}], "effects[0].torque = 'big'"),
    ("effects", [{"name": "coulomb_friction", "size": 3}], "effects[0]: unknown key 'size'"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("path", "value", "message"), NONSENSE, ids=lambda item: "deleted" if item is DELETE else str(item)[:40]
)
def test_nonsense_is_refused_in_one_line_that_names_it(path, value, message, refusal):
    assert message in refusal(yaml.safe_dump(change(path, value)).encode())


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "holds nothing, expected a mapping with the keys of a rig"),
        (b"name: [", "not YAML: "),
        (b"\xff\xfe\x00", "not YAML: byte 0 is 0xff, which is not UTF-8"),
        (b"name: !!python/object:os.system {}", "not YAML: "),
    ],
    ids=["empty", "broken", "binary", "object"],
)
def test_a_file_that_is_not_a_rig_is_refused(content, message, refusal):
    assert refusal(content).startswith(message)


def test_a_file_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(RigError, match=r"none\.yaml: No such file or directory, expected a rig in YAML"):
        load_rig(tmp_path / "none.yaml")
    with pytest.raises(RigError, match=r"rig 'none' not found, expected a YAML file or one of .*bare_drive"):
        load_rig("none")


def test_a_folder_is_no_rig(tmp_path, monkeypatch):
    (tmp_path / "pendulum").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_rig("pendulum").name == "pendulum"
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(RigError, match=r": Is a directory, expected a rig in YAML that can be read"):
        load_rig(tmp_path / "folder.yaml")


def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path):
    with pytest.raises(RigError, match=r"model\.yaml: .*, expected a place that can be written"):
        save_rig(load_rig("pendulum"), tmp_path / "none" / "model.yaml")
    assert not list(tmp_path.iterdir())


TEXT = rig_path("paper_high_impedance").read_text()
LINES = {
    "value: 0.953": ("value: 0x10", "rotor.reflected_inertia.value: '0x10' is hexadecimal"),
    "value: 23.088": ("value: 1:30", "rotor.reflected_damping.value: '1:30' is sexagesimal"),
    "value: 502": ("value: .nan", "gear.ratio = nan, expected a number (1)"),
    "value: 3.0": ("value: yes", "spring.damping = True, expected a number (N·m·s/rad)"),
    "noise: 0.03": ("noise: .inf", "sensors.ft = inf, 0 N·m, expected finite values >= 0"),
    "spread: 0.05": ("spread: 2024-01-01", "spring.stiffness.spread: '2024-01-01' is a date"),
    "proximal: housing_end": ("proximal: left", "rig paper_high_impedance: proximal = 'left'"),
    "chassis:": ("rotor:", "key 'rotor' stands twice, first in line 7"),
    "known:": ("knows:", "rig: unknown key 'knows'"),
}


@pytest.mark.parametrize("old", LINES)
def test_a_mistake_is_named_with_its_line(old, refusal):
    new, message = LINES[old]
    assert TEXT.count(old) == 1
    line = TEXT[: TEXT.index(old)].count("\n") + 1
    assert refusal(TEXT.replace(old, new).encode()).startswith(f"line {line}: {message}")


BAD_EFFECTS = [
    ("backlash", "{gap: -1}", "line 26: effect backlash: gap = -1 rad, expected 0 to 0.1 rad"),
    ("backlash", "{gap: .nan}", "line 25: effects[0].gap = nan, expected a number (SI)"),
    ("backlash", "{width: 1}", "line 26: effect backlash: unknown parameter 'width', expected gap"),
    ("backlash", "{}", "line 26: effect backlash: parameter 'gap' is missing"),
    ("warp", "{}", "line 26: effect 'warp': not in the catalogue"),
    ("backlash", "{gap: 0.001}\n- {name: backlash, parameters: {gap: 0.001}}",
     "line 27: effect backlash is given twice, expected once"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "parameters", "message"), BAD_EFFECTS)
def test_effects_of_a_rig_are_checked(name, parameters, message, refusal):
    text = f"{TEXT}effects:\n- name: {name}\n  parameters: {parameters}\n"
    assert refusal(text.encode()).startswith(message)
