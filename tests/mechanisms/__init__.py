"""Models that tests share, so that a test shows its physics and not how its parts are connected.

rows.py      row(...): the connections of components one behind the other; in_a_row(...): a model of nothing else
axes.py      ALONG and ABOUT: translational and rotational components by one set of names
"""
