"""Former names of `rpbi_data.farm`."""

from rpbi_data.farm import Policy as Policy
