"""The frame of every report: one HTML file that contains its style, its script and plotly.js."""
