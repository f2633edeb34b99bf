"""Fields of classes in the reference: unit, default and comment, from the one line that declares each."""

import io
import re
import tokenize

import griffe


LABEL = re.compile(r"""^\w+\(\s*['"](?P<name>[^'"\[]+) \[(?P<unit>[^\]]*)\]['"]""")
DEFAULT = re.compile(r"\bdefault=(?P<value>.+?)(?:, \w+=.*)?\)$", re.DOTALL)


class Fields(griffe.Extension):
    """Adds an `Attributes:` section to the docstring of every class with annotated fields."""

    def on_class_members(self, *, cls, **_):
        """Describes fields once the class is read."""
        lines = [line for one in cls.attributes.values() if (line := _described(one))]
        if lines and cls.docstring is not None:
            text = "\n".join(f"    {line}" for line in lines)
            cls.docstring.value = f"{cls.docstring.value}\n\nAttributes:\n{text}"


def _described(field):
    """`name: comment [unit], by default value`; None for what is no field."""
    if field.name.startswith("_") or "instance-attribute" not in field.labels:
        return None
    value = str(field.value or "")
    label, default = LABEL.match(value), None
    if label or value.startswith("eqx.field"):
        found = DEFAULT.search(value)
        default = found and found["value"]
    else:
        default = (
            None if value.startswith("_") or "(" in value.removesuffix("()") else value or None
        )
    parts = [_comment(field) or (f"[{label['unit']}]" if label else "")]
    if default is not None:
        parts.append("absent by default" if default == "None" else f"by default `{default}`")
    return f"{field.name}: {', '.join(part for part in parts if part) or 'see its type'}"


def _comment(field):
    """What stands behind the declaration, or below it."""
    below = field.filepath.read_text("utf-8").splitlines()[field.endlineno :][:1]
    here = "\n".join(line.strip() for line in field.lines)
    return _behind(here) or _behind("\n".join(line.strip() for line in below if "# " in line[:6]))


def _behind(source):
    """Comments of some lines, as one text."""
    try:
        tokens = list(tokenize.generate_tokens(io.StringIO(source).readline))
    except (tokenize.TokenError, IndentationError):
        return ""
    comments = [one.string.lstrip("# ") for one in tokens if one.type == tokenize.COMMENT]
    return " ".join(comments)
