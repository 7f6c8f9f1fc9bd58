"""What a careless colleague might make of an expression of Rust, and how it is planted.

The operators are those of `chance` (cosmic-ray's) and, of cargo-mutants, a function that returns
at once. Left out is what no switch at run time can change: constants where they are defined,
patterns, lengths of arrays, the texts inside of macros; a constant is changed where it is used.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import tree_sitter_rust
from tree_sitter import Language, Node, Parser

#: Other operators in place of each.
BINARY = {
    "+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",), "%": ("*",),
    "<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"),
    "==": ("!=",), "!=": ("==",), "&&": ("||",), "||": ("&&",),
    "<<": (">>",), ">>": ("<<",), "&": ("|",), "|": ("&",), "^": ("|",),
    "+=": ("-=",), "-=": ("+=",), "*=": ("/=",), "/=": ("*=",),
}  # fmt: skip

#: What a function returns at once in place of its result, by the beginning of its type.
RETURNED = {
    "": ("",), "bool": ("true", "false"), "f64": ("0.0", "1.0"),
    "usize": ("0", "1"), "Vec<": ("Vec::new()",), "Option<": ("None",),
}  # fmt: skip

#: Nothing below these can be switched at run time, or it is no code of the library.
FIXED = {
    "const_item", "static_item", "attribute_item", "inner_attribute_item", "macro_invocation",
    "macro_definition", "match_pattern", "range_pattern", "type_arguments", "array_type",
    "const_block", "enum_variant", "use_declaration", "scoped_identifier", "token_tree",
    "tuple_struct_pattern", "or_pattern",
}  # fmt: skip

CONSTANT = re.compile(r"[A-Z][A-Z0-9_]+")
NUMBER = re.compile(r"([0-9][0-9_]*(?:\.[0-9_]*)?)(_?(?:[iu](?:8|16|32|64|128|size)|f32|f64))?")


class Change(NamedTuple):
    """Bytes ``start`` to ``end`` of a source file become ``new`` while the fault is switched on."""

    operator: str
    start: int
    end: int
    new: str
    line: int


@functools.cache
def _parser() -> Parser:
    return Parser(Language(tree_sitter_rust.language()))


def changes(code: str) -> list[Change]:
    """All that the operators could plant, in the order of their places."""
    source = code.encode()
    return sorted(_below(_parser().parse(source).root_node, source), key=lambda c: c[1:4])


def _below(node: Node, source: bytes) -> Iterator[Change]:
    kept = node.type not in FIXED and not (node.type == "function_item" and _settled(node))
    tested = False
    for child in node.named_children if kept else ():
        if child.type == "attribute_item":
            tested = tested or child.text in (b"#[cfg(test)]", b'#[cfg(target_arch = "aarch64")]')
            continue
        if not tested and not _length(node, child):
            yield from _of(child, source)
            yield from _below(child, source)
        if "comment" not in child.type:
            tested = False


def _settled(function: Node) -> bool:
    """Whether it may run in the compiler."""
    first = function.named_children[0]
    return first.type == "function_modifiers" and b"const" in (first.text or b"")


def _length(parent: Node, child: Node) -> bool:
    """Whether it is the length of an array or the place in a tuple."""
    if parent.type == "array_expression":
        return parent.child_by_field_name("length") == child
    return parent.type == "field_expression" and parent.child_by_field_name("field") == child


def _of(node: Node, source: bytes) -> Iterator[Change]:
    """What can be made of this node itself."""
    text = source[node.start_byte : node.end_byte].decode()
    line = node.start_point[0] + 1

    def change(operator: str, new: str, at: Node = node) -> Change:
        return Change(operator, at.start_byte, at.end_byte, new, line)

    if node.type in ("binary_expression", "compound_assignment_expr"):
        sign = node.child_by_field_name("operator")
        if sign is None:
            return
        before, after = (source[a:b].decode() for a, b in (
            (node.start_byte, sign.start_byte), (sign.end_byte, node.end_byte)
        ))  # fmt: skip
        old = source[sign.start_byte : sign.end_byte].decode()
        for other in BINARY.get(old, ()):
            yield change(f"{old} to {other}", before + other + after)
    elif node.type == "unary_expression" and text[0] in "-!":
        yield change(f"without {text[0]}", text[1:])
    elif node.type in ("integer_literal", "float_literal"):
        yield from (change("number", new) for new in _numbers(text))
    elif node.type == "boolean_literal":
        yield change("truth", "false" if text == "true" else "true")
    elif node.type == "identifier" and CONSTANT.fullmatch(text):
        yield change("constant", f"({text} + {text})")
    elif node.type in ("if_expression", "while_expression"):
        condition = node.child_by_field_name("condition")
        if condition is not None and not condition.type.startswith("let_"):
            asked = source[condition.start_byte : condition.end_byte].decode()
            yield change("turned round", f"!({asked})", condition)
    elif node.type == "for_expression":
        value = node.child_by_field_name("value")
        if value is not None:
            asked = source[value.start_byte : value.end_byte].decode()
            yield change("no loop", f"({asked}).into_iter().take(0)", value)
    elif node.type == "function_item" and not _settled(node):
        yield from _returned(node, source)


def _numbers(text: str) -> Iterator[str]:
    """One more and one less; of integers none below 0."""
    match = NUMBER.fullmatch(text)
    if match is None:
        return
    digits, suffix = match[1].replace("_", ""), match[2] or ""
    whole = "." not in digits and not suffix.lstrip("_").startswith("f")
    for more in (1, -1):
        if whole and int(digits) + more >= 0:
            yield f"{int(digits) + more}{suffix}"
        elif not whole:
            yield f"({float(digits) + more!r}{suffix})"


def _returned(node: Node, source: bytes) -> Iterator[Change]:
    body, kind = node.child_by_field_name("body"), node.child_by_field_name("return_type")
    if body is None:
        return
    text = "" if kind is None else source[kind.start_byte : kind.end_byte].decode()
    for begins, all_new in RETURNED.items():
        if text == begins or (begins.endswith("<") and text.startswith(begins)):
            for new in all_new:
                place = body.start_byte + 1
                yield Change("at once", place, place, f" return {new};", node.start_point[0] + 1)


def switched(code: str, numbered: Sequence[tuple[int, Change]]) -> tuple[str, list[range]]:
    """The code with each change behind a question; bytes of it where each then stands."""
    source, parts, places = code.encode(), [], []
    end = length = 0
    for number, change in sorted(numbered, key=lambda pair: pair[1].start):
        old = source[change.start : change.end].decode()
        asked = f"crate::planted::is({number})"
        if change.operator == "at once":
            new = f" if {asked} {{{change.new} }} "
        elif change.operator == "no loop":
            new = f"({old}).into_iter().take(if {asked} {{ 0 }} else {{ usize::MAX }})"
        else:
            new = f"(if {asked} {{{change.new} }} else {{ {old} }})"
        parts += [source[end : change.start], new.encode()]
        length += len(parts[-2]) + len(parts[-1])
        places.append(range(length - len(parts[-1]), length))
        end = change.end
    return b"".join([*parts, source[end:]]).decode(), places
