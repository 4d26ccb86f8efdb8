"""The named signals that an effect may read and change inside the compiled step.

An effect's function gets the table as `s` and indexes it by these constants: `s[GEAR_TORQUE] -= …`.
The step fills the signals to be read, calls the effects that are on, and uses the changed signals.
"""

from enum import IntEnum


def sensor_of(channel: str) -> str:
    """Return the channel that names a channel's sensor: one encoder reads position and velocity."""
    return "position" if channel == "velocity" else channel


class Port(IntEnum):
    """Where in the chain an effect acts; the step calls the ports in this order.

    Of the signals from FIRST_READ to LAST_READ, COMMAND, MOTOR and SENSOR have only OUTPUT_ANGLE and
    OUTPUT_VELOCITY, at the end of the last step, or of this one at SENSOR.

    COMMAND: once a step, changes s[COMMAND], the mean over the step, and s[CURRENT], which the measured
        current shows at the end of the step. A law that bends takes the mean of what it makes of both
        commands of the step (_held.py), not what it makes of their mean.
    MOTOR: once a step, changes s[COMMAND] after that, which the measured current does not show.
    GEAR: at every evaluation of the torques, with the signals at the middle of the step; adds to
        s[GEAR_TORQUE], s[JOINT_TORQUE], s[HOUSING_TORQUE] or s[DISTAL_TORQUE].
    SPRING: likewise, adds to s[SPRING_TORQUE]; and once more at the end of the step with s[COMMIT] = 1:
        then it may change its own states x, and the torque that it adds is that at the F/T sensor.
    SENSOR: once a step, at its end; changes s[FT], s[POSITION], s[VELOCITY], s[SPRING_ANGLE] or
        s[CURRENT].
    STRUCTURE: not called; the effect changes the rig itself.
    """

    COMMAND = 0
    MOTOR = 1
    GEAR = 2
    SPRING = 3
    SENSOR = 4
    STRUCTURE = 5


TIME = 0  # s, since the first command
STEP = 1  # s, length of the step
DURATION = 2  # s, length of the record; a plant that runs on takes its `duration`
COMMIT = 3  # 1 when the step is done: only then may a SPRING effect change its own states x
COMMAND = 4  # N m, held over the step
CURRENT = 5  # N m, motor torque that the measured current shows at the end of the step
REFERENCE = 6  # rad, target of a controller in the loop
K_S = 7  # N m/rad; 0 of a rigid joint
B_S = 8  # N m s/rad
B_M = 9  # N m s/rad

ROTOR_ANGLE = 10  # rad, rotor relative to the housing
GEAR_ANGLE = 11  # rad, gear output before its own compliance, relative to the housing
GEAR_VELOCITY = 12  # rad/s
OUTPUT_ANGLE = 13  # rad, gear output relative to the housing, as the encoder reads it
OUTPUT_VELOCITY = 14  # rad/s
DEFLECTION = 15  # rad, chassis against distal side
DEFLECTION_RATE = 16  # rad/s
JOINT_ANGLE = 17  # rad, gear output before against after its own compliance
JOINT_RATE = 18  # rad/s
HOUSING_ANGLE = 19  # rad, absolute
HOUSING_VELOCITY = 20  # rad/s
DISTAL_ANGLE = 21  # rad, absolute
DISTAL_VELOCITY = 22  # rad/s
FIRST_READ, LAST_READ = ROTOR_ANGLE, DISTAL_VELOCITY

LOAD = 23  # N m, torque in the spring, effects included; of a rigid joint what holds it from outside

GEAR_TORQUE = 24  # N m, on the gear output, against the housing
SPRING_TORQUE = 25  # N m, in the spring beside K_s d + b_s d'
JOINT_TORQUE = 26  # N m, on the chassis, against the gear output
HOUSING_TORQUE = 27  # N m, on the housing, from outside
DISTAL_TORQUE = 28  # N m, on the distal side, from outside
FIRST_FORCE = GEAR_TORQUE

FT = 29  # N m
POSITION = 30  # rad
VELOCITY = 31  # rad/s

GEAR_VELOCITY_SPAN = 32  # rad/s, change of GEAR_VELOCITY over the step: it goes from -span/2 to +span/2
DEFLECTION_SPAN = 33  # rad, change of DEFLECTION over the step; 0 when COMMIT is 1
MOBILITY = 34  # rad/s per N m, what a torque at the gear over the step adds to GEAR_VELOCITY at its end
J_SC = 35  # kg m^2, spring chassis where it turns with the gear output; 0 behind a gear that gives
CREEP = 36  # rad/s, replaces the creep velocity of friction effects where it is not 0
TURNS = 37  # 1, turns of the rotor for one of the gear output
SENSED = 38  # 1, share of the spring's torque that the F/T sensor sees at once

PLAY = 39  # rad, what the spring turns more than DEFLECTION: where in the play its chassis is
SPRING_ANGLE = 40  # rad, deflection of the spring as its own encoder sees it
TARGETED = 41  # 1 where positions command the bench: then REFERENCE is its command
BEFORE = 42  # N m, by how much the command that the step begins with exceeds COMMAND, its mean over the step
AFTER = 43  # N m, likewise the one that it ends with; both 0 where one is held over the whole step
HELD = 44  # N m, or rad of a target: what is held, and jumps; 0 where the command is no held one
CURRENT_BEFORE = 45  # N m, as CURRENT when the command changes within the step

SIZE = 46
