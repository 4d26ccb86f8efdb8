"""Errors of a fleet as a whole; an error in one bag is a row of the store."""

from __future__ import annotations

from rsea_ros.errors import FieldError, RseaError


class FleetError(RseaError, ValueError):
    """A source, a store or a cluster that cannot be used."""


class JointMapError(FieldError):
    """A joint map with a missing, unknown or impossible value."""
