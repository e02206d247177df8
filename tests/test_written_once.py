"""What the package says once: equations, outside of the engines, and functions."""

import ast
from collections import defaultdict
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "caster_gym"
ENGINES = ("engines/native", "engines/tensor", "envs/native", "envs/tensor")
SMALL = 16  # nodes of a syntax tree, below which two functions may well be equal
_TIMES = "seconds of control periods"
_SHARES = "shares of a control period that its steps take, times what happened in them"
_DRAWS = "starts drawn from uniform numbers"
# Functions of the engines that multiply or divide numbers that are no counts, and why
ARITHMETIC = {
    "_described": "seconds that compiling takes",
    "check_memory": "bytes",
    "_moved": "rows of tensors for `integration.runge_kutta`",
    "surface_below": "times 0, for a tensor of the precision of the states",
    **dict.fromkeys(("__init__", "scene", "move_to"), _TIMES),
    **dict.fromkeys(("drive", "_scaled", "_counted", "careful_step", "move"), _SHARES),
    **dict.fromkeys(("_random_direction", "_restart", "place", "_displacement"), _DRAWS),
    "_observe": "counts of channels, and their units",
}


def sources(*folders):
    for folder in folders:
        for path in sorted((PACKAGE / folder).glob("*.py")):
            yield path, ast.parse(path.read_text(encoding="utf-8"))


def functions(tree):
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]


def is_count(node):
    """Whether something can only be a number of rows, lanes or the like, or is a list to be repeated."""
    if isinstance(node, ast.BinOp):
        return is_count(node.left) or is_count(node.right)
    if isinstance(node, ast.Call):
        return ast.unparse(node.func) == "len"
    name = getattr(node, "id", getattr(node, "attr", ""))
    whole = isinstance(node, ast.Constant) and type(node.value) is int
    return whole or isinstance(node, ast.List | ast.Tuple) or name.isupper()


def products(function):
    """Products, quotients and powers that are no counts."""
    kinds = ast.Mult | ast.Div | ast.Pow
    found = [node for node in ast.walk(function) if isinstance(node, ast.BinOp) and isinstance(node.op, kinds)]
    return [ast.unparse(node) for node in found if not is_count(node)]


def test_the_search_finds_formulas():
    found = [products(function) for _, tree in sources("mechanics") for function in functions(tree)]
    assert sum(map(len, found)) > 500
    assert not products(ast.parse("block[(row + 2 * i) * LANES + lane] + PARTS * len(casters)"))


def test_an_engine_holds_no_formula():
    """A formula multiplies or divides quantities; what lays out and compiles states only counts."""
    found = {
        function.name: f"{path.name}: {', '.join(products(function))}"
        for path, tree in sources(*ENGINES)
        for function in functions(tree)
        if "caster_gym.mechanics" in path.read_text(encoding="utf-8") and products(function)
    }
    assert {name: where for name, where in found.items() if name not in ARITHMETIC} == {}
    assert set(found) >= {"check_memory", "_scaled"}  # the search finds some


class Anonymous(ast.NodeTransformer):
    """A function's own names replaced by their order."""

    def __init__(self, function):
        stored = [
            node.id for node in ast.walk(function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        ]
        self.names = {name: str(k) for k, name in enumerate(dict.fromkeys([*map(_name, function.args.args), *stored]))}

    def visit_Name(self, node):
        node.id = self.names.get(node.id, node.id)
        return node


def _name(argument):
    return argument.arg


def body_of(function):
    """What a function does, whatever it calls its arguments and variables; empty for a small one."""
    body = [node for node in function.body if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))]
    whole = Anonymous(function).visit(ast.Module(body, []))
    return ast.dump(whole) if len(list(ast.walk(whole))) >= SMALL else ""


def test_no_two_functions_do_the_same():
    where = defaultdict(list)
    for path in sorted({path.resolve() for top in (PACKAGE, PACKAGE.parent / "agents") for path in top.rglob("*.py")}):
        for function in functions(ast.parse(path.read_text(encoding="utf-8"))):
            where[body_of(function)].append(f"{path.parent.name}/{path.name} {function.name}")
    del where[""]
    assert len(where) > 1000
    assert [places for places in where.values() if len(places) > 1] == []


def test_types_of_arrays_have_their_names_from_one_module():
    texts = {path.name: path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")}
    assert [name for name, text in texts.items() if "\nArray = " in text or "\nArray: " in text] == ["arrays.py"]
