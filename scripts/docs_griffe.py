"""Docstrings for the documentation site.

ReStructuredText as Markdown, and fields of specifications with their descriptions.
"""

from __future__ import annotations

import ast
import re
import textwrap

from griffe import Attribute, Docstring, ExprCall, ExprKeyword, Extension, Object

_MATH = re.compile(r"^\.\. math::[ ]*(.*(?:\n(?:[ ]+.*|(?=\n[ ]{2,}\S)))*)", re.MULTILINE)
_ROLE = re.compile(r":(?:func|class|meth|mod|attr|data):`~?([^`]+)`")
_INLINE = re.compile(r":math:`([^`]+)`")
_REFERENCE = re.compile(r"^\.\. \[(\d+)\] ", re.MULTILINE)


def _equation(match: re.Match[str]) -> str:
    first, _, rest = match.group(1).partition("\n")
    lines = [first.strip(), *textwrap.dedent(rest).splitlines()]
    text = "\n".join(line for line in lines if line.strip())
    return f"$$\n{text}\n$$"


def markdown(text: str) -> str:
    """Return a docstring with its reStructuredText as Markdown."""
    text = _MATH.sub(_equation, text)
    text = _INLINE.sub(lambda match: f"${match.group(1)}$", text)
    text = _ROLE.sub(r"`\1`", text)
    return _REFERENCE.sub(r"\1. ", text)


class MarkdownDocstrings(Extension):
    """Griffe extension: docstrings are rewritten before they are parsed, pydantic fields get their description."""

    def on_instance(self, *, obj: Object, **others: object) -> None:
        """Rewrite the docstring of an object."""
        if obj.docstring is not None:
            obj.docstring.value = markdown(obj.docstring.value)

    def on_attribute_instance(self, *, attr: Attribute, **others: object) -> None:
        """Take ``Field(..., description=...)`` as the docstring of a field."""
        value = attr.value
        if attr.docstring is not None or not isinstance(value, ExprCall) or str(value.function) != "Field":
            return
        for argument in value.arguments:
            if isinstance(argument, ExprKeyword) and argument.name == "description":
                attr.docstring = Docstring(ast.literal_eval(str(argument.value)), parent=attr)
