"""Garofalo, Henze, Englsberger, Ott 2015: three balancers of a humanoid that is hit, section 5.

Beside them stand the decoupled equations of motion of section 3, which the tests check.
"""
