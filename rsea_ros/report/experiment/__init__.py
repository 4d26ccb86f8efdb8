"""A designed run and a session of such runs: pages, sentences, experiment.json."""
