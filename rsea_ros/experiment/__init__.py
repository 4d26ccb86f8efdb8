"""Design of experiments: the run that separates the remaining causes, within a bench's limits.

joint_weighing.py holds causes against all records, run_design.py finds the next run, advice.py proves where
none would help, campaign.py goes round until one cause is left. Nothing here plays a run: nodes and verbs do.
"""
