"""The reference pages, from the tables that the node opens its topics and services by."""
