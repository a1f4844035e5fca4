"""Training runs: the folder of a run, what makes two runs different, and running several at once.

A run folder holds

    config.json        the resolved configuration                    once, and when a resume changes it
    versions.json      Python, packages, commit, platform            once
    environment.json   what the environment's arguments meant        once, of our own environments
    progress.csv       one row per iteration                         `tables`
    evaluations.csv    one row per evaluation                        `tables`
    checkpoint/        the latest exact state                        a bundle, see `fbid_gym.bundles`
    policy/            the policy of the latest evaluation           a bundle, see `fbid_gym.policy`
    policy_best/       the policy of the best evaluation             a bundle
    tensorboard/       events                                        by TensorBoard

Names are in `folder` alone. `opening` writes, `reading` reads, `differences` compares. Nothing here
needs the learner, so whoever only reads runs does not wait for torch.
"""
