"""What a diagnosis says: page, figures, sentences, terminal, diagnosis.json."""
