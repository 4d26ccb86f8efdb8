"""Health of a joint at work: changes against its model, with size, date and probability."""
