"""The observer: a Kalman filter on the rig's unlumped model, by sample at the stamps that arrive."""

from rsea_ros.model.observer.assemble import Noise, noise_of
from rsea_ros.model.observer.observer import ErrorModel, Observer, TorqueEstimate, observe

__all__ = ["ErrorModel", "Noise", "Observer", "TorqueEstimate", "noise_of", "observe"]
