"""Garofalo, Henze, Englsberger, Ott 2015, section 5: three balancers of a humanoid that is hit."""
