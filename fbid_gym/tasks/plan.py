"""All that chance decides about an episode."""

import numpy as np

Plan = dict[str, np.ndarray]
"""All that chance decided about the episodes of N robots, one row each: see `Task.draw`."""
