"""Reads bags as pandas tables, with `bag_to_dataframe` from `rpbi_data`; see also `rpbi_data.bag_to_dataframes`."""

from rpbi_data import bag_to_dataframe as bag_to_dataframe
