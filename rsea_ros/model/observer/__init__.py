"""The observer: a Kalman filter on the rig's unlumped model, by sample at the stamps that arrive."""

from rsea_ros.model.observer.noise import Noise, noise_of
from rsea_ros.model.observer.observer import ErrorModel, Estimate, Observer, observe

__all__ = ["ErrorModel", "Estimate", "Noise", "Observer", "noise_of", "observe"]
