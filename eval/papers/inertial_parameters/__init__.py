"""Inertial parameters from motion data, without contact forces.

`estimation` says how, `excitation` what a motion can tell; both stand on the ten parameters of each
body (`inertia`), the equations of motion that are linear in them (`regressor`), and the fit that
keeps to bodies that can exist (`entropic_fit`).
"""
