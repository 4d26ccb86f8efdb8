"""The law of what no effect explains: page, sentences, law.json."""
