"""Rollouts of trained policies, statistics over seeds, and the report that compares layers."""
