"""The joints of a fleet of which one wears; their names need escaping."""

JOINTS = ("hip", "knee <left>", "ankle/1", "elbow")
WORN = "knee <left>"
