"""What robots do without a policy: zero actions x factor x layer -> a table."""
