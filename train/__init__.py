"""Training: PPO through any action layer, resumable to the bit."""
