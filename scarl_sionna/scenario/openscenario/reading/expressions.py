"""Values of attributes: parameters ``$name`` and expressions ``${...}``, with bounds on their size."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

LONGEST = 2000
"""Characters of an expression."""
_PARAMETER = re.compile(r"\$([A-Za-z_][A-Za-z0-9_]*)")
_DEEPEST = 50
_BINARY: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: math.fmod,
}
_FUNCTIONS: Mapping[str, Callable[..., float]] = {
    "round": lambda x: math.floor(x + 0.5),
    "floor": math.floor,
    "ceil": math.ceil,
    "sqrt": math.sqrt,
    "pow": lambda x, y: math.pow(x, y),
    "sign": lambda x: float((x > 0) - (x < 0)),
    "abs": abs,
    "min": min,
    "max": max,
}
_CONSTANTS: Mapping[str, float] = {"pi": math.pi}
"""Not in the standard, but in files for esmini."""
_COMPARED: Mapping[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}


def resolved(text: str, scope: Mapping[str, str]) -> str:
    """Return the value of an attribute: a literal, a parameter or an expression.

    Parameters
    ----------
    text : str
        As it stands in the file.
    scope : mapping
        Values of the parameters by their names.

    Raises
    ------
    ValueError
        If a parameter is not known, or an expression is none; says what.

    References
    ----------
    .. [1] ASAM OpenSCENARIO XML 1.3, "Reuse mechanisms": expressions with ``- + * / %``, ``round floor ceil sqrt pow
       sign abs min max``, ``not and or`` and comparisons.
    """
    text = text.strip()
    if text.startswith("${") and text.endswith("}"):
        return _value(text[2:-1], scope)
    if "$" not in text:
        return text
    whole = _PARAMETER.fullmatch(text)
    if whole is None:
        raise ValueError(f"'{text[:60]}' is neither a parameter nor an expression ${{...}}")
    return _known(whole[1], scope)


def _known(name: str, scope: Mapping[str, str]) -> str:
    if name not in scope:
        raise ValueError(f"parameter '{name}' is not declared (known: {', '.join(sorted(scope)) or 'none'})")
    return scope[name]


def _value(text: str, scope: Mapping[str, str]) -> str:
    if len(text) > LONGEST:
        raise ValueError(f"an expression of more than {LONGEST} characters")
    names: dict[str, Any] = {}

    def named(match: re.Match[str]) -> str:
        raw = _known(match[1], scope)
        key = f"_{len(names)}_"
        names[key] = _literal(raw)
        return f" {key} "

    source = _PARAMETER.sub(named, text).replace("true", "True").replace("false", "False").strip()
    try:
        tree = ast.parse(source, mode="eval")
        found = _evaluate(tree.body, names, 0)
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError(f"'{text[:60]}' is no expression") from None
    except ArithmeticError as error:
        raise ValueError(f"'{text[:60]}' has no value ({error})") from None
    except (TypeError, KeyError):
        raise ValueError(f"'{text[:60]}' is no expression of numbers") from None
    if isinstance(found, bool):
        return "true" if found else "false"
    if isinstance(found, float | int) and not math.isfinite(found):
        raise ValueError(f"'{text[:60]}' is not finite")
    return repr(int(found)) if isinstance(found, float) and found == int(found) and abs(found) < 1e15 else str(found)


def _literal(raw: str) -> float | bool | str:
    if raw in ("true", "false"):
        return raw == "true"
    try:
        return float(raw)
    except ValueError:
        return raw


def _evaluate(node: ast.expr, names: Mapping[str, Any], depth: int) -> Any:  # noqa: ANN401  # a number, truth or text
    if depth > _DEEPEST:
        raise SyntaxError
    inner = depth + 1
    if isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
        return float(node.value) if not isinstance(node.value, bool) else node.value
    if isinstance(node, ast.Name):
        return names[node.id] if node.id in names else _CONSTANTS[node.id]
    if isinstance(node, ast.BinOp):
        left, right = _evaluate(node.left, names, inner), _evaluate(node.right, names, inner)
        return _BINARY[type(node.op)](_number(left), _number(right))
    if isinstance(node, ast.UnaryOp):
        value = _evaluate(node.operand, names, inner)
        if isinstance(node.op, ast.Not):
            return not value
        return -_number(value) if isinstance(node.op, ast.USub) else _number(value)
    if isinstance(node, ast.BoolOp):
        values = [bool(_evaluate(one, names, inner)) for one in node.values]
        return all(values) if isinstance(node.op, ast.And) else any(values)
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        left, right = _evaluate(node.left, names, inner), _evaluate(node.comparators[0], names, inner)
        return _COMPARED[type(node.ops[0])](left, right)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        arguments = [_number(_evaluate(one, names, inner)) for one in node.args]
        try:
            return float(_FUNCTIONS[node.func.id](*arguments))
        except ValueError as error:
            raise ArithmeticError(str(error)) from None
    raise SyntaxError


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, float | int):
        raise TypeError
    return float(value)
