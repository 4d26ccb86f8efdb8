"""Naming causes: evidence, rivals, probability, status. The door is conclusion.py."""
