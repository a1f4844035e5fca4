"""Results of a study: its learning curves, a table, and one page with all of it."""
