"""Function that reads a bag as a pandas table. It is imported from `rpbi_data`."""

from rpbi_data import bag_to_dataframe as bag_to_dataframe
