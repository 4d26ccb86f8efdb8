"""Pages of a fleet over months: one for the fleet, one for each joint."""
