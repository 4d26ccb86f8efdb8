"""The course of a fleet's joints over months: fleet_trends.py is the entry, alarms.py has the findings."""

from rsea_ros.trends.alarms import Alarm, alarms, alarms_of
from rsea_ros.trends.fleet_trends import fleet_trends
from rsea_ros.trends.result import FleetTrends
from rsea_ros.trends.series import TrendSettings

__all__ = ["Alarm", "FleetTrends", "TrendSettings", "alarms", "alarms_of", "fleet_trends"]
