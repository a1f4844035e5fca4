"""Training runs: the folder of a run, differences of runs, and running several at once.

`folder` says where things lie in a run folder, `opening` writes what a run is, `tables` its curve,
`reading` reads them, `differences` compares runs, `jobs` runs programs side by side. Nothing here
needs the learner, so whoever only reads runs does not wait for torch.
"""
