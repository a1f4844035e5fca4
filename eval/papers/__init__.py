"""The papers' experiments, run here and shown beside what the papers report: `make papers`."""
