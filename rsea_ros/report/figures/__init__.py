"""Figures as plain values in the terms of plotly.js, which every page draws the same way."""
