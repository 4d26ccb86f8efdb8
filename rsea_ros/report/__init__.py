"""From results to pages, tables and files: values in, text out.

A folder for each result: check, identification, diagnosis, law, experiment, campaign, design, control,
paper, fleet. There page.py is its HTML, json.py its file for programs, words.py its sentences, terminal.py
what a verb prints, files.py what a verb writes. All use figures/ (values for plotly.js) and page/ (the
frame, HTML, tables).
"""
