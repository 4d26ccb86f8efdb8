"""From results to pages, tables and files: values in, text out.

A file for each result holds its sentences, its JSON for programs and its page (HTML and the files beside it).
All use page/ (the builder), figures/ (values for plotly.js), result_files (names, JSON from fields,
provenance), words (names, units, numbers) and remark_words.
"""
