"""What a study came to: its learning curves, a table, and one page with all of it."""
