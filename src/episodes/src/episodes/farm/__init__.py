"""Former name of the package `rpbi_data.farm`, kept for existing imports."""

from rpbi_data.farm import Policy as Policy
