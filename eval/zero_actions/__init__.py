"""Robots without a policy: a table of zero actions x factor x layer."""
