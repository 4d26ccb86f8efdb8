"""What an identification says: page, tables, sentences, terminal, identification.json."""
