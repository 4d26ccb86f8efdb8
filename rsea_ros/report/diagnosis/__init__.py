"""A diagnosis as page, figures, sentences, terminal output and diagnosis.json."""
