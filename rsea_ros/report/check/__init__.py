"""What a check says of a record: on a terminal and for programs."""
