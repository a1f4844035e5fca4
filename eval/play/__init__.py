"""A live page on which a robot walks or stands in real time, is pushed, and changes its layer.

`session` is the play without a viewer: robots that step, and requests that are checked, queued and
applied between steps. `page` shows it in the browser and turns what a viewer does into requests.
"""
