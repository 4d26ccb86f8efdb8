"""From records to parameters with their confidence, and to those that the data cannot determine."""
