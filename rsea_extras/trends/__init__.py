"""The course of a fleet's joints over months: fleet_trends.py is the entry, alarms.py has the findings."""

from rsea_extras.trends.alarms import alarms, alarms_of
from rsea_extras.trends.fleet_trends import fleet_trends
from rsea_extras.trends.result import Alarm, FleetTrends
from rsea_extras.trends.series import TrendSettings

__all__ = ["Alarm", "FleetTrends", "TrendSettings", "alarms", "alarms_of", "fleet_trends"]
