"""Wheel and source archive, used as somebody would who has only these: `make dist`.

The tests below run in a fresh environment of PYTHON (any of 3.11 or newer) in a temporary folder
outside the checkout, which holds the wheel and what it needs in the versions of constraints.txt.
They compile: that takes some minutes.
"""

import os
import subprocess
import sys
import tarfile
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Root is not held to the modes of files unless it gives these powers up.
AS_ANYBODY = ("setpriv", "--bounding-set=-dac_override,-dac_read_search", "--")

MAKES = """
import sys
import gymnasium as gym
import fbid_gym

ours = [name for name in gym.registry if name.startswith("fbid_gym/")]
assert len(ours) > 10, fbid_gym.__path__
for name in sys.argv[1:] or ours:
    env = gym.make(name)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    envs = gym.make_vec(name, num_envs=2, num_threads=2)
    envs.reset(seed=0)
    envs.step(envs.action_space.sample())
    envs.close()
"""
PLAYS = """
import sys
import gymnasium as gym
from fbid_gym.policy import Policy, shipped

for name in [f"shipped:{each.name}" for each in shipped()]:
    policy = Policy.load(name)
    env = gym.make(policy.env_id, **policy.env_args)
    observation, info = env.reset(seed=0)
    for _ in range(50):
        observation, *outcome = env.step(policy(observation[None])[0])
        assert outcome[1] is False, name + " fell"
assert not {"torch", "stable_baselines3"} & sys.modules.keys()
"""
NEEDS_SB3 = """
import fbid_gym

try:
    fbid_gym.make_sb3("fbid_gym/BipedBalance-v0")
except fbid_gym.FbidError as error:
    assert "pip install 'fbid_gym[train]'" in str(error), error
else:
    raise AssertionError("stable-baselines3 is there")
"""
# An ignored error that a checker did not find is one itself: so it has seen the types.
TYPED = """
import fbid_gym
from fbid_gym.robots import Robot, load

robot: Robot = load("biped")
weight: float = robot.weight
words: str = robot.weight  # type: ignore[assignment]
error: type[Exception] = fbid_gym.FbidError
"""


def call(*command: str | Path, cwd: str | Path = ROOT, env: dict[str, str] | None = None) -> str:
    """Run a command and return what it printed; it has to succeed."""
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True)
    assert done.returncode == 0, f"{command}: {(done.stdout + done.stderr)[-1500:]}"
    return done.stdout


class User:
    """Somebody with an environment that has the wheel and nothing of the checkout."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        """Make the environment and install the wheel."""
        self.folder, self.home, self.environment = folder, folder / "home", folder / "environment"
        self.home.mkdir()
        call(os.environ.get("PYTHON", sys.executable), "-m", "venv", self.environment, cwd=folder)
        self.interpreter = self.environment / "bin" / "python"
        pinned = ("--constraint", ROOT / "constraints.txt")
        self.pip("install", "--quiet", *pinned, wheel)
        self.package = Path(self.run("-c", "import fbid_gym; print(fbid_gym.__path__[0])").strip())

    def pip(self, *words: str | Path) -> str:
        """Run the environment's pip."""
        pip = (self.interpreter, "-m", "pip", "--disable-pip-version-check")
        return call(*pip, *words, cwd=self.folder)

    def run(self, *words: str | Path, cwd: str | Path = "/", as_anybody: bool = False) -> str:
        """Run the environment's interpreter, held to the modes of files if that is asked for."""
        keeps = ("PATH", "MUJOCO_GL", "OMP_NUM_THREADS", "LANG")
        own = {name: os.environ[name] for name in keeps if name in os.environ}
        prefix = AS_ANYBODY if as_anybody and os.geteuid() == 0 else ()
        env = own | {"HOME": str(self.home)}
        return call(*prefix, self.interpreter, "-I", *words, cwd=cwd, env=env)


@pytest.fixture(scope="session")
def wheel() -> Path:
    """The wheel that was built."""
    (found,) = (ROOT / "dist").glob("fbid_gym-*.whl")
    return found


@pytest.fixture(scope="session")
def user(tmp_path_factory: pytest.TempPathFactory, wheel: Path) -> User:
    """Return a user who has it."""
    return User(tmp_path_factory.mktemp("user"), wheel)


def test_the_wheel_holds_the_library_robots_policies_programs_and_nothing_else(wheel: Path) -> None:
    """And the licence."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (licence,) = (archive.read(name) for name in names if name.endswith("/LICENSE"))
    tracked = call("git", "ls-files", "fbid_gym", "assets", "train", "eval").split()
    places = {"fbid_gym": "", "assets": "fbid_gym/"}
    expected = {
        places.get(name.partition("/")[0], "fbid_gym_programs/") + name
        for name in tracked
        if not name.startswith("eval/tools/")
    }
    assert {name for name in names if ".dist-info/" not in name} == expected
    assert "fbid_gym/py.typed" in names and licence == (ROOT / "LICENSE").read_bytes()


def test_the_source_archive_holds_all_that_a_checkout_works_with() -> None:
    """But for what only git and the machine that checks changes need."""
    (sdist,) = (ROOT / "dist").glob("fbid_gym-*.tar.gz")
    with tarfile.open(sdist) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    tracked = {name for name in call("git", "ls-files").splitlines() if not name.startswith(".")}
    assert tracked - held == set()


def test_it_installs_with_what_it_needs_without_torch_and_scripts(user: User) -> None:
    """Neither train nor eval is there."""
    user.pip("check")
    assert "torch==" not in user.pip("list", "--format=freeze").lower()
    assert user.package.is_relative_to(user.environment)
    for name in ("train", "eval"):
        found = user.run("-c", f"import importlib.util as u; print(u.find_spec({name!r}))")
        assert found == "None\n"


def test_import_waits_for_no_learner_and_make_sb3_names_the_extra(user: User) -> None:
    """There is none in the environment."""
    user.run("-c", NEEDS_SB3)


def test_every_environment_is_made_and_steps_from_any_folder(user: User) -> None:
    """Nothing is left in the folder."""
    user.run("-c", MAKES)
    empty = user.folder / "empty"
    empty.mkdir()
    user.run("-c", MAKES, "fbid_gym/BipedBalance-v0", cwd=empty)
    assert not list(empty.iterdir())


def test_environments_are_made_where_nothing_can_be_written(user: User) -> None:
    """Neither the installation nor the home folder."""
    with _locked(user.environment), _locked(user.home):
        for folder in (user.package, user.home):
            with pytest.raises(AssertionError, match="denied"):  # or nothing would be shown
                user.run("-c", f"open({str(folder / 'probe')!r}, 'w')", as_anybody=True)
        user.run("-c", MAKES, "fbid_gym/BipedBalance-v0", as_anybody=True)


def test_every_shipped_policy_plays(user: User) -> None:
    """Without torch or stable-baselines3."""
    user.run("-c", PLAYS)


def test_a_type_checker_sees_the_types(user: User) -> None:
    """Outside the checkout: beside a script it looks for the packages of its folders."""
    script = user.folder / "typed.py"
    script.write_text(TYPED)
    user.run(script)
    checker = (sys.executable, "-m", "mypy", "--strict", "--config-file=", "--cache-dir=/dev/null")
    call(*checker, "--python-executable", user.interpreter, script, cwd=user.folder)


def test_the_commands_of_the_package_work(user: User) -> None:
    """The page of the arguments, and a picture of a robot."""
    assert "# Arguments" in user.run("-m", "fbid_gym.envs")
    picture = user.folder / "biped.png"
    assert "biped" in user.run("-m", "fbid_gym.robots", "biped", "--picture", picture)
    assert picture.is_file()


def test_commands_name_the_extra_that_is_missing(user: User) -> None:
    """From any folder; what needs none works."""
    command = user.environment / "bin" / "fbid-gym"
    assert "QuadrupedWalk-v0" in call(command, "policies", cwd="/")
    assert "usage: fbid-gym robots" in call(command, "robots", "--help", cwd="/")
    for name, extra in (("play", "play"), ("train", "train"), ("benchmark", "train")):
        done = subprocess.run([command, name], cwd="/", capture_output=True, text=True)
        assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
        assert f"pip install 'fbid_gym[{extra}]'" in done.stderr


@pytest.mark.parametrize("runner", ["uvx", "pipx"])
def test_one_line_shows_a_robot_that_walks(runner: str, user: User, wheel: Path) -> None:
    """From nothing, in an environment that the runner makes; prints what each part took."""
    began, spec = time.monotonic(), f"{wheel}[play]"
    uvx, pinned = Path(sys.executable).with_name("uvx"), ROOT / "constraints.txt"
    line: list[str | Path] = [uvx, "--constraints", pinned, "--from", spec, "fbid-gym"]
    if runner == "pipx":
        pip = f"--pip-args=--constraint {pinned}"
        line = [uvx, "pipx", "run", f"--python={sys.executable}", pip, "--spec", spec, "fbid-gym"]
    folder = user.folder / runner
    folder.mkdir()
    own = {"HOME": str(folder), "UV_CACHE_DIR": str(folder / "cache")}
    env = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"} | own
    assert "QuadrupedWalk-v0" in call(*line, "policies", cwd="/", env=env)
    installed = time.monotonic()
    told = call(*line, "play", "--port=0", "--measure=20", cwd="/", env=env)
    walked = float(told.partition("frames/s, ")[2].split()[0])  # s of the robots per s
    assert walked > 0.2, told
    spent = time.monotonic() - installed - 22.0  # measured for 20, begun 2 before
    print(f"{runner}: installed in {installed - began:.0f} s, walks after {spent:.0f} s more")
    assert not (folder / "runs").exists()


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
