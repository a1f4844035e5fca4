"""Robustness of policies to conditions outside their training: `python -m eval.robustness`."""
