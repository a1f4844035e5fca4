"""M. Mistry, J. Buchli, S. Schaal, ICRA 2010: the figures, the claims, the rivals of its law."""
