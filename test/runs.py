"""Runs of simulated rigs, and the causes that a diagnosis tries, as the tests of the science need them."""

import numpy as np

import rsea_ros as rsea
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.records.record import Channel, Record

RATE = 280.0
RIG = rsea.load_rig("paper_high_impedance")


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
