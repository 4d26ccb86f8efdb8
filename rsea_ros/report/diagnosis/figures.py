"""Figures of a diagnosis before and after: the residual over frequency, the channel over time."""

from dataclasses import replace

import numpy as np

from rsea_ros.diagnosis.result import Diagnosis, Spectrum
from rsea_ros.documents.wording import list_names
from rsea_ros.report import words
from rsea_ros.report.figures.figure import AFTER, BEFORE, Figure, band, faint
from rsea_ros.report.figures.overlay import Simulated, overlay_figure
from rsea_ros.report.figures.spectrum import ABOVE_FLOOR, SpectrumLine, finding, in_bands, residual_figure

_FIRST_VIEW = 3.0
"""s of the record that the figure over time opens with."""


def spectrum_figure(diagnosis: Diagnosis, spectrum: Spectrum) -> Figure:
    """Return the residual's density before and after against the noise floor, the improvement shaded."""
    d, s, channel = diagnosis, spectrum, words.channel(spectrum.channel)
    if not d.causes:
        curves = [SpectrumLine("residual", AFTER if d.at_noise_floor else BEFORE, s.before)]
        title = finding(s.frequency, s.before, s.noise, channel)
        return residual_figure(title, s.channel, s.frequency, curves, s.noise)
    f, before = in_bands(s.frequency, s.before)
    _, after = in_bands(s.frequency, s.after)
    k, left = int(np.argmax(before)), int(np.argmax(after))
    most, rest = before[k] / s.noise, after[left] / s.noise
    peak = f"{words.number(most, 2)} times the noise floor at {words.number(f[k], 2)} Hz"
    end = f"at most {words.number(rest, 2)} times at {words.number(f[left], 2)} Hz"
    end = "it is at the floor" if rest < ABOVE_FLOOR else end
    causes = list_names([words.effect(c.name) for c in d.causes])
    they = "it" if len(d.causes) == 1 else "them"
    title = f"Without {causes} the residual is up to {peak}; with {they}, {end}"
    curves = [SpectrumLine("before", BEFORE, s.before), SpectrumLine("after", AFTER, s.after)]
    caption = f"Residual of the {channel}: measured minus simulated."
    figure = residual_figure(title, s.channel, s.frequency, curves, s.noise, caption)
    gained = band(f, np.minimum(after, before), before, faint(BEFORE, 0.10), name="gained")
    return replace(figure, data=[gained, *figure.data])


def time_figure(diagnosis: Diagnosis, channel: str) -> Figure:
    """Return the channel as measured and as simulated before and after, residuals beneath.

    With causes it opens where before and after differ most.
    """
    d = diagnosis
    before, after = (next(o for o in of if o.channel == channel) for of in (d.before, d.after))
    name, fit = words.sentence(words.channel(channel)), f"{d.fit_percent[channel]:.2f} %"
    if not d.causes:
        simulated = Simulated("simulated", AFTER if d.at_noise_floor else BEFORE, before.simulated)
        title = f"{name} over time: {fit} explained"
        return overlay_figure(title, channel, before.t, before.measured, [simulated])
    title = f"{name} over time: {fit} → {d.extended_fit_percent[channel]:.2f} % explained"
    both = [Simulated("before", BEFORE, before.simulated), Simulated("after", AFTER, after.simulated)]
    apart = before.simulated - after.simulated
    return overlay_figure(title, channel, before.t, before.measured, both, _FIRST_VIEW, apart)
