"""What a report may do in a browser: run what it holds, and fetch nothing."""

import re

#: Directives that a page needs; all else falls back to none of it.
NEEDED = {
    "default-src": {"'none'"},
    "script-src": {"'unsafe-inline'"},
    "style-src": {"'unsafe-inline'"},
    "img-src": {"data:"},
}


def test_the_policy_lets_a_page_reach_nothing(made):
    page = made.html
    (policy,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
    found = {}
    for directive in policy.split(";"):
        name, *sources = directive.split()
        assert name not in found
        found[name] = set(sources)
    assert found == NEEDED
    # It holds for what stands behind it: nothing runs before.
    before = page[: page.index("Content-Security-Policy")]
    assert not re.search(r"<(script|style|link|img)\b", before)
