"""Gaits: at every control tick, from clock, command and state, what the feet and the body do."""
