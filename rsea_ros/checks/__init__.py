"""Checks of a record before any physics is fitted to it; the entry is check_record in check.py."""
