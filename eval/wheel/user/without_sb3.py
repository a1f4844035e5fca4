"""Ask for what stable-baselines3 would be needed for."""

import fbid_gym

try:
    fbid_gym.make_sb3("fbid_gym/BipedBalance-v0")
except fbid_gym.FbidError as error:
    assert "pip install 'fbid_gym[train]'" in str(error), error
else:
    raise AssertionError("stable-baselines3 is there")
