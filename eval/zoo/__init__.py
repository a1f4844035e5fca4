"""Robots that nobody has seen, drawn from seeds, and how they do without a policy."""
