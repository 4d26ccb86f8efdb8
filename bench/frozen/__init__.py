"""What the diagnosis says of every record, frozen, and what each of its special branches decides."""
