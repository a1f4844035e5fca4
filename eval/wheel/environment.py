"""What a user of the wheel does, in an environment that has nothing but it and what it needs."""

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import gymnasium as gym
import numpy as np

from eval.wheel.place import ROOT, Check, Place, call, expect
from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy

_SCRIPTS = Path(__file__).parent / "user"
_EXTRAS = "import sys, fbid_gym; print({'torch', 'stable_baselines3'} & sys.modules.keys() or '')"


def check_installs(place: Place) -> None:
    """The wheel installs, with all it needs and without torch."""
    place.home.mkdir(exist_ok=True)
    call([place.python, "-m", "venv", str(place.environment)], place.folder)
    pip = [str(place.interpreter), "-m", "pip", "--disable-pip-version-check"]
    pinned = ["--constraint", str(ROOT / "constraints.txt")]
    call([*pip, "install", "--quiet", *pinned, str(place.wheel)], place.folder)
    call([*pip, "check"], place.folder)
    listed = call([*pip, "list", "--format=freeze"], place.folder).lower()
    expect("torch==" not in listed, "the wheel's own dependencies bring torch")
    expect(place.package.is_relative_to(place.environment), f"it is imported from {place.package}")


def check_import(place: Place) -> None:
    """Importing the package waits for no learner."""
    loaded = place.run("-c", _EXTRAS).strip()
    expect(not loaded, f"import fbid_gym loads {loaded}")


def check_scripts_stay(place: Place) -> None:
    """Neither train nor eval is installed."""
    found = place.run("-c", "import importlib.util as u; print(u.find_spec('train'))")
    found += place.run("-c", "import importlib.util as u; print(u.find_spec('eval'))")
    expect(found.split() == ["None", "None"], f"train or eval is installed: {found}")


def check_makes(place: Place) -> None:
    """Every environment is made and steps, from the root folder and from an empty one."""
    place.run(_SCRIPTS / "makes.py")
    empty = place.folder / "empty"
    empty.mkdir(exist_ok=True)
    place.run(_SCRIPTS / "makes.py", "fbid_gym/BipedBalance-v0", cwd=empty)
    left = [path.name for path in empty.iterdir()]
    expect(not left, f"it leaves {left} where it is used")


def check_read_only(place: Place) -> None:
    """Environments are made where neither the installation nor the home folder can be written."""
    with _locked(place.environment), _locked(place.home):
        for folder in (place.package, place.home):
            try:
                place.run("-c", f"open({str(folder / 'probe')!r}, 'w')", as_anybody=True)
            except FbidError:
                continue
            raise FbidError(f"{folder} can be written although its mode says no: nothing is shown")
        place.run(_SCRIPTS / "makes.py", "fbid_gym/BipedBalance-v0", as_anybody=True)


def check_without_sb3(place: Place) -> None:
    """`make_sb3` names the extra to install."""
    place.run(_SCRIPTS / "without_sb3.py")


def check_plays(place: Place) -> None:
    """Each shipped policy plays in ten lines; one made for the purpose where none is shipped."""
    policies = sorted((place.package / "assets").rglob("policy.json"))
    folders = [path.parent for path in policies] or [_zero_policy(place.folder / "zero")]
    for folder in folders:
        place.run(_SCRIPTS / "plays.py", folder)


def check_typed(place: Place) -> None:
    """A strict type checker sees the types of the installed package."""
    # Outside the checkout: beside a script the checker looks for the packages of its folders.
    script = Path(shutil.copy(_SCRIPTS / "typed.py", place.folder))
    place.run(script)
    checker = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--cache-dir=/dev/null"]
    call([*checker, "--python-executable", str(place.interpreter), str(script)], place.folder)


def check_commands(place: Place) -> None:
    """What the package's own commands print."""
    expect("# Arguments" in place.run("-m", "fbid_gym.envs"), "fbid_gym.envs prints no page")
    picture = place.folder / "biped.png"
    said = place.run("-m", "fbid_gym.robots", "biped", "--picture", picture)
    expect("biped" in said and picture.is_file(), "fbid_gym.robots shows no biped")


def _zero_policy(folder: Path) -> Path:
    """Write a policy that does nothing and stands."""
    env_id, layer = "fbid_gym/BipedBalance-v0", "base_acceleration"
    env = gym.make(env_id, action_layer=layer)
    (seen,), (acts,) = env.observation_space.shape or (0,), env.action_space.shape or (0,)
    env.close()
    policy = Policy(
        env_id=env_id,
        env_args={"action_layer": layer},
        mean=np.zeros(seen),
        variance=np.ones(seen),
        weights=(np.zeros((acts, seen), np.float32),),
        biases=(np.zeros(acts, np.float32),),
    )
    policy.save(folder)
    return folder


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Let nobody write in a folder for a while."""
    modes = {p: p.stat().st_mode for p in (folder, *folder.rglob("*")) if not p.is_symlink()}
    try:
        for path, mode in modes.items():
            path.chmod(mode & ~0o222)
        yield
    finally:
        for path, mode in modes.items():
            path.chmod(mode)


CHECKS = (
    Check("it installs, with what it needs and without torch", check_installs),
    Check("train/ and eval/ are not installed", check_scripts_stay),
    Check("import fbid_gym loads neither torch nor stable-baselines3", check_import),
    Check("make_sb3 without stable-baselines3 names the extra", check_without_sb3),
    Check("every environment is made and steps, from any folder", check_makes),
    Check("so where neither installation nor home can be written", check_read_only),
    Check("a policy plays in ten lines, without torch or stable-baselines3", check_plays),
    Check("a typed script passes mypy --strict", check_typed),
    Check("the commands of the package work", check_commands),
)
