"""Robots in a physics engine that is not MuJoCo: who walks there as well?"""
