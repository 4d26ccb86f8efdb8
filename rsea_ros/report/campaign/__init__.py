"""A session of experiments: page, sentences, experiment.json."""
