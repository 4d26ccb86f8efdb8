"""Targets of `rsea export` beyond MJCF, one a file."""
