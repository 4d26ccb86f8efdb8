"""Figures of a diagnosis before and after: the residual over frequency, the channel over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.diagnosis.result import Diagnosis, Spectrum
from rsea_ros.documents.wording import list_names
from rsea_ros.identification.result import Overlay
from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.figures.figure import Figure, band
from rsea_ros.report.figures.overlay import Simulated, overlay_figure
from rsea_ros.report.figures.palette import AFTER, BEFORE, faint
from rsea_ros.report.figures.spectrum import ABOVE_FLOOR, SpectrumLine, finding, in_bands, residual_figure

_FIRST_VIEW = 3.0
"""s of the record that the figure over time opens with."""


def spectrum_figure(diagnosis: Diagnosis, spectrum: Spectrum) -> Figure:
    """Return the residual's density before and after against the noise floor."""
    s, channel = spectrum, words.channel(spectrum.channel)
    if not diagnosis.causes:
        curves = [SpectrumLine("residual", AFTER if diagnosis.at_noise_floor else BEFORE, s.before)]
        title = finding(s.frequency, s.before, s.noise, channel)
        return residual_figure(title, s.channel, s.frequency, curves, s.noise)
    curves = [SpectrumLine("before", BEFORE, s.before), SpectrumLine("after", AFTER, s.after)]
    title, caption = _before_and_after(diagnosis, s), f"Residual of the {channel}: measured minus simulated."
    figure = residual_figure(title, s.channel, s.frequency, curves, s.noise, caption)
    return replace(figure, data=[_gain_area(s), *figure.data])


def _gain_area(spectrum: Spectrum) -> dict[str, object]:
    """Return the area between before and after, the improvement."""
    frequency, before = in_bands(spectrum.frequency, spectrum.before)
    _, after = in_bands(spectrum.frequency, spectrum.after)
    return band(frequency, np.minimum(after, before), before, faint(BEFORE, 0.10), name="gained")


def _before_and_after(diagnosis: Diagnosis, s: Spectrum) -> str:
    causes = list_names([words.effect(c.name) for c in diagnosis.causes])
    f, before = in_bands(s.frequency, s.before / s.noise)
    _, after = in_bands(s.frequency, s.after / s.noise)
    k, left = int(np.argmax(before)), int(np.argmax(after))
    peak = f"{words.number(before[k], 2)} times the noise floor at {words.number(f[k], 2)} Hz"
    rest = f"at most {words.number(after[left], 2)} times at {words.number(f[left], 2)} Hz"
    end = "it is at the floor" if after[left] < ABOVE_FLOOR else rest
    pronoun = "it" if len(diagnosis.causes) == 1 else "them"
    return f"Without {causes} the residual is up to {peak}; with {pronoun}, {end}"


def time_figure(diagnosis: Diagnosis, channel: str) -> Figure:
    """Return the channel as measured and as simulated before and after, residuals beneath."""
    before, after = (_overlay(overlays, channel) for overlays in (diagnosis.before, diagnosis.after))
    simulations = [Simulated("before", BEFORE, before.simulated), Simulated("after", AFTER, after.simulated)]
    if not diagnosis.causes:
        colour = AFTER if diagnosis.at_noise_floor else BEFORE
        simulations = [Simulated("simulated", colour, before.simulated)]
    figure = overlay_figure(_over_time(diagnosis, channel), channel, before.t, before.measured, simulations)
    view = _most_different(before.t - before.t[0], before.simulated - after.simulated)
    xaxis = {**figure.layout["xaxis"], "range": list(view)}
    return replace(figure, layout={**figure.layout, "xaxis": xaxis}) if diagnosis.causes else figure


def _most_different(t: FloatArray, difference: FloatArray) -> tuple[float, float]:
    """Return the stretch in which before and after differ most, where the figure opens."""
    edges = np.searchsorted(t, np.arange(0.0, max(t[-1], 1e-9), _FIRST_VIEW))
    power = np.add.reduceat(difference**2, edges)[: max(1, len(edges) - 1)]
    start = _FIRST_VIEW * int(np.argmax(power))
    return start, start + _FIRST_VIEW


def _over_time(diagnosis: Diagnosis, channel: str) -> str:
    fits = [f[channel] for f in (diagnosis.fit_percent, diagnosis.extended_fit_percent)]
    shown = " → ".join(f"{fit:.2f} %" for fit in (fits if diagnosis.causes else fits[:1]))
    return words.sentence(f"{words.channel(channel)} over time: {shown} explained")


def _overlay(overlays: Sequence[Overlay], channel: str) -> Overlay:
    return next(o for o in overlays if o.channel == channel)
