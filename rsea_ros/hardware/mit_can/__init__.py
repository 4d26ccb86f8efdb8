"""Motors with the MIT frame on a CAN bus, over python-can: a command is answered by a reading."""
