"""What a simulation gets wrong, why, the extended model, and the gain.

Stepwise selection among the effects of the catalogue: criteria.py is the rule by which a candidate is
accepted and the verdict is given, settings/ has every number of it, naming/ says what causes may be called.
"""
