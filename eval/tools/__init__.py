"""Tools of this repository that no user needs: measurements, archives, its site."""
