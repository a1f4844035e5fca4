"""Motions: desired joints, base and feet over time."""

from fbid_gym.motions.crawl import Crawl, CrawlGait, crawl, gait_for
from fbid_gym.motions.squat import periodic_squat, squat_bow, squat_depth
from fbid_gym.motions.stepping import Steps, stepping, steps_for
from fbid_gym.motions.table import MotionTable
from fbid_gym.motions.target import home_target, in_world

__all__ = [
    "Crawl",
    "CrawlGait",
    "MotionTable",
    "Steps",
    "crawl",
    "gait_for",
    "home_target",
    "in_world",
    "periodic_squat",
    "squat_bow",
    "squat_depth",
    "stepping",
    "steps_for",
]
