"""Mutants of a module: one small mistake each, as somebody could make it."""

import ast
import copy
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

NEGATED = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
BOUNDARY = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
ARITHMETIC = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Div, ast.Mod: ast.Mult,
    ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
SCOPES = (ast.FunctionDef, ast.ClassDef)


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """One mistake: the function it is in, its family, the lines of its statement; its key outlives moved lines."""

    module: str
    scope: str
    family: str
    lines: range
    key: str
    source: str
    path: tuple[tuple[str, int | None], ...] | None
    changed: ast.AST

    def tree(self) -> ast.Module:
        """Return the module with the mistake; as it is without a path."""
        tree = ast.parse(self.source)
        if self.path is not None:
            _put(tree, self.path, self.changed)
        return ast.fix_missing_locations(tree)


def mutants(module: str, source: str) -> Iterator[Mutant]:
    """Yield all mutants of a source, in the order of its nodes."""
    tree, known = ast.parse(source), Counter()
    for path, scope, lines in _places(tree):
        before = _at(tree, path)
        for family, changed in _changes(before):
            key = f"{module}: {scope or 'module'}: {_text(before)} -> {_text(changed)}"
            known[key] += 1
            key += f" (#{known[key]})" if known[key] > 1 else ""
            yield Mutant(
                module=module, scope=scope, family=family, lines=lines, key=key, source=source, path=path,
                changed=changed,
            )  # fmt: skip


def _text(node: ast.AST) -> str:
    return " ".join(ast.unparse(node).split())


def _places(tree):
    """Yield the way to each node that may be changed, the function that it is in, and the lines of its statement."""

    def walk(node, path, names, function, lines):
        for name, value in ast.iter_fields(node):
            if isinstance(node, SCOPES) and name in ("decorator_list", "returns", "bases"):
                continue
            if name == "annotation" or isinstance(node, ast.JoinedStr):
                continue
            for number, child in enumerate(value if isinstance(value, list) else [value]):
                if not isinstance(child, ast.AST):
                    continue
                way = (*path, (name, number if isinstance(value, list) else None))
                body = name == "body" or not isinstance(node, ast.FunctionDef)
                inside = function if body else ""
                below = names
                if isinstance(child, SCOPES):
                    below = (*names, child.name)
                    inside = ".".join(below) if isinstance(child, ast.FunctionDef) else inside
                at = _header(child) if isinstance(child, ast.stmt) else lines
                if isinstance(child, ast.expr | ast.stmt) and not _said(child) and not isinstance(child, SCOPES):
                    yield way, inside, at
                if not _said(child):
                    yield from walk(child, way, below, inside, at)

    yield from walk(tree, (), (), "", range(0))


def _header(statement):
    """Lines of a statement without those of the statements in it."""
    body = getattr(statement, "body", None)
    last = max(statement.lineno, body[0].lineno - 1) if body else statement.end_lineno
    return range(statement.lineno, last + 1)


def _said(node):
    """Whether a node is a text that does nothing: a docstring."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield family and replacement of a node."""
    for family, maker in MAKERS.get(type(node), ()):
        for changed in maker(copy.deepcopy(node)):
            yield family, changed


def _compared(table):
    def make(node):
        for number, operator in enumerate(node.ops):
            if type(operator) in table:
                changed = copy.deepcopy(node)
                changed.ops[number] = table[type(operator)]()
                yield changed

    return make


def _arithmetic(node):
    if type(node.op) in ARITHMETIC:
        node.op = ARITHMETIC[type(node.op)]()
        yield node


def _either(node):
    node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
    yield node


def _without(node):
    """A part of `and`/`or` left out."""
    for number in range(len(node.values)):
        rest = [value for k, value in enumerate(node.values) if k != number]
        yield rest[0] if len(rest) == 1 else ast.BoolOp(op=node.op, values=rest)


def _unsigned(node):
    if isinstance(node.op, (ast.USub, ast.Not, ast.Invert)):
        yield node.operand


def _negated_test(node):
    node.test = ast.UnaryOp(op=ast.Not(), operand=node.test)
    yield node


def _constant(node):
    value = node.value
    if isinstance(value, bool):
        yield ast.Constant(value=not value)
    elif isinstance(value, int):
        yield ast.Constant(value=value + 1)
        yield ast.Constant(value=value - 1)
    elif isinstance(value, float):
        yield ast.Constant(value=value * 1.25 if value else 1.0)
        yield ast.Constant(value=value / 1.25 if value else -1.0)
    elif isinstance(value, str) and value:
        yield ast.Constant(value=f"{value}?")


def _deleted(node):
    yield ast.Pass()


def _returned(node):
    if isinstance(node.value, ast.Constant) and node.value.value is None:
        return
    if node.value is not None:
        empty = isinstance(node.value, ast.Constant) and node.value.value == ""
        yield ast.Return(value=ast.Constant(value="?" if empty else None))


MAKERS = {
    ast.Compare: [("comparison", _compared(NEGATED)), ("boundary", _compared(BOUNDARY))],
    ast.BinOp: [("arithmetic", _arithmetic)],
    ast.BoolOp: [("logic", _either), ("logic", _without)],
    ast.UnaryOp: [("negation", _unsigned)],
    ast.If: [("negation", _negated_test)],
    ast.IfExp: [("negation", _negated_test)],
    ast.While: [("negation", _negated_test)],
    ast.Constant: [("constant", _constant)],
    ast.Expr: [("deleted", _deleted)],
    ast.Assign: [("deleted", _deleted)],
    ast.AugAssign: [("deleted", _deleted), ("arithmetic", _arithmetic)],
    ast.Raise: [("deleted", _deleted)],
    ast.Return: [("return", _returned)],
}


def _at(tree, path):
    for name, number in path:
        tree = getattr(tree, name)
        tree = tree if number is None else tree[number]
    return tree


def _put(tree, path, node):
    *before, (name, number) = path
    holder = _at(tree, before)
    if number is None:
        setattr(holder, name, node)
    else:
        getattr(holder, name)[number] = node
