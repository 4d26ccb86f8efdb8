"""Figures as plain values for plotly.js, drawn the same way by every page."""
