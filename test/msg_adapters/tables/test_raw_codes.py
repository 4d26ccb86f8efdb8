"""Raw codes of devices are recognised in their integers, ordinary columns of integers are not."""

from __future__ import annotations

import numpy as np
import pytest

from msg_adapters.tables.raw_codes import raw_code
from rsea_ros.errors import ImportMapError

MAP = "time: {{column: t, unit: s}}\nchannels: {{{}}}\n"
N = 3000
T = np.arange(N) / 500


def signals(seed):
    """Return what sensors and commands of a joint look like, each about -1 to 1."""
    rng = np.random.default_rng(seed)
    multisine = sum(np.sin(2 * np.pi * f * T + rng.uniform(0, 6)) for f in np.arange(0.25, 12, 0.75)) / 8
    steps = np.repeat(rng.uniform(-1, 1, N // 100), 100)
    pole = np.zeros(N)
    for k in range(1, N):
        pole[k] = pole[k - 1] + 0.05 * (steps[k] - pole[k - 1])
    two_levels = np.where(np.sin(2 * np.pi * 0.7 * T) > 0, 0.8, -0.8)
    return {
        "multisine": multisine + rng.normal(0, 0.01, N),
        "chirp": np.sin(2 * np.pi * (0.2 * T + 1.5 * T**2)) + rng.normal(0, 0.05, N),
        "noise": rng.normal(0, 0.3, N),
        "steps": steps,
        "lagged steps": pole + rng.normal(0, 0.01, N),
        "two levels": two_levels,
        "two noisy levels": two_levels + rng.normal(0, 0.02, N),
        "held": np.repeat(multisine[::10], 10),
        "clipped": np.clip(2 * multisine, -1, 1),
        "dropouts to the lowest": np.where(rng.random(N) < 0.01, -1, 0.6 + 0.05 * multisine),
        "spikes": np.where(rng.random(N) < 0.01, 1.0, 0.1 * multisine),
        "sawtooth": 2 * np.mod(0.8 * T, 1) - 1,
        "random walk": np.cumsum(rng.normal(0, 0.01, N)),
    }


def of_range(y, low, high):
    return np.rint(low + (y - y.min()) / np.ptp(y) * (high - low))


def test_no_ordinary_column_is_taken_for_codes():
    ranges = [(-100, 100), (-30000, 30000), (10, 250), (0, 1023), (0, 4095), (200, 60000), (0, 65535)]
    taken = {
        (name, low, high): code
        for name, y in signals(0).items()
        for low, high in ranges
        if (name, low) != ("sawtooth", 0)
        if (code := raw_code("x", of_range(y, low, high), 1e-3)) is not None
    }
    assert taken == {}


@pytest.mark.parametrize("name", ["multisine", "held"])
@pytest.mark.parametrize(
    ("code", "size", "expression"),
    [
        (lambda i: np.mod(i, 2**8), 60, "int8(x)"),
        (lambda i: np.mod(i, 2**16), 500, "int16(x)"),
        (lambda i: np.mod(i, 2**32), 30000, "int32(x)"),
        (lambda i: np.where(i < 0, 2**10 - i, i), 400, "sign_magnitude(x, 10)"),
        (lambda i: np.where(i < 0, 2**15 - i, i), 900, "sign_magnitude(x, 15)"),
    ],
)
def test_codes_are_recognised_with_the_expression_that_reads_them(name, code, size, expression):
    y = signals(3)[name]
    i = np.rint((y - y.mean()) / np.abs(y - y.mean()).max() * size)
    found = raw_code("x", code(i))
    assert found is not None
    assert f'"{expression}"' in found[1]


@pytest.mark.parametrize(("bits", "gear"), [(10, 1.0), (16, 0.01)])
def test_an_encoder_that_goes_round_is_unwrapped(bits, gear, files):
    turns = np.cumsum(0.01 * np.sin(2 * np.pi * 0.3 * T)) + 0.2
    counts = np.mod(np.rint(turns * 2**bits), 2**bits)
    what, remedy = raw_code("x", counts, gear * 2 * np.pi / 2**bits)
    assert what == f"encoder counts that begin anew at {2**bits}"
    rows = "".join(f"{t:.3f},{c:.0f}\n" for t, c in zip(T, counts, strict=True))
    expression, unit = remedy.replace("`", "").split(", unit")
    record = files(MAP.format(f"position: {{{expression}, unit{unit}}}"), f"t,x\n{rows}")
    expected = gear * 2 * np.pi * turns
    np.testing.assert_allclose(np.ptp(record["position"].y), np.ptp(expected), rtol=2e-2)
    assert np.abs(np.diff(record["position"].y)).max() < 0.1 * gear


ROWS = "t,i,u\n" + "".join(f"{k / 10},{(k % 21 - 10) % 65536},{k % 7}.5\n" for k in range(100))


def test_a_channel_of_codes_is_left_out_and_reported(files):
    both = "motor_torque: {column: i, unit: N m}, command: {column: u, unit: N m}"
    record = files(MAP.format(both), ROWS)
    assert list(record.channels) == ["command"]
    (fault,) = record.faults
    assert (fault.kind, fault.channel) == ("raw_codes", "motor_torque")
    assert fault.detail == (
        "left out: i holds signed 16 bit numbers read as unsigned, 0 to 65535; "
        'in the map: `expression: "int16(i)"`'
    )


@pytest.mark.parametrize("expression", ["int16(i)", "uint16(i)"])
def test_an_expression_that_reads_the_codes_is_taken_at_its_word(expression, files):
    record = files(MAP.format(f"motor_torque: {{expression: {expression}, unit: N m}}"), ROWS)
    assert record["motor_torque"].y.min() == (-10 if expression == "int16(i)" else 0)


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ("motor_torque: {expression: 2 * i, unit: N m}", "no channel is left: motor_torque: left out: i"),
        ("position: {column: k, unit: rad}", "whole rad alone: counts of an encoder.*scale:` 2 pi over"),
        ("position: {column: k, unit: rev, sign: -1}", "whole turns alone: counts of an encoder"),
    ],
)
def test_an_import_of_codes_alone_is_refused(channel, message, files):
    text = "t,k,i\n" + "".join(f"{k / 10},{3 * k},{(k % 21 - 10) % 65536}\n" for k in range(200))
    with pytest.raises(ImportMapError, match=message):
        files(MAP.format(channel), text)
