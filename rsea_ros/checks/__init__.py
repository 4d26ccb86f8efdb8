"""What a record is worth before any physics is fitted to it: check_record in check.py is the door."""
