"""A formula of position, read by planner itself: nothing of it is run as Python."""

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError

__all__ = ["FUNCTIONS", "VARIABLES", "ExpressionField", "parse_expression"]

Value = FloatArray | float

VARIABLES: Mapping[str, str] = MappingProxyType(
    {
        "x": "mm, in the part's own coordinates",
        "y": "mm",
        "z": "mm",
        "r": "mm from the z axis of the part's file",
        "d": "mm below the part's surface",
        "u": "0 to 1 along the part's longest side",
    }
)
_CONSTANTS = MappingProxyType({"pi": np.pi, "e": np.e})
FUNCTIONS: Mapping[str, tuple[int, Callable[..., Value]]] = MappingProxyType(
    {
        "sin": (1, np.sin), "cos": (1, np.cos), "tan": (1, np.tan), "asin": (1, np.arcsin),
        "acos": (1, np.arccos), "atan": (1, np.arctan), "atan2": (2, np.arctan2),
        "sinh": (1, np.sinh), "cosh": (1, np.cosh), "tanh": (1, np.tanh), "exp": (1, np.exp),
        "log": (1, np.log), "sqrt": (1, np.sqrt), "abs": (1, np.abs), "hypot": (2, np.hypot),
        "min": (2, np.minimum), "max": (2, np.maximum), "clamp": (3, np.clip),
    }
)  # fmt: skip
_BINARY: Mapping[type[ast.operator], Callable[[Value, Value], Value]] = MappingProxyType(
    {
        ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.true_divide,
        ast.Pow: np.power, ast.Mod: np.mod,
    }
)  # fmt: skip
_LONGEST, _DEEPEST, _LARGEST = 1000, 60, 1e300

Supply = Mapping[str, Callable[[FloatArray], FloatArray]]


@dataclass(frozen=True)
class ExpressionField:
    """A formula; at pitch h drawn within 3 h² / 8 of its second derivative over its gradient.

    Attributes
    ----------
    text
        The formula.
    origin_mm
        Where the part's own origin lies, as placed for printing.
    supply
        How to find ``d`` and ``u`` at points as placed.
    """

    text: str
    origin_mm: tuple[float, float, float]
    supply: Supply = field(repr=False, compare=False, default_factory=dict)

    @property
    def name(self) -> str:
        """Kind of field, as a plan names it."""
        return "expression"

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Field at points (n, 3) in mm: (n,)."""
        points = np.asarray(points_mm, dtype=np.float64)
        tree = parse_expression(self.text)
        x, y, z = (points - np.array(self.origin_mm)).T
        known: dict[str, Value] = {"x": x, "y": y, "z": z, **_CONSTANTS}
        used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        if "r" in used:
            known["r"] = np.sqrt(x * x + y * y)
        for name, find in self.supply.items():
            if name in used:
                known[name] = find(points)
        with np.errstate(all="ignore"):  # what is not finite is told with its place
            found = np.asarray(_value(tree.body, known), dtype=np.float64)
        return np.array(np.broadcast_to(found, len(points)))

    def description(self) -> dict[str, object]:
        """Everything needed to build the field again, as JSON values."""
        return {"name": self.name, "expression": self.text, "origin_mm": list(self.origin_mm)}


def parse_expression(text: str) -> ast.Expression:
    """Read a formula of numbers, variables, + - * / ** ^ %, parentheses and functions.

    Raises
    ------
    ArgumentError
        Anything else, with what it is and what may stand there.
    """
    if len(text) > _LONGEST:
        raise ArgumentError(f"expression of {len(text)} characters; up to {_LONGEST} are read")
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        place = getattr(error, "offset", None)
        where = f" near character {place}" if place else ""
        raise ArgumentError(
            f"expression {text!r}: it cannot be read{where}; write it like "
            '"0.5 + 0.5*sin(2*pi*x/20)"'
        ) from None
    _check(tree.body, text, 0)
    return tree


def _check(node: ast.expr, text: str, depth: int) -> None:
    if depth > _DEEPEST:
        raise ArgumentError(f"expression {text!r}: it is nested deeper than {_DEEPEST}")
    match node:
        case ast.Constant(value=bool() | str() | bytes() | complex() | None):
            pass
        case ast.Constant(value=int() | float() as number) if abs(number) < _LARGEST:
            return
        case ast.Name(id=name):
            if name in VARIABLES or name in _CONSTANTS:
                return
            raise ArgumentError(
                f"expression {text!r}: {name} is unknown; {_near(name, [*VARIABLES, *_CONSTANTS])}"
                f"variables are {', '.join([*VARIABLES, *_CONSTANTS])}"
            )
        case ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=operand):
            _check(operand, text, depth + 1)
            return
        case ast.BinOp(op=operator, left=left, right=right) if type(operator) in _BINARY:
            _check(left, text, depth + 1)
            _check(right, text, depth + 1)
            return
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            if name not in FUNCTIONS:
                raise ArgumentError(
                    f"expression {text!r}: there is no function {name}; "
                    f"{_near(name, list(FUNCTIONS))}functions are {', '.join(FUNCTIONS)}"
                )
            if len(arguments) != FUNCTIONS[name][0]:
                raise ArgumentError(
                    f"expression {text!r}: {name} takes {FUNCTIONS[name][0]} arguments, and got "
                    f"{len(arguments)}"
                )
            for argument in arguments:
                _check(argument, text, depth + 1)
            return
        case _:
            pass
    part = ast.get_source_segment(text.strip().replace("^", "**"), node) or type(node).__name__
    raise ArgumentError(
        f"expression {text!r}: {part!r} may not stand there; numbers, variables, + - * / ** %, "
        "parentheses and functions may"
    )


def _near(name: str, known: list[str]) -> str:
    from planner.errors import nearest_names

    near = nearest_names(name, known)
    return f"did you mean {near[0]}? " if near else ""


def _value(node: ast.expr, known: Mapping[str, Value]) -> Value:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name):
            return known[name]
        case ast.UnaryOp(op=sign, operand=operand):
            value = _value(operand, known)
            return -value if isinstance(sign, ast.USub) else value
        case ast.BinOp(op=operator, left=left, right=right):
            return _BINARY[type(operator)](_value(left, known), _value(right, known))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name][1](*(_value(argument, known) for argument in arguments))
        case _:
            raise ArgumentError(f"{type(node).__name__} is no part of a formula")
