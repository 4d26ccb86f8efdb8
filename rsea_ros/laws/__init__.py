"""Laws outside the catalogue: the missing torque of a model, its dependences, an effect file of it."""
