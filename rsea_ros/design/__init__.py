"""The paper's design method (section 4): from torque, bandwidth and inertia to a spring."""
