"""A controlled actuator: page, tables, control.json."""
