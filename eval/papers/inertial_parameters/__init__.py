"""Inertial parameters from motion data, without contact forces.

`estimation` says how, `excitation` what a motion can tell; both stand on the ten parameters of each
body (`inertia`), the equations of motion that are linear in them (`regressor`), and the fit that
keeps to bodies that can exist (`entropic_fit`).
"""

from eval.papers.inertial_parameters.estimation import (
    Identification,
    Regression,
    Samples,
    estimate,
    free_motions,
    projected_equations,
    regression,
)
from eval.papers.inertial_parameters.excitation import RESOLUTION, by_steps, natural_steps
from eval.papers.inertial_parameters.inertia import (
    PARAMETERS,
    body_parameters,
    consistency,
    parameters_of_pseudo_inertia,
    pseudo_inertia,
    with_parameters,
)
from eval.papers.inertial_parameters.regressor import InertialRegressor

__all__ = [
    "PARAMETERS",
    "RESOLUTION",
    "Identification",
    "InertialRegressor",
    "Regression",
    "Samples",
    "body_parameters",
    "by_steps",
    "consistency",
    "estimate",
    "free_motions",
    "natural_steps",
    "parameters_of_pseudo_inertia",
    "projected_equations",
    "pseudo_inertia",
    "regression",
    "with_parameters",
]
