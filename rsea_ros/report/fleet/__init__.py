"""Pages of a fleet over months: one for the fleet, one for each joint."""

from rsea_ros.report.fleet.files import write_fleet_report

__all__ = ["write_fleet_report"]
