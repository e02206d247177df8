"""Controllers, model-based and learned, and the commands that train, evaluate and compare them.

Rooms import only from those before them: `control` (what acts), `comparison` (episodes measured), `learning` (policies
trained), `registry` (all agents by name), `commands` (the command line).
"""
