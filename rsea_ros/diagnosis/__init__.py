"""Diagnosis: the causes of a simulation's misfit, the extended model, and the gain.

Stepwise selection among the effects of the catalogue: criteria.py is the rule by which a candidate is
accepted and the verdict is given, settings/ has every number, naming/ decides which causes are named.
"""
