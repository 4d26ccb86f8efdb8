"""An identification as page, tables, sentences, terminal output and identification.json."""
