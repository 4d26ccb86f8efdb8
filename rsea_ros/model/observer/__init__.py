"""The observer: a Kalman filter on the rig's unlumped model, by sample at the stamps that arrive."""

from rsea_ros.model.observer.log import COMMAND, FT, STATE
from rsea_ros.model.observer.noise import Noise, noise_of
from rsea_ros.model.observer.observer import ErrorModel, Estimate, Observer, Sample, observe

__all__ = [
    "COMMAND",
    "FT",
    "STATE",
    "ErrorModel",
    "Estimate",
    "Noise",
    "Observer",
    "Sample",
    "noise_of",
    "observe",
]
