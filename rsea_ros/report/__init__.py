"""From results to pages, tables and files: values in, text out.

Each result has words (sentences, JSON for programs) and a page (HTML and the files beside it), some also
figures, tables and a terminal's text. All use page/ (the builder), figures/ (values for plotly.js),
result_files (names, JSON from fields, provenance), words (names, units, numbers) and remark_words.
"""
