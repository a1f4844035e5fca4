"""How policies stand what they were not trained for: `python -m eval.robustness`."""
