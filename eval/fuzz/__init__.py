"""The search for inputs that break what the package promises: `python -m eval.fuzz`."""
