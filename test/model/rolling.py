"""Speeds in a gear train from its rolling contacts and tooth counts, one equation a contact.

Shares nothing with rsea_ros.model.train: no ratio formula, only that two teeth in mesh move together.
"""

import numpy as np


def rotor_speed(train, ratio, housing, output):
    """Return the rotor's absolute speed for those of housing and gear output, rad/s."""
    match train:
        case "planetary":
            return _sun(ratio, carrier=output, annulus=housing)
        case "star":
            return _sun(ratio, carrier=housing, annulus=output)
        case "harmonic_circular_spline_held":
            return _wave_generator(ratio, flexspline=output, circular_spline=housing)
        case "harmonic_flexspline_held":
            return _wave_generator(ratio, flexspline=housing, circular_spline=output)
        case "spur":  # both shafts in the housing: equal and opposite rim speeds, radii 1 and N
            return housing - ratio * (output - housing)
        case "lumped":
            return ratio * output
    raise ValueError(train)


def _sun(ratio, carrier, annulus):
    """Sun of radius 1, annulus of radius N - 1, a planet between them on the carrier.

    At the sun:      w_s r_s = w_c (r_s + r_p) - v,      v = w_p r_p the planet's rim about its pin
    At the annulus:  w_a r_a = w_c (r_s + r_p) + v
    """
    r_sun, r_annulus = 1.0, ratio - 1.0
    pin = carrier * (r_sun + 0.5 * (r_annulus - r_sun))
    matrix = np.array([[r_sun, 1.0], [0.0, 1.0]])  # unknown: w_s, v
    return float(np.linalg.solve(matrix, [pin, annulus * r_annulus - pin])[0])


def _wave_generator(ratio, flexspline, circular_spline):
    """Flexspline of 2 N teeth in a circular spline of two more, in mesh at the ellipse's long axis.

    The axis turns with the generator. As many teeth of either pass it: z_f (w_f - w) = z_c (w_c - w).
    """
    z_f = 2.0 * ratio
    z_c = z_f + 2.0
    return (z_c * circular_spline - z_f * flexspline) / (z_c - z_f)
