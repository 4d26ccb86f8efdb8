"""The command of the page: soft, never above the limit, zero when nobody holds it."""

import math
from itertools import pairwise

import pytest

from rsea_extras.watch.command import CLOSING, PATIENCE, RELEASE, Bounds, Commander, Wish
from rsea_ros.errors import ParameterError

STEP = 1.0 / 280.0
BOUNDS = Bounds(torque=10.0, slew=2000.0, growth=20.0)


def play_wishes(commander, begin, seconds, wish=None, who="page"):
    """Return time and torque of each cycle; the page repeats its wish every 0.1 s."""
    rows, beat = [], -math.inf
    for k in range(round(seconds / STEP)):
        now = begin + k * STEP
        if wish is not None and now - beat >= 0.1:
            assert commander.hold(who, wish, now)
            beat = now
        rows.append((now, commander.torque(now)))
    return rows


def values(rows):
    return [torque for _, torque in rows]


def test_nothing_is_published_until_somebody_holds_the_command():
    assert set(values(play_wishes(Commander(BOUNDS), 0.0, 0.5))) == {None}


@pytest.mark.parametrize("wish", [Wish("constant", -8.0), Wish("sine", 8.0, 3.0), Wish("chirp", 8.0, 20.0)])
def test_the_command_starts_softly_and_stays_within_the_limit(wish):
    rows = values(play_wishes(Commander(BOUNDS), 0.0, 45.0, wish))
    assert max(abs(v) for v in rows) == pytest.approx(8.0, rel=0.01)
    for k in range(100):
        assert abs(rows[k]) <= BOUNDS.growth * k * STEP + 1e-9
    fastest = max(abs(b - a) for a, b in pairwise(rows)) / STEP
    assert fastest <= 2.0 * math.pi * wish.shape[1] * 8.0 + BOUNDS.growth + 1e-6


@pytest.mark.parametrize("wish", [Wish("constant", 8.0), Wish("sine", 8.0, 3.0)])
def test_without_a_heartbeat_the_torque_is_zero_and_then_ceases(wish):
    commander = Commander(BOUNDS)
    rows = play_wishes(commander, 0.0, 2.0, wish)
    after = play_wishes(commander, rows[-1][0] + STEP, PATIENCE + RELEASE + CLOSING + 0.1)
    late = [v for t, v in after if t > rows[-1][0] + PATIENCE + RELEASE + 2 * STEP]
    assert set(late) == {0.0, None} and late[-1] is None
    assert values(after).count(0.0) >= CLOSING / STEP - 2


def test_after_release_the_torque_reaches_zero_in_time():
    commander = Commander(BOUNDS)
    end = play_wishes(commander, 0.0, 2.0, Wish("constant", 8.0))[-1][0]
    commander.release("another")
    assert commander.torque(end + STEP) == pytest.approx(8.0)
    commander.release("page")
    assert commander.torque(end + 2 * STEP + RELEASE) == 0.0


def test_a_second_page_waits_until_the_first_lets_go():
    commander = Commander(BOUNDS)
    assert commander.hold("first", Wish("constant", 1.0), 0.0)
    assert not commander.hold("second", Wish("constant", 5.0), 0.1)
    assert commander.hold("second", Wish("constant", 5.0), 0.1 + PATIENCE + 0.5)


def test_another_shape_begins_at_zero():
    commander = Commander(BOUNDS)
    end = play_wishes(commander, 0.0, 2.0, Wish("constant", 8.0))[-1][0]
    rows = values(play_wishes(commander, end + STEP, 2.0, Wish("sine", 8.0, 5.0)))
    assert min(abs(v) for v in rows[:130]) < 0.1
    assert max(rows) > 7.5
    jumps = [abs(b - a) for a, b in pairwise(rows)]
    assert max(jumps) <= (2.0 * math.pi * 5.0 * 8.0 + BOUNDS.growth) * STEP * 1.01


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        (Wish("constant", 10.1), "amplitude 10.1 N·m, expected at most 10 N·m"),
        (Wish("constant", math.nan), "amplitude nan"),
        (Wish("noise", 1.0), "kind 'noise', expected one of constant, sine, chirp"),
        (Wish("sine", 1.0, 400.0), "frequency 400 Hz"),
        (Wish("chirp", 1.0, math.nan), "frequency nan Hz"),
        (Wish("sine", 9.0, 50.0), "expected at most 2000 N·m/s, the driver's slew_limit"),
    ],
)
def test_a_forbidden_command_is_refused(wish, message):
    commander = Commander(BOUNDS)
    with pytest.raises(ParameterError, match=message):
        commander.hold("page", wish, 0.0)
    assert commander.torque(0.1) is None


def test_without_known_limits_nothing_may_be_held():
    with pytest.raises(ParameterError, match="not known yet"):
        Commander().hold("page", Wish("constant", 1.0), 0.0)
