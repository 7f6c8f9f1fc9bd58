"""The text of a PDF as a reader's search finds it: glyphs by the fonts' maps to Unicode.

Enough for what the typesetter writes: no object streams, fonts of two bytes a glyph.
"""

import re
import zlib

_ESCAPES = {b"n": b"\n", b"r": b"\r", b"t": b"\t", b"b": b"\b", b"f": b"\f"}


def pdf_text(data):
    """All text of the pages; every string that is set at a place of its own is a line."""
    objects = {int(m[1]): m[2] for m in re.finditer(rb"(\d+) 0 obj\b(.*?)\bendobj", data, re.S)}
    return "\n".join(
        _page(_stream(objects[int(number)]), _fonts(body, objects))
        for body in objects.values()
        for number in re.findall(rb"/Type ?/Page\b.*?/Contents (\d+) 0 R", body, re.S)
    )


def _fonts(page, objects):
    """Maps to Unicode by the names that fonts have on a page."""
    for part in (rb"/Resources (\d+) 0 R", rb"/Font (\d+) 0 R"):
        named = re.search(part, page)
        page = objects[int(named[1])] if named else page
    maps = {}
    for name, number in re.findall(rb"/(f\d+) (\d+) 0 R", page):
        unicode = re.search(rb"/ToUnicode (\d+) 0 R", objects[int(number)])
        maps[name] = _map(_stream(objects[int(unicode[1])])) if unicode else {}
    return maps


def _stream(body):
    start = re.search(rb"stream\r?\n", body).end()
    raw = body[start : body.rindex(b"endstream")]
    return zlib.decompress(raw) if b"/FlateDecode" in body[:start] else raw


def _map(table):
    found = {}
    for block in re.findall(rb"beginbfchar(.*?)endbfchar", table, re.S):
        for glyph, text in re.findall(rb"<(\w+)>\s*<(\w+)>", block):
            found[int(glyph, 16)] = bytes.fromhex(text.decode()).decode("utf-16-be")
    return found


def _page(content, maps):
    lines, font, strings, name = [], {}, [], b""
    for token in _tokens(content):
        if token[:1] == b"(":
            strings.append(_unescaped(token[1:]))
        elif token[:1] == b"/":
            name = token[1:]
        elif token == b"Tf":
            font = maps[name]
        elif token in (b"TJ", b"Tj"):
            codes = b"".join(strings)
            glyphs = (int.from_bytes(codes[i : i + 2], "big") for i in range(0, len(codes), 2))
            lines.append("".join(font.get(glyph, "") for glyph in glyphs))
        if token.isalpha():  # an operator takes what stands before it
            strings = []
    return "\n".join(lines)


def _tokens(content):
    """Strings from their parenthesis on, names from their slash on, operators."""
    k = 0
    while k < len(content):
        if content[k : k + 1] == b"(":
            start, depth = k, 0
            while True:
                sign = content[k : k + 1]
                depth += (sign == b"(") - (sign == b")")
                k += 2 if sign == b"\\" else 1
                if depth == 0:
                    break
            yield content[start : k - 1]
        elif found := re.compile(rb"/?[A-Za-z][\w*]*").match(content, k):
            yield found[0]
            k = found.end()
        else:
            k += 1


def _unescaped(text):
    def plain(m):
        code = m[1]
        return bytes([int(code, 8)]) if code.isdigit() else _ESCAPES.get(code, code)

    return re.sub(rb"\\([0-7]{1,3}|.)", plain, text, flags=re.S)
