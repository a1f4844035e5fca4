"""Robots: model, feet and their contact points, limits, home pose."""

from fbid_gym.robots.built_in import ROBOTS, load
from fbid_gym.robots.feet import Foot
from fbid_gym.robots.robot import Robot
from fbid_gym.robots.several import several
from fbid_gym.robots.source import MENAGERIE
from fbid_gym.robots.zoo import ZOO

__all__ = ["MENAGERIE", "ROBOTS", "ZOO", "Foot", "Robot", "load", "several"]
