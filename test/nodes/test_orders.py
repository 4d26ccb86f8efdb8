"""Stop, clear_fault, reboot, activation, deactivation, faults: in every order, at every moment of each other.

What the interlock allows is held against the history: a torque needs an activation that nothing came after,
and no stop or fault that a request which began later has not ended.
"""

from __future__ import annotations

import asyncio
import itertools
import random
from collections import Counter
from types import SimpleNamespace

import pytest

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.interlock import DeviceFault, Interlock, event
from rsea_ros.nodes import _joint
from rsea_ros.nodes._joint import DrivenJoint, Offer, stop_of
from test.nodes.monitor import World

FAULT = DeviceFault("ft", detail="silent")
LONG = ("clear", "reboot", "enable")
KINDS = (*LONG, "stop", "fault", "disable")
SEEDS, STEPS = range(300), 120


class History:
    """The requests and faults so far by their instants; it knows no latch, and is asked what may be."""

    def __init__(self):
        self.now, self.stops, self.faults, self.disabled = 0, [], [], 0
        self.enabled, self.stops_ended, self.faults_ended = None, -1, -1

    def happens(self, kind):
        self.now += 1
        if kind == "stop":
            self.stops.append(self.now)
        elif kind == "fault":
            self.faults.append(self.now)
        elif kind == "disable":
            self.disabled, self.enabled = self.now, None
        return self.now

    def latched(self):
        """Whether a stop or a fault has not been ended."""
        return max(self.stops, default=-1) > self.stops_ended or self._faulty(self.faults_ended)

    def _faulty(self, since):
        return max(self.faults, default=-1) > since

    def ends(self, kind, asked, began):
        """A request that takes time is over; return whether it may say that it is done."""
        self.now += 1
        if kind == "enable":
            done = not self.latched() and self.disabled < asked
            self.enabled = self.now if done else self.enabled
            return done
        self.faults_ended = max(self.faults_ended, began)
        if kind == "clear" and not self._faulty(began):
            self.stops_ended = max(self.stops_ended, asked)
        stopped = kind == "clear" and max(self.stops, default=-1) > self.stops_ended
        return not stopped and not self._faulty(began)

    def is_free(self):
        return self.enabled is not None and not self.latched()


class Both:
    """An interlock and its history, told the same."""

    def __init__(self, kinds):
        self.lock, self.history, self.away = Interlock(), History(), None
        self.asked, self.began = {}, {}
        for kind in kinds:
            self.at_once(kind)

    def at_once(self, kind):
        """Something without duration, or a request that nothing comes between."""
        if kind in LONG:
            for part in range(3):
                self.step("before", kind, part)
        else:
            lock = self.lock
            {"stop": lock.stop, "fault": lambda: lock.trip(FAULT), "disable": lock.disable}[kind]()
            self.history.happens(kind)
        self.agree()

    def step(self, name, kind, part):
        """A part of a request: it is asked for, has the device, ends. One has the device at a time."""
        if part == 0:
            self.asked[name] = event(), self.history.happens(kind)
        elif part == 1 and self.away is None:
            self.away = name
            self.began[name] = event(), self.history.happens(kind)
        elif part == 2 and self.away == name:
            self.away = None
            self.end(name, kind)
        self.agree()

    def end(self, name, kind):
        asked, began = self.asked[name], self.began[name]
        try:
            if kind == "enable":
                self.lock.enable(asked[0])
            else:
                self.lock.end_fault(began[0])
                if kind == "clear":
                    self.lock.end_stop(asked[0])
            done = True
        except DeviceError:
            done = False
        assert self.history.ends(kind, asked[1], began[1]) == done, (name, kind)

    def agree(self):
        assert self.lock.is_free == self.history.is_free(), vars(self.history)


def parts(name, kind):
    return [(name, kind, part) for part in range(3)] if kind in LONG else [(name, kind, None)]


def interleavings(first, second):
    """Every order of the parts of two requests, each in its own order."""
    count = len(first) + len(second)
    for places in itertools.combinations(range(count), len(first)):
        ones, twos = iter(first), iter(second)
        yield [next(ones) if k in places else next(twos) for k in range(count)]


ACTIVE = ("enable",)
STATES = [(), ACTIVE, (*ACTIVE, "fault"), (*ACTIVE, "stop"), (*ACTIVE, "fault", "stop"), ("stop", "fault")]


def test_every_pair_of_requests_in_every_state_and_order_ends_only_what_came_before():
    """A stop during clear_fault or reboot was acknowledged and forgotten: 10 N m acted when that was over."""
    tried = 0
    for state, first, second in itertools.product(STATES, KINDS, KINDS):
        for order in interleavings(parts("one", first), parts("two", second)):
            both = Both(state)
            for name, kind, part in order:
                both.at_once(kind) if part is None else both.step(name, kind, part)
            tried += 1
    assert tried > 1000


def test_walks_of_many_requests_at_once_agree_with_their_history():
    free = Counter()
    for seed in SEEDS:
        dice, both, running = random.Random(seed), Both(()), {}
        for step in range(STEPS):
            kind = dice.choice((*KINDS, "clear", "enable", "clear"))
            if running and dice.random() < 0.6:
                name = dice.choice(list(running))
                kind, part = running[name]
                both.step(name, kind, part)
                running[name] = kind, part + 1
                if part == 2:
                    del running[name]
            elif kind in LONG:
                both.step(step, kind, 0)
                running[step] = kind, 1
            else:
                both.at_once(kind)
            free[both.lock.is_free] += 1
    assert min(free.values()) > 0.01 * free.total(), free


MOMENTS = ("recover", "disable", "read", "enable")


@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("service", ["clear", "reboot"])
@pytest.mark.parametrize("latched", ["ft", "stop", "both"])
def test_a_stop_at_any_moment_of_a_service_holds_until_a_later_clear(moment, service, latched):
    world = World()
    world.activate()
    world.cycles(20, 10.0)
    if latched != "stop":
        world.guarded.guard.trip(FAULT)
    if latched != "ft":
        world.drive.stop()
    world.cycles(2, 10.0)
    called = world.motor.at(moment, world.drive.stop)
    try:
        with world.drive.deaf():
            getattr(world.guarded, service)()
    except DeviceError as error:
        assert "stop was called meanwhile" in str(error)
    assert called or (moment, service) == ("disable", "clear")
    if called or latched != "ft":
        expected = [0.0] * 30 if called or service == "reboot" else None
        assert expected in (None, world.cycles(30, 10.0))
        assert (world.guarded.fault is None) == (expected is None)
    with world.drive.deaf():
        world.guarded.clear()
    assert world.cycles(30, 10.0)[-1] == 10.0 and not world.monitor.violations


def test_a_stop_or_a_fault_at_any_moment_of_an_activation_refuses_it():
    for happens in (lambda w: w.drive.stop, lambda w: lambda: w.guarded.guard.trip(FAULT)):
        world = World()
        assert world.motor.at("enable", happens(world)) == []
        with pytest.raises(DeviceError, match="expected clear_fault first"):
            world.activate()
        assert not world.motor.on and world.cycles(5, 10.0) == [0.0] * 5


def test_a_motor_that_fails_in_a_clear_leaves_fault_and_stop():
    world = World()
    world.activate()
    world.cycles(20, 10.0)
    world.drive.stop()

    def fail():
        raise NoReply("no reply")

    world.motor.at("recover", fail)
    with pytest.raises(NoReply), world.drive.deaf():
        world.guarded.clear()
    assert world.cycles(5, 10.0) == [0.0] * 5 and world.guarded.fault.cause == "stopped"


def test_a_clear_that_comes_before_the_answer_of_a_stop_ends_none():
    """Of 58 clears that were sent while a stop was being answered, 16 gave the torque back."""
    lock = Interlock()
    lock.stop(is_answered=False)
    with pytest.raises(DeviceError, match="stop was called meanwhile"):
        lock.end_stop(event())
    waiting = event()
    lock.answer()
    with pytest.raises(DeviceError, match="stop was called meanwhile"):
        lock.end_stop(waiting)
    lock.end_stop(event())
    assert not lock.stopped


class Waiting(list):
    """Requests of a service that nobody has taken."""

    def __enter__(self):
        return self

    def __exit__(self, *error):
        """Let it go."""

    def service_take_request(self, kind):
        return None, self.pop(0) if self else None


class Desk:
    """The services of a joint. An executor takes the requests that wait, of any service first."""

    def __init__(self, monkeypatch):
        self.world, self.taken, self.made = World(), [], []
        self.joint = joint = DrivenJoint.__new__(DrivenJoint)
        joint.guarded, joint.drive, joint.part, joint._double = self.world.guarded, self.world.drive, "", ""
        joint._values, joint._offers = {"allow_no_position_limit": True}, []
        logger = SimpleNamespace(info=lambda text: None)
        node = SimpleNamespace(create_service=self._service, get_logger=lambda: logger)
        jobs = SimpleNamespace(group=None, do=self._do, soon=lambda *task: self.taken.append(task))
        self.offers = {
            name: Offer(node, jobs, name, work, lambda: None)
            for name, work in (("clear", joint.clear_fault), ("reboot", joint._reboot))
        } | {"stop": stop_of(node, jobs, "stop", [joint], joint._offers, lambda: None)}
        joint._offers += self.offers.values()
        monkeypatch.setattr(_joint.time, "sleep", lambda seconds: self.cycles(14))

    def _service(self, kind, name, serve, qos_profile, callback_group):
        return SimpleNamespace(handle=Waiting(), serve=serve, send_response=lambda response, header: None)

    async def _do(self, work):
        return work()

    def cycles(self, count):
        self.made += self.world.cycles(count, 10.0)

    def send(self, name):
        if name != "enable":
            self.offers[name]._service.handle.append(name)

    def serve(self, name):
        """Do what the executor does with a request, unless it was taken up before."""
        if name == "enable":
            try:
                self.joint.enable()
            except DeviceError:
                self.world.guarded.disable()
        elif self.offers[name]._service.handle:
            self.offers[name]._service.handle.pop(0)
            asyncio.run(self.offers[name]._service.serve(None, SimpleNamespace()))
        self.cycles(3)
        while self.taken:
            do, *given = self.taken.pop(0)
            asyncio.run(do(*given))
        self.cycles(30)


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("others", [(), ("clear",), ("reboot",), ("clear", "reboot")])
def test_a_stop_that_waits_is_overtaken_by_no_activation(monkeypatch, others, late):
    """Sent during configure, it was executed after an activation that was sent later: up to 3 torques."""
    for order in itertools.permutations(("stop", "enable", *others)):
        desk = Desk(monkeypatch)
        desk.world.monitor.active = True
        for name in order:
            if name != "stop" or not late:
                desk.send(name)
        if late:
            desk.world.motor.at("enable", lambda desk=desk: desk.send("stop"))
        for name in order:
            desk.serve(name)
        assert not any(desk.made), order
        assert desk.world.guarded.interlock.stopped, order
        for name in ("clear", "enable"):
            desk.send(name)
            desk.serve(name)
        assert desk.world.torques[-1] == 10.0 and not desk.world.monitor.violations
