"""A law that no effect covers: page, sentences, law.json."""
