"""From records to parameters with their confidence, and what the data cannot determine."""
