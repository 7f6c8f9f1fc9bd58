"""Are data fit to be used? Tests before a fit, and what can be determined from such data."""
