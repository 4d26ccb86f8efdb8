"""Runs of simulated rigs, and the causes that a diagnosis tries, as the tests of the science need them."""

from dataclasses import replace

import numpy as np

import rsea_ros as rsea
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.records.record import Channel, Record

RATE = 280.0
RIG = rsea.load_rig("paper_high_impedance")
_LIGHT = RIG.with_values({
    "rotor.reflected_inertia": 0.06, "rotor.reflected_damping": 0.5, "spring.stiffness": 270.0,
    "spring.damping": 0.3,
}).quantities  # fmt: skip
FREE = replace(RIG, clamped=frozenset({"housing_end"}), quantities={
    **_LIGHT, "spring_end.inertia": replace(_LIGHT["rotor.reflected_inertia"], value=0.13),
    "spring_end.damping": replace(_LIGHT["rotor.reflected_damping"], value=0.3),
})  # fmt: skip
"""A light rotor and a load that moves."""


def free_run(rig=FREE):
    """Return 15 s of a rig whose command is new in every fourth sample."""
    torque = np.repeat(5.0 * np.random.default_rng(1).standard_normal(1050), 4)
    return rsea.simulate(rig, torque, RATE, seed=2)


def command_of(kind="white_noise", rate=RATE, **settings):
    """Return the command of an excitation as it is logged."""
    u = excitation(kind, ExcitationSettings(rate=rate, **settings))
    return Channel(np.arange(len(u)) / rate, u)


def excited(rig=RIG, kind="white_noise", sensors=0, rate=RATE, **settings):
    """Return the record of a rig that plays an excitation. sensors: the seed of their noise."""
    return rsea.simulate(rig, command_of(kind, rate, **settings).y, rate, seed=sensors)


def only(record, *names):
    """Return the command and some channels of a record."""
    return Record({n: record[n] for n in ("command", *names)}, source=record.source)


def trying(*names, **more):
    """Return settings of a diagnosis that tries these effects alone."""
    return DiagnosisSettings(without=tuple(n for n in catalogue() if n not in names), **more)
