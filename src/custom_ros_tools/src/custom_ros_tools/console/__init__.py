"""Commands of `./rpbi` as Python functions; their help, page and completion follow from signature and docstring."""
