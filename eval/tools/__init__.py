"""What this repository is kept with, and no user needs: measurements, archives, its site."""
