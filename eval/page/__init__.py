"""The kit that every report is made of: figures, templates, style."""
