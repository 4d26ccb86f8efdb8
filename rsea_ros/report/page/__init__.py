"""The frame of every report: one HTML file with its style, its script and plotly.js in it."""
