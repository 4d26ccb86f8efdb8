"""`rsea bench`: a simulated bench behind real wires, to try the driver without hardware."""

import argparse
import gc
import json
import os
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path
from shlex import quote

from rsea_ros.cli._options import RIG, path
from rsea_ros.cli._processes import parameters_of_bench
from rsea_ros.cli._terminal import whole_number
from rsea_ros.errors import ParameterError
from rsea_ros.hardware.peer.can_drive import DRIVES, EmulatedCan, EmulatedDrive
from rsea_ros.hardware.peer.ft import ForceSensor, Misbehaviour
from rsea_ros.hardware.peer.peer_motor import IDENTITY, KEPT, EmulatedEncoder, EmulatedMotor
from rsea_ros.hardware.peer.registers import ENCODER, MODELS
from rsea_ros.hardware.peer.requests import LineRequests, Station
from rsea_ros.hardware.peer.serial_line import EmulatedBus
from rsea_ros.hardware.simulated import SimulatedDevice
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_file import load_rig
from rsea_ros.outputs.files import check_free

HELP = "simulate a bench behind real wires: a motor on a pseudo-terminal and an F/T sensor on UDP"
EXAMPLE = "rsea bench --rig paper_high_impedance --port bench_tty"
PLANT_RATE = 10_000.0
"""Hz. At 2 kHz a sensor's record was up to 0.5 ms older than its stamp: 0.9 degrees of a sine of 5 Hz."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--port", type=path, default=Path("rsea-bench-tty"), help="name of the link to the pseudo-terminal")
    add("--model", type=int, nargs="+", default=[54024], choices=sorted(MODELS), metavar="NUMBER",
        help="number of the motor; several form a line with the IDs 1, 2, …, the sensor on the first")
    add("--can", nargs="+", default=[], choices=sorted(DRIVES), metavar="MODEL",
        help="drives on a CAN bus behind a serial-line adapter in place of the motors of --model")
    add("--rig", default=RIG, help="rig of the plant: a name in config/rigs, or a file")
    add("--ft-rate", type=float, default=1000.0, help="record rate of the F/T sensor, Hz, 1 to 7000")
    add("--deflection", action="store_true",
        help="no F/T sensor: an encoder on the spring of the first motor, with ID 100 on the same line")
    add("--torque-constant", type=float, default=0.0, help="N·m at the output per A; 0: that of the model")
    add("--return-delay", type=int, default=0, help="delay of each reply in units of 2 µs, 0 to 254")
    add("--seed", type=whole_number, default=0, help="seed of the sensor noise and of the misbehaviour")
    add("--requests", action="store_true", help="read requests to misbehave from stdin, JSON lines")


def run(args: argparse.Namespace) -> int:
    """Print the ports of the bench in one line of JSON, and run it until stdin ends or a signal stops it."""
    if not 1.0 <= args.ft_rate <= 7000.0:
        raise ParameterError(f"--ft-rate {args.ft_rate:g} Hz, expected 1 to 7000 Hz")
    if not 0 <= args.return_delay <= 254:
        raise ParameterError(f"--return-delay {args.return_delay}, expected 0 to 254 (unit 2 µs)")
    if not args.port.is_symlink():  # a killed bench leaves its link
        check_free([args.port])
    wrong = Misbehaviour(seed=args.seed)
    kept = KEPT if args.requests else 0  # nobody else can ask for the logs
    plants, motors = _motors(args, kept)
    if args.deflection and args.can:
        raise ParameterError("--deflection with --can, expected one of them: no drive reads an encoder")
    if args.deflection:
        motors.append(EmulatedEncoder(plants[0]))
    bus = (EmulatedCan if args.can else EmulatedBus)(args.port, motors, wrong, kept)
    sensor = ForceSensor(plants[0], args.ft_rate, wrong)
    stop, stopping = os.pipe()
    inlet = sys.stdin.fileno() if args.requests else stop
    requests = LineRequests(motors, bus, sensor, wrong, inlet, sys.stdout.fileno())
    place = _place(args, sensor)
    gc.freeze()
    gc.disable()  # a real motor does not stop for garbage collection
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.default_int_handler)
        print(json.dumps(place), flush=True)
        Station(plants, motors, bus, sensor, requests).run()
    except KeyboardInterrupt:
        pass
    finally:
        bus.vanish()
        os.close(stopping)
    return 0


def _place(args: argparse.Namespace, sensor: ForceSensor) -> dict[str, object]:
    """Return where the bench is, and the command that starts the driver on it."""
    encoder: dict[str, object] = {}
    if args.can:
        encoder = {"device": "mit_can", "can_interface": "slcan", "can_model": args.can[0]}
    felt = f"ft_host:=127.0.0.1 ft_port:={sensor.port} ft_page_port:={sensor.page}"
    if args.deflection:
        encoder = {"encoder_id": IDENTITY, "encoder_pulses": float(ENCODER.counts_per_turn)}
        felt = " ".join(["ft_host:=\"''\"", *(f"{name}:={value}" for name, value in encoder.items())])
    if args.can:
        felt = " ".join([*(f"{name}:={value}" for name, value in encoder.items()), felt])
    launch = (
        f"rsea launch hardware rig:={quote(args.rig)} port:={quote(str(args.port))} {felt} "
        f"params:={quote(str(parameters_of_bench()))} identify:=false"
    )
    return {
        "port": str(args.port), "model": (args.can or args.model)[0], "ft_port": sensor.port,
        "page_port": sensor.page, "launch": launch, **encoder,
    }  # fmt: skip


def _motors(args: argparse.Namespace, kept: int) -> tuple[list[SimulatedDevice], list[EmulatedMotor]]:
    """Return the running plant of each motor, and the motors, with the IDs 1, 2, …

    With --deflection the spring has an encoder: the rig's, or one that only its counts limit.
    """
    rig = load_rig(args.rig)
    if args.deflection and rig.rigid_spring:
        raise ParameterError(f"--deflection: the spring of rig {rig.name} is rigid, expected one that gives")
    rig = replace(rig, sensors={"deflection": Sensor(), **rig.sensors}) if args.deflection else rig
    plants: list[SimulatedDevice] = []
    motors: list[EmulatedMotor] = []
    for place, model in enumerate(args.can or args.model):
        plant = SimulatedDevice(rig, PLANT_RATE, seed=args.seed + place, clock=time.monotonic_ns)
        motor = (
            EmulatedDrive(model, plant, kept) if args.can
            else EmulatedMotor(model, plant, args.torque_constant, kept=kept)
        )  # fmt: skip
        motor.put("id", place + 1)
        motor.put("return_delay", args.return_delay)
        plant.open()
        plants.append(plant)
        motors.append(motor)
    return plants, motors
