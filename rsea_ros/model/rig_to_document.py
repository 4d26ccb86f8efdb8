"""The mapping that the YAML file of a rig holds."""

from __future__ import annotations

from typing import Any

from rsea_ros.model.rig import CLOCK_DOUBT, Quantity, Rig, Sensor
from rsea_ros.model.rig_fields import FIELDS
from rsea_ros.records.record import UNITS


def rig_to_document(rig: Rig) -> dict[str, Any]:
    """Return the rig as the mapping that its YAML file holds."""
    document: dict[str, Any] = {
        "name": rig.name,
        "about": rig.about,
        "source": rig.source,
        "proximal": rig.proximal,
    }
    if rig.linear:
        document["linear"] = True
    if rig.ft_end != "spring_end":
        document["ft_end"] = rig.ft_end
    if rig.encoder_end != "gear_output":
        document["encoder_end"] = rig.encoder_end
    if rig.loop:
        document["controller"] = {"kind": rig.loop}
    if rig.hold != "zero":
        document["hold"] = rig.hold
    for name, quantity in rig.quantities.items():
        group, key = name.split(".")
        document.setdefault(group, {})[key] = _quantity_to_document(name, quantity)
    for end in sorted(rig.clamped):
        document.setdefault(end, {})["clamped"] = True
    document.setdefault("gear", {})["train"] = rig.train
    if rig.other_trains:
        document["gear"]["or"] = list(rig.other_trains)
    if rig.rigid_spring:
        document.setdefault("spring", {})["rigid"] = True
    document["known"] = sorted(rig.known)
    document["sensors"] = {n: _sensor_to_document(n, s) for n, s in rig.sensors.items()}
    if rig.controller:
        document["controller"] = {
            "k_p": rig.controller.k_p,
            "k_v": rig.controller.k_v,
            "limit": rig.controller.limit,
        }
    document["effects"] = [
        {
            "name": e.name,
            "parameters": {k: float(v) for k, v in e.parameters.items()},
            **({"guess": True} if e.guess else {}),
        }
        for e in rig.effects
    ]
    return document


def _sensor_to_document(name: str, sensor: Sensor) -> dict[str, Any]:
    body: dict[str, Any] = {"noise": sensor.noise, "quantum": sensor.quantum, "unit": UNITS[name]}
    body |= {"zero_unknown": True} if sensor.zero_unknown else {}
    if sensor.clock or sensor.clock_doubt != CLOCK_DOUBT:
        body["clock"] = {"value": sensor.clock, "unit": "s"}
    if sensor.clock_doubt != CLOCK_DOUBT:
        body["clock"]["doubt"] = sensor.clock_doubt
    return body | ({"clock_rate": {"value": sensor.clock_rate, "unit": "ppm"}} if sensor.clock_rate else {})


def _quantity_to_document(name: str, quantity: Quantity) -> dict[str, Any]:
    body: dict[str, Any] = {"value": float(quantity.value), "unit": FIELDS[name].unit}
    if quantity.spread:
        body["spread"] = float(quantity.spread)
    if quantity.source:
        body["source"] = quantity.source
    if quantity.ci95:
        body["ci95"] = [float(v) for v in quantity.ci95]
    return body
