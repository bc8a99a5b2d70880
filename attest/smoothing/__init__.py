"""Least squares over a whole log: what is most likely of the past, given the future too."""
