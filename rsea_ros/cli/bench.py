"""`rsea bench`: the paper's bench on a wire, for the driver to be tried without hardware."""

from __future__ import annotations

import argparse
import gc
import json
import os
import signal
import sys
import time
from pathlib import Path

from rsea_ros.cli._numbers import seed
from rsea_ros.cli._runs import RIG
from rsea_ros.errors import ParameterError
from rsea_ros.hardware.peer.bus import Bus
from rsea_ros.hardware.peer.ft import ForceSensor
from rsea_ros.hardware.peer.misbehaviour import Misbehaviour
from rsea_ros.hardware.peer.motor import Motor
from rsea_ros.hardware.peer.registers import MODELS
from rsea_ros.hardware.peer.requests import LineRequests
from rsea_ros.hardware.peer.station import Station
from rsea_ros.hardware.simulated import SimulatedDevice
from rsea_ros.model.rig_file import load_rig
from rsea_ros.new_files import check_free

HELP = "a motor on a pseudo-terminal and an F/T sensor on UDP, with a simulated plant behind both"
EXAMPLE = "rsea bench --rig paper_high_impedance --port bench_tty"
PLANT_RATE = 2000.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    add = parser.add_argument
    add("--port", type=Path, default=Path("rsea-bench-tty"), help="link to the pseudo-terminal")
    add("--model", type=int, nargs="+", default=[54024], choices=sorted(MODELS), metavar="NUMBER",
        help="number of the motor; of several on one line, with the IDs 1, 2, …: the sensor is on the first")
    add("--rig", default=RIG, help="the plant: a name in config/rigs, or a file")
    add("--ft-rate", type=float, default=1000.0, help="records a second, Hz, 1 to 7000")
    add("--torque-constant", type=float, default=0.0, help="N m at the gear output per A; 0: its model's")
    add("--return-delay", type=int, default=0, help="pause before an answer, unit 2 µs, 0 to 254")
    add("--seed", type=seed, default=0, help="of the sensors' noise and of the misbehaviour")
    add("--requests", action="store_true", help="take requests to misbehave on stdin, a JSON object a line")


def run(args: argparse.Namespace) -> int:
    """Say in one line of JSON where the bench is, and run it until stdin ends, or SIGINT or SIGTERM."""
    if not 1.0 <= args.ft_rate <= 7000.0:
        raise ParameterError(f"--ft-rate {args.ft_rate:g} Hz, expected 1 to 7000 Hz")
    if not 0 <= args.return_delay <= 254:
        raise ParameterError(f"--return-delay {args.return_delay}, expected 0 to 254 (unit 2 µs)")
    if not args.port.is_symlink():  # a link is what a bench that was killed leaves
        check_free([args.port])
    wrong = Misbehaviour(seed=args.seed)
    plants, motors = _motors(args)
    bus, sensor = Bus(args.port, motors, wrong), ForceSensor(plants[0], args.ft_rate, wrong)
    stop, stopping = os.pipe()
    inlet = sys.stdin.fileno() if args.requests else stop
    requests = LineRequests(motors, bus, sensor, wrong, inlet, sys.stdout.fileno())
    ports = {"ft_port": sensor.port, "page_port": sensor.page}
    gc.freeze()
    gc.disable()  # a motor does not pause to tidy up
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.default_int_handler)
        print(json.dumps({"port": str(args.port), "model": args.model[0], **ports}), flush=True)
        Station(plants, motors, bus, sensor, requests).run()
    except KeyboardInterrupt:
        pass
    finally:
        bus.vanish()
        os.close(stopping)
    return 0


def _motors(args: argparse.Namespace) -> tuple[list[SimulatedDevice], list[Motor]]:
    """Return each motor's plant, which runs, and each motor, with the IDs 1, 2, …"""
    rig = load_rig(args.rig)
    plants, motors = [], []
    for place, model in enumerate(args.model):
        plant = SimulatedDevice(rig, PLANT_RATE, seed=args.seed + place, clock=time.monotonic_ns)
        motor = Motor(model, plant, args.torque_constant)
        motor.put("id", place + 1)
        motor.put("return_delay", args.return_delay)
        plant.open()
        plants.append(plant)
        motors.append(motor)
    return plants, motors
