"""Gaits: desired feet and body at every control tick, from clock, command and state."""
