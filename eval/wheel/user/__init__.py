"""Scripts of somebody who has the wheel: run by the environment's interpreter, not imported."""
