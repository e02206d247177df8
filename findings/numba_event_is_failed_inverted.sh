#!/usr/bin/env bash
# Numba 0.61.0 and 0.68.1: the documented numba.core.event.Event.is_failed is inverted. "Is the event carrying an
# exception? This method will never return True in a START event": it is True at every start and after every success,
# and False after a compilation that failed.
# Guess before running: True after the failure only. Exits 0 while it behaves as described, 1 if that changes.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cat > "$folder/show.py" <<'P'
import sys, numba
from numba.core import event

seen = []

class Listener(event.Listener):
    def on_start(self, e): seen.append(("start", e.is_failed))
    def on_end(self, e): seen.append(("end", e.is_failed))

@numba.njit
def fine(x): return x + 1

@numba.njit
def wrong(x): return x.no_such_attribute

with event.install_listener("numba:compile", Listener()):
    fine(1)
    good = seen[:]; seen.clear()
    try: wrong(1)
    except numba.core.errors.NumbaError: pass
    bad = seen[:]
print("numba", numba.__version__, "success:", good, "failure:", bad)
sys.exit(0 if good == [("start", True), ("end", True)] and bad == [("start", True), ("end", False)] else 1)
P
for version in 0.61.0 0.68.1; do
  python3.11 -m venv "$folder/$version" 2>/dev/null || python3 -m venv "$folder/$version"
  "$folder/$version/bin/python" -m pip install --quiet "numba==$version" 2>/dev/null
  "$folder/$version/bin/python" "$folder/show.py"
done
