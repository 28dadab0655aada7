"""Bags as pandas tables: `bag_to_dataframe` from `rpbi_utils`. That package also makes a table for each topic."""

from rpbi_data import bag_to_dataframe as bag_to_dataframe
