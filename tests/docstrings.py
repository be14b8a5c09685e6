"""What the docstring of a public object has to say, and what of it is missing: shapes, units, Raises, sources."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import ModuleType

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from scarl_sionna.core.prompt.refusals import unit_of

ARRAY = re.compile(r"\b(NDArray|ArrayLike|ndarray|Array|Complex|Index|Floats)\b")
NUMBER = re.compile(r"\b(float|complex|FloatOrArray)\b")
NOT_A_QUANTITY = re.compile(r"Callable|np\.(u?int|bool)|bool_|Index|NDArray\[Any\]")
SHAPE = re.compile(
    r"\bshapes?\b|any shape|scalar|\bof each\b|\((?:\.{3}|[\w+* /-]+), ?(?:\.{3}|[\w+* /,-]*)\)|"
    r"\(N\)|one (?:row |entry |value )?(?:a|per) \w+"
)
UNITS = (
    r"\[(?:[^\]\d,]|1/|m2|\d)[^\]]{0,30}\]|\bmetres?\b|\bseconds?\b|\bradians?\b|\bdegrees?\b|\bhertz\b|\bdecibels?\b|"
    r"\bdB(?:m|sm|i)?\b|\bpixels?\b|\bpx\b|\brad\b|m/s\b|\bkelvin\b|\bwatts?\b|\bbytes\b|"
    r"\belectrons\b|\bkg/m3\b|\bunits? of\b|\bown units\b|\bin its unit\b|\bany one unit\b"
)
DIMENSIONLESS = (
    r"dimensionless|\bratio\b|\bshare\b|\bfraction\b|\bprobabilit|\blinear\b|\bfactor\b|"
    r"\bnumber of\b|\bunit\b|"
    r"\bdirection\b|\bindex\b|\brelative\b|quaternion|rotation matri|\bcosine\b|\bcodes?\b|\bweights?\b|"
    r"\b0 to 1\b|\bof 255\b|\bcovariance\b|\bpermittivity\b|\breflectance\b|\bcoefficients?\b|\bcolou?rs?\b|"
    r"\balbedo\b|\bexponent\b|\btoleranc|\bpolari[sz]ation\b|"
    r"\bmultiples? of\b|\bgain\b"
)
SAYS_UNIT = re.compile(UNITS)
SAYS_NONE = re.compile(DIMENSIONLESS, re.IGNORECASE)
NAMED_NONE = re.compile(
    r"(^|_)(cos|share|probability|ratio|fraction|pfa|normals?|factor|efficiency|wetness|turbidity|"
    r"permittivity|reflectance|transmittance|balance|exponent|weights?|index|rows|steps|k\d|p\d)(_|$)"
)
SUFFIX = re.compile(r"_(deg|db|dbm|dbsm|dbi|px|ns|dn|ms|hz|ghz|mm|km|pct)$")
REFERS = re.compile(r"\b[Aa]s (?:of|in|for|those of) [:`A-Z]|\b[Ss]ee :?[`:]|\bOf [:`]|:(?:func|class|meth|mod):`")
SOURCE = re.compile(
    r"\.\. \[\d|\[\d\]_|\bEqs?\. ?\(?\d|ITU-R|TR 38|\bDIN\b|\bISO\b|\bIEEE\b|\b(?:18|19|20)\d\d\b|[Ee]xact geometry|"
    r"[Bb]y definition|[Dd]efinition of|\.\. math::|Born and Wolf|Skolnik|SCaRL|Sionna|Nyquist|"
    r"kinematic|UN Regulation|by definition"
)


@dataclass(frozen=True)
class Need:
    """One thing that a docstring has to say, and whether it does."""

    kind: str
    where: str
    what: str
    met: bool


def sections(doc: str) -> dict[str, str]:
    """Return the sections of a NumPy docstring by their heading; what stands before the first is ``""``."""
    parts = re.split(r"^(\w[\w ]*)\n-{3,}[ ]*\n", doc, flags=re.MULTILINE)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def entries(section: str) -> dict[str, str]:
    """Return what a section says of each name; several names may share an entry."""
    found: dict[str, str] = {}
    names: list[str] = []
    for line in section.splitlines():
        head = re.match(r"([*\w][\w*, ]*?)(?: : (.*))?$", line)
        if head and not line.startswith(" "):
            names = [name.strip().lstrip("*") for name in head[1].split(",")]
            for name in names:
                found[name] = line
        else:
            for name in names:
                found[name] += "\n" + line
    return found


def _annotation(of: object) -> str:
    return of if isinstance(of, str) else getattr(of, "__name__", str(of))


def is_quantity(annotation: str) -> bool:
    """Return whether an annotation is that of numbers of physics."""
    is_number = bool(ARRAY.search(annotation) or NUMBER.search(annotation))
    return is_number and not NOT_A_QUANTITY.search(annotation)


def _quantity(name: str, annotation: str, said: str, where: str) -> Iterator[Need]:
    """Yield the needs of one value: a shape if it is an array, a unit if it is a number of physics."""
    if "Callable" in annotation:
        return
    refers = bool(REFERS.search(said))
    if ARRAY.search(annotation):
        yield Need("shape", where, name, refers or bool(SHAPE.search(said)))
    if is_quantity(annotation):
        met = refers or bool(
            SUFFIX.search(name) or NAMED_NONE.search(name) or SAYS_UNIT.search(said) or SAYS_NONE.search(said)
        )
        yield Need("unit", where, name, met)


def raises_itself(function: Callable[..., object]) -> bool:
    """Return whether the body of a function raises something that callers are meant to know."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError):
        return False
    root = tree.body[0]
    todo: list[ast.AST] = list(getattr(root, "body", []))
    while todo:
        node = todo.pop()
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda)):
            continue
        if isinstance(node, ast.Raise) and node.exc is not None:
            name = ast.unparse(node.exc).partition("(")[0]
            if name not in ("NotImplementedError", "AttributeError", "StopIteration", "AssertionError"):
                return True
        todo += ast.iter_child_nodes(node)
    return False


def needs_of_function(function: Callable[..., object], where: str, physics: bool, around: str = "") -> Iterator[Need]:
    """Yield what the docstring of a function or method has to say; `around` is that of its module."""
    doc = inspect.getdoc(function) or ""
    parts = sections(doc)
    said = entries(parts.get("Parameters", ""))
    hints = {name: _annotation(hint) for name, hint in inspect.get_annotations(function).items()}
    for name, hint in hints.items():
        if name != "return":
            yield from _quantity(name, hint, said.get(name, doc), where)
    result = hints.get("return", "None")
    yield from _quantity("return", result, parts.get("Returns") or parts.get("Yields") or doc, where)
    if raises_itself(function):
        yield Need("raises", where, "", "Raises" in parts or bool(re.search(r"\b[Rr]aises?\b", doc)))
    if physics and any(is_quantity(hint) for hint in hints.values()):
        yield Need("source", where, "", bool(SOURCE.search(doc) or SOURCE.search(around)))


def _field_needs(kind: type, where: str) -> Iterator[Need]:
    """Yield what is to be said of the fields of a specification or of a dataclass."""
    doc = inspect.getdoc(kind) or ""
    parts = sections(doc)
    said = entries(parts.get("Attributes", "") + "\n" + parts.get("Parameters", ""))
    units = getattr(kind, "_units", {})
    if issubclass(kind, BaseModel):
        for name, info in kind.model_fields.items():
            yield from _model_field(name, info, where, said.get(name, ""))
    elif dataclasses.is_dataclass(kind):
        for item in dataclasses.fields(kind):
            if not item.name.startswith("_"):
                text = said.get(item.name, doc) + (" [unit]" if item.name in units else "")
                yield from _quantity(item.name, _annotation(item.type), text, where)


def _model_field(name: str, info: FieldInfo, where: str, said: str) -> Iterator[Need]:
    if NUMBER.search(str(info.annotation)):
        text = f"{info.description or ''} {said}"
        unit = (
            unit_of(info)
            or SUFFIX.search(name)
            or NAMED_NONE.search(name)
            or SAYS_UNIT.search(text)
            or SAYS_NONE.search(text)
        )
        yield Need("unit", where, name, bool(unit or REFERS.search(text)))


def needs_of_class(kind: type, where: str) -> Iterator[Need]:
    """Yield what the docstrings of a class, its constructor, its public methods and its properties have to say."""
    doc = inspect.getdoc(kind) or ""
    parts = sections(doc)
    yield from _field_needs(kind, where)
    own = vars(kind)
    for name in ("__init__", "__post_init__"):
        made = own.get(name)
        if inspect.isfunction(made) and made.__module__ == kind.__module__ and raises_itself(made):
            yield Need("raises", where, name, "Raises" in parts or bool(re.search(r"\b[Rr]aises?\b", doc)))
    constructed = "__init__" in own and not issubclass(kind, BaseModel) and not dataclasses.is_dataclass(kind)
    if constructed and inspect.isfunction(own["__init__"]):
        said = entries(parts.get("Parameters", "") + "\n" + parts.get("Attributes", ""))
        for name, hint in inspect.get_annotations(own["__init__"]).items():
            if name != "return":
                yield from _quantity(name, _annotation(hint), said.get(name, doc), where)
    for name, member in own.items():
        if name.startswith("_"):
            continue
        inside = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        if isinstance(member, property):
            inside = member.fget
        elif hasattr(member, "func") and not inspect.isfunction(member):
            inside = member.func
        if inspect.isfunction(inside) and inside.__module__ == kind.__module__:
            yield from needs_of_function(inside, f"{where}.{name}", False)


def needs_of_module(module: ModuleType, physics: bool) -> Iterator[Need]:
    """Yield what the public functions and classes that a module defines have to say."""
    around = module.__doc__ or ""
    for name, item in vars(module).items():
        if name.startswith("_") or getattr(item, "__module__", None) != module.__name__:
            continue
        where = f"{module.__name__}.{name}"
        if inspect.isclass(item):
            yield from needs_of_class(item, where)
        elif callable(item):
            inner = inspect.unwrap(item)
            if inspect.isfunction(inner):
                yield from needs_of_function(inner, where, physics, around)
