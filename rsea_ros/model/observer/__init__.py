"""The observer: a Kalman filter on the rig's unlumped model, by sample at the stamps that arrive."""

from rsea_ros.model.observer.observer import ErrorModel, Observer, TorqueEstimate, observe
from rsea_ros.model.observer.signal_noise import Noise, noise_of

__all__ = ["ErrorModel", "Noise", "Observer", "TorqueEstimate", "noise_of", "observe"]
