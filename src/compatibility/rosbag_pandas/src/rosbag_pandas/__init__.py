"""Bags as pandas tables: `bag_to_dataframe` of `rpbi_utils`, which has more, such as a table for each topic."""

from rpbi_data import bag_to_dataframe as bag_to_dataframe
