"""M. Mistry, J. Buchli, S. Schaal, ICRA 2010: the figures and the claims of the evaluation."""
