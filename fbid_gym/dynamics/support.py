"""Support frame: the level frame of the standing feet, in which the home posture is held."""

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.quantities import ContactGeometry, DynamicsTerms, Heading, SupportFrame


def heading_of(geometry: ContactGeometry, layout: np.ndarray) -> Heading:
    """Return what finds the heading of feet that stand as in a level layout.

    Args:
        geometry: of the contacts.
        layout: (P, 2) m, the contact points from their centre, seen from above.
    """
    num_feet = len(geometry.motion)
    weight = np.bincount(geometry.foot_of_point, minlength=num_feet) / len(layout)
    # cos: sum_i layout_i . d_i; sin: sum_i layout_i × d_i, with d_i the point from the centre,
    # d_i = foot position + foot rotation @ offset_i - centre.
    turned = np.stack([-layout[:, 1], layout[:, 0]], axis=1)
    by_position, by_rotation = np.zeros((num_feet, 3, 2)), np.zeros((num_feet, 3, 3, 2))
    for foot, offset, *pairs in zip(
        geometry.foot_of_point, geometry.offset, layout, turned, strict=True
    ):
        for column, pair in enumerate(pairs):
            by_position[foot, :2, column] += pair
            by_rotation[foot, :2, :, column] += pair[:, None] * offset
    return Heading(weight, by_position.reshape(-1, 2), by_rotation.reshape(-1, 2))


@kernel
def support_frame(heading: Heading, terms: DynamicsTerms) -> SupportFrame:
    """Return the level frame of the feet of N robots."""
    count = len(terms.foot_position)
    frame = SupportFrame(np.zeros((count, 3)), np.zeros((count, 3, 3)))
    _find(heading, terms, frame)
    return frame


@compiled
def _find(heading: Heading, terms: DynamicsTerms, frame: SupportFrame) -> None:
    """Write frames into zeros."""
    centre, rotation = frame.centre, frame.world_from_support
    count, feet = terms.foot_position.shape[:2]
    for i in range(count):
        # A layout with no extent (one point) has no heading of its own: keep the world's.
        cosine, sine = 1e-12, 0.0
        for foot in range(feet):
            for axis in range(3):
                place = terms.foot_position[i, foot, axis]
                column = 3 * foot + axis
                centre[i, axis] += heading.weight[foot] * place
                cosine += place * heading.by_position[column, 0]
                sine += place * heading.by_position[column, 1]
                for along in range(3):
                    entry, row = terms.world_from_foot[i, foot, axis, along], 3 * column + along
                    cosine += entry * heading.by_rotation[row, 0]
                    sine += entry * heading.by_rotation[row, 1]
        size = np.sqrt(cosine**2 + sine**2)
        cosine, sine = cosine / size, sine / size
        rotation[i, 0, 0] = rotation[i, 1, 1] = cosine
        rotation[i, 0, 1], rotation[i, 1, 0] = -sine, sine
        rotation[i, 2, 2] = 1.0
