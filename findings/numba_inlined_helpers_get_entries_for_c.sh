#!/usr/bin/env bash
# Numba 0.68.1 builds, optimises and emits an entry for C for every function of numba.extending.register_jitable, though
# compiled code alone can call it, and even where forceinline leaves nothing of it. Entries for Python it leaves out.
# The option no_cfunc_wrapper, which its documentation does not name, leaves these out too: in a program of 450 small
# inlined functions that saved a sixth of the time of compiling.
# Guess before running: one entry, that of the function which Python calls.
# Seen: "21 entries for C for 1 function that Python calls and 20 that are inlined; 1 with no_cfunc_wrapper".
# Exits 1 if that changes.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip install --quiet "numba==0.68.1" "numpy==2.4.6" 2>/dev/null
cat > "$folder/show.py" <<'P'
import sys
from numba import njit
from numba.core.lowering import Lower
from numba.extending import register_jitable

made, build_entry = [], Lower.create_cfunc_wrapper
Lower.create_cfunc_wrapper = lambda lower: (made.append(lower.func_ir.func_id.func_name), build_entry(lower))[1]


def entries(**options):
    made.clear()
    names = {"inlined": register_jitable(forceinline=True, **options)}
    exec("@inlined\ndef f0(x):\n    return x + 1.0", names)
    for i in range(1, 20):
        exec(f"@inlined\ndef f{i}(x):\n    return f{i - 1}(x) + 1.0", names)
    exec("def outer(x):\n    return f19(x)", names)
    assert njit(names["outer"])(0.0) == 20.0
    return len(made)


usual, told = entries(), entries(no_cfunc_wrapper=True)
print(f"{usual} entries for C for 1 function that Python calls and 20 that are inlined; {told} with no_cfunc_wrapper")
sys.exit(0 if (usual, told) == (21, 1) else 1)
P
"$folder/venv/bin/python" "$folder/show.py"
