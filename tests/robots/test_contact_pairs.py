import mujoco
import numpy as np
import pytest

from fbid_gym.robots import ROBOTS, load
from fbid_gym.robots.contact_pairs import compile_paired
from fbid_gym.robots.terrain import make_terrain, world_of
from fbid_gym.robots.undrawn import undrawn
from tests.postures import fallen

_WORLD = """
<mujoco>
  <default><geom friction="0.7 0.02 0.003" solref="0.01 0.9"/></default>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 1" friction="0.9 0.01 0.001" {ground}/>
    {beside}
    <body name="base" pos="0 0 0.3">
      <freejoint/>
      <geom type="box" size="0.2 0.1 0.05" condim="4" solimp="0.8 0.9 0.002 0.4 1"/>
      <geom type="sphere" size="0.04" pos="0.3 0 -0.2" solmix="3" {sphere}/>
      <body pos="-0.2 0 -0.05">
        <joint name="hip" axis="0 1 0"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.2" priority="1" condim="6"/>
      </body>
    </body>
  </worldbody>
  {extra}
</mujoco>
"""
_OWN = 'contype="0"'
_NO_SELF = {"ground": 'contype="1" conaffinity="1"', "beside": "", "sphere": _OWN, "extra": ""}


def _spec(**parts: str) -> mujoco.MjSpec:
    text = _WORLD.format(**{**_NO_SELF, **parts})
    spec = mujoco.MjSpec.from_string(text)
    for geom in spec.geoms:
        if geom.name != "ground" and geom.parent.name != "world" and "self" not in parts:
            geom.contype = 0
    return spec


def _contacts(model: mujoco.MjModel, qpos: np.ndarray) -> dict[tuple[str, str], list[np.ndarray]]:
    """What touches, by the types of the geoms, and how."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    found: dict[tuple[str, str], list[np.ndarray]] = {}
    for contact in data.contact:
        kinds = tuple(str(model.geom_type[geom]) for geom in contact.geom)
        numbers = (contact.dist, *contact.pos, *contact.frame, contact.dim, *contact.friction)
        given = (*contact.solref, *contact.solimp, *contact.solreffriction, contact.includemargin)
        found.setdefault(kinds, []).append(np.array([*numbers, *given]))
    return found


def test_contacts_are_those_that_mujoco_finds(rng: np.random.Generator) -> None:
    """With mixed frictions, dimensions, priorities and solver parameters."""
    searched, paired = _spec().compile(), compile_paired(_spec())
    assert (searched.npair, paired.npair) == (0, 3)
    assert not (paired.geom_contype.any() or paired.geom_conaffinity.any())
    met = set()
    for _ in range(50):
        qpos = rng.normal(size=searched.nq)
        qpos[2] = 0.1  # something is in the ground
        qpos[3:7] /= np.linalg.norm(qpos[3:7])
        ours, theirs = _contacts(paired, qpos), _contacts(searched, qpos)
        assert ours.keys() == theirs.keys()
        met |= ours.keys()
        for kinds in ours:
            np.testing.assert_allclose(ours[kinds], theirs[kinds], rtol=1e-12, atol=1e-12)
    assert len(met) == 3


@pytest.mark.parametrize("name", ROBOTS)
def test_robots_on_a_plane_move_as_where_contacts_are_searched(name: str) -> None:
    robot = undrawn(load(name))
    models = robot.spec.copy().compile(), compile_paired(robot.spec.copy())
    assert models[1].npair > robot.num_feet
    pull = 0.2 * np.sign(np.arange(robot.model.nu) % 3 - 0.5)
    paths = [fallen(model, robot, pull, 600) for model in models]  # until it lies
    assert np.abs(paths[0][-1] - paths[0][0]).max() > 0.1
    np.testing.assert_array_equal(paths[1], paths[0])


_BESIDE = {
    "a box on the ground": {"beside": '<geom type="box" size="0.1 0.1 0.1" pos="3 0 0"/>'},
    "parts that touch each other": {"self": ""},
    "a margin": {"sphere": 'contype="0" margin="0.01"'},
    "a pair of the file's own": {
        "extra": '<contact><pair geom1="ground" geom2="ground2"/></contact>',
        "beside": '<body><freejoint/><geom name="ground2" size="0.1"/></body>',
    },
    "an exclusion": {"extra": '<contact><exclude body1="world" body2="base"/></contact>'},
    "a geom that nothing meets": {"sphere": 'contype="2" conaffinity="2"'},
}


@pytest.mark.parametrize("what", _BESIDE)
def test_other_worlds_stay_as_they_are(what: str) -> None:
    parts = _BESIDE[what]
    searched, left = _spec(**parts).compile(), compile_paired(_spec(**parts))
    for field in ("npair", "geom_contype", "geom_conaffinity"):
        np.testing.assert_array_equal(getattr(left, field), getattr(searched, field))


@pytest.mark.parametrize("kind", ["rocks", "obstacles", "stairs"])
def test_rough_ground_is_searched(kind: str) -> None:
    robot = undrawn(load("go1"))
    world = world_of(robot, make_terrain(kind, robot))
    assert compile_paired(world).npair == 0
