"""A designed run: page, sentences, experiment.json."""
