"""Former names of `rpbi_data.farm.policy`."""

from rpbi_data.farm.policy import Policy as Policy
