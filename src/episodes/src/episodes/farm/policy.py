"""Former name of the module `rpbi_data.farm.policy`, kept for existing imports."""

from rpbi_data.farm.policy import Policy as Policy
