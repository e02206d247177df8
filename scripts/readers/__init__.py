"""Programs that read MJCF, each asked by a probe of its own: `python PROBE.py SINGLE.xml COUPLED.xml` prints JSON.

SINGLE has motors that turn one joint each, with ratios, COUPLED has motors that turn both joints of a caster. A probe
runs in an environment of its reader alone, so it imports nothing of caster_gym, and answers `FACTS` of facts.py.
"""
